//! Layered media by finite volumes: the numeric Green's function, and the referee of the closed forms.

use super::half_space::{Flux, Wall};
use crate::Error;
use fewbits_numerics::error::{at_least_one, finite, positive};
use fewbits_numerics::quadrature::Rule;
use fewbits_numerics::{ArgumentError, tridiagonal};
use std::f64::consts::TAU;

/// Layers stacked along one coordinate from 0 up, with a wall at each end, and a wind along it.
///
/// Cells of equal width with fluxes through their faces, so that mass is kept to rounding; a trapezoidal rule in time that begins
/// with four implicit half steps, which damp what the point release excites. The error falls as the square of the width and of
/// the step.
///
/// In three dimensions nothing changes along the layers, so the Green's function is a Hankel transform: for every wavenumber `k`
/// one problem along the coordinate in which the substance decays at the rate `kappa(z) k^2`.
///
/// ```
/// use fewbits_models::diffusion::{Axis, Layered, Wall};
/// let wall = Wall::permeable(0.8)?;
/// let layered = Layered::new(&[(12.0, 1.3)], [wall, Wall::IMPERMEABLE], 2400)?;
/// let exact = Axis::half_space(1.3, wall)?.green(0.5, 1.0, 1.0);
/// assert!((layered.green(0.5, 1.0, 1.0, 400)? / exact - 1.0).abs() < 1e-4);
/// # Ok::<(), fewbits_models::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Layered {
    width: f64,
    /// Diffusivity of every cell.
    diffusivities: Vec<f64>,
    walls: [Wall; 2],
    wind: f64,
    flux: Flux,
}

/// The largest number of cells.
const MOST_CELLS: usize = 1_000_000;

impl Layered {
    /// Layers of the given thickness (m) and diffusivity (m^2/s), the one at 0 first, between two walls, in `cells` cells.
    ///
    /// # Errors
    /// If there is no layer, a number is not positive, or `cells` is not between 2 and 10^6.
    pub fn new(layers: &[(f64, f64)], walls: [Wall; 2], cells: usize) -> Result<Self, Error> {
        at_least_one("layers", layers.len())?;
        if !(2..=MOST_CELLS).contains(&cells) {
            return Err(ArgumentError::new("cells", cells, "2 to 1000000").into());
        }
        for (thickness, diffusivity) in layers {
            positive("thickness", *thickness)?;
            positive("diffusivity", *diffusivity)?;
        }
        let height: f64 = layers.iter().map(|layer| layer.0).sum();
        let width = positive("height", height)? / cells as f64;
        let diffusivity = |i: usize| {
            let (mut z, at) = (0.0, (i as f64 + 0.5) * width);
            let found = layers.iter().find(|layer| {
                z += layer.0;
                at < z
            });
            found.or(layers.last()).map_or(0.0, |layer| layer.1)
        };
        Ok(Self {
            width,
            diffusivities: (0..cells).map(diffusivity).collect(),
            walls,
            wind: 0.0,
            flux: Flux::Total,
        })
    }

    /// The same with a wind along the coordinate, m/s; `flux` says what the wall laws are about.
    ///
    /// # Errors
    /// If `wind` is not finite.
    pub fn with_wind(self, wind: f64, flux: Flux) -> Result<Self, Error> {
        finite("wind", wind)?;
        Ok(Self { wind, flux, ..self })
    }

    /// Concentration at `field`, `age` seconds after a unit mass was released at `source`, per metre, by `steps` steps in time.
    /// Zero outside the layers and at age zero and before.
    ///
    /// # Errors
    /// If `steps` is zero, or an argument is not finite.
    pub fn green(&self, field: f64, source: f64, age: f64, steps: usize) -> Result<f64, Error> {
        Ok(self.at(&self.profile(source, age, steps, 0.0)?, finite("field", field)?))
    }

    /// The same in three dimensions, `distance` metres from the source along the layers, per m^3: the Hankel transform over
    /// `waves` wavenumbers. Accurate where `distance` is not many diffusion lengths `sqrt(4 kappa t)`.
    ///
    /// # Errors
    /// As [`Layered::green`], or if `waves` is zero or `distance` negative.
    pub fn green_3d(
        &self,
        distance: f64,
        (field, source): (f64, f64),
        age: f64,
        (steps, waves): (usize, usize),
    ) -> Result<f64, Error> {
        fewbits_numerics::error::non_negative("distance", distance)?;
        at_least_one("waves", waves)?;
        if age <= 0.0 {
            return Ok(0.0);
        }
        // The slowest layer decides how far the transform reaches.
        let slowest = self.diffusivities.iter().copied().fold(f64::INFINITY, f64::min);
        let last = (40.0 / (slowest * age)).sqrt();
        let mut sum = 0.0;
        for (k, weight) in Rule::gauss_legendre(waves).on(0.0, last) {
            let profile = self.profile(source, age, steps, k)?;
            sum += weight * k * libm::j0(k * distance) * self.at(&profile, field);
        }
        Ok((sum / TAU).max(0.0))
    }

    /// Concentration in every cell of the mode of wavenumber `k` along the layers.
    fn profile(&self, source: f64, age: f64, steps: usize, k: f64) -> Result<Vec<f64>, Error> {
        at_least_one("steps", steps)?;
        finite("source", source)?;
        let count = self.diffusivities.len();
        let mut c = vec![0.0; count];
        if !(age > 0.0 && (0.0..=self.width * count as f64).contains(&source)) {
            return Ok(c);
        }
        // Shared between two cells so that mass and place are kept.
        let position = (source / self.width - 0.5).clamp(0.0, (count - 1) as f64);
        let (cell, share) = ((position as usize).min(count - 2), position - (position as usize).min(count - 2) as f64);
        c[cell] += (1.0 - share) / self.width;
        c[cell + 1] += share / self.width;
        let step = age / steps as f64;
        let (below, diagonal, above) = self.rates(k);
        let implicit = |factor: f64| -> [Vec<f64>; 3] {
            let scaled = |v: &[f64]| v.iter().map(|x| -factor * x).collect::<Vec<_>>();
            [
                scaled(&below),
                diagonal.iter().map(|x| 1.0 - factor * x).collect(),
                scaled(&above),
            ]
        };
        // An implicit half step and the implicit part of a trapezoidal step have the same matrix.
        let matrix = implicit(0.5 * step);
        let solve = |right: &[f64]| tridiagonal::solve(&matrix[0], &matrix[1], &matrix[2], right);
        for _ in 0..4.min(2 * steps) {
            c = solve(&c)?;
        }
        for _ in 2..steps {
            let right: Vec<f64> = (0..count)
                .map(|i| {
                    let low = if i > 0 { below[i - 1] * c[i - 1] } else { 0.0 };
                    let high = if i + 1 < count { above[i] * c[i + 1] } else { 0.0 };
                    c[i] + 0.5 * step * (low + diagonal[i] * c[i] + high)
                })
                .collect();
            c = solve(&right)?;
        }
        Ok(c)
    }

    /// `dc/dt` as a tridiagonal matrix: below, diagonal, above.
    fn rates(&self, k: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let (h, count, v) = (self.width, self.diffusivities.len(), self.wind);
        let (mut below, mut diagonal, mut above) = (vec![0.0; count - 1], vec![0.0; count], vec![0.0; count - 1]);
        for i in 0..count - 1 {
            let (a, b) = (self.diffusivities[i], self.diffusivities[i + 1]);
            // Two half cells in series; the wind carries the mean of both cells upwards.
            let conductance = 2.0 * a * b / (a + b) / h;
            diagonal[i] -= (conductance + 0.5 * v) / h;
            above[i] += (conductance - 0.5 * v) / h;
            diagonal[i + 1] -= (conductance - 0.5 * v) / h;
            below[i] += (conductance + 0.5 * v) / h;
        }
        for (wall, cell, outwards) in [(self.walls[0], 0, -v), (self.walls[1], count - 1, v)] {
            let half = 2.0 * self.diffusivities[cell] / h;
            diagonal[cell] -= self.outflow(wall.loss(), half, outwards) / h;
        }
        for (rate, diffusivity) in diagonal.iter_mut().zip(&self.diffusivities) {
            *rate -= diffusivity * k * k;
        }
        (below, diagonal, above)
    }

    /// Flux out of the cell at a wall per unit of concentration in it. `half` is the conductance of half a cell, `outwards` the
    /// wind towards the wall; the concentration at the wall follows from the wall law.
    fn outflow(&self, loss: f64, half: f64, outwards: f64) -> f64 {
        if loss == f64::INFINITY {
            return half;
        }
        // Total flux: half (c - w) + outwards w = loss w. Diffusive flux: half (c - w) = loss w, and the wind comes on top.
        match self.flux {
            Flux::Total => loss * half / (half + loss - outwards),
            Flux::Diffusive => (loss + outwards) * half / (half + loss),
        }
    }

    /// Concentration between the centres of cells, by straight lines.
    fn at(&self, profile: &[f64], z: f64) -> f64 {
        let count = profile.len();
        if !(0.0..=self.width * count as f64).contains(&z) {
            return 0.0;
        }
        let position = (z / self.width - 0.5).clamp(0.0, (count - 1) as f64);
        let cell = (position as usize).min(count - 2);
        profile[cell] + (position - cell as f64) * (profile[cell + 1] - profile[cell])
    }
}
