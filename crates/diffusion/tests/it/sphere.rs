//! The inside of a ball.

use super::bessel::{spherical, spherical_derivative, zeros};
use super::slab::SlabWall;
use fewbits_models::Error;
use fewbits_numerics::error::positive;
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Modes are summed until `exp(-40)` is left.
const DECAY: f64 = 40.0;
/// The largest zero that is ever computed.
const LARGEST_ZERO: f64 = 100.0;

/// The Green's function of diffusion in a ball about the origin: concentration (per m^3) of a unit mass.
///
/// Eigenfunctions `j_l(b r / a) P_l(cos gamma)`, `b` running over the zeros of `j_l'` (impermeable) or `j_l` (absorbing). They
/// are summed down to `exp(-40)` as long as that needs no zero above 100, that is for `kappa t > 0.004 a^2`; before, the wall
/// is taken for flat (one image), which errs by a share of the order of `sqrt(kappa t) / a` next to the wall.
#[derive(Debug, Clone)]
pub struct Sphere {
    radius: f64,
    diffusivity: f64,
    wall: SlabWall,
    modes: OnceLock<Vec<Mode>>,
}

#[derive(Debug, Clone, Copy)]
struct Mode {
    degree: u32,
    zero: f64,
    /// `(2 l + 1) / (4 pi N)` for a unit radius.
    weight: f64,
}

impl Sphere {
    /// A ball of the given radius in metres; `diffusivity` in m^2/s.
    ///
    /// # Errors
    /// If `radius` or `diffusivity` is not a positive number.
    pub fn new(radius: f64, diffusivity: f64, wall: SlabWall) -> Result<Self, Error> {
        Ok(Self {
            radius: positive("radius", radius)?,
            diffusivity: positive("diffusivity", diffusivity)?,
            wall,
            modes: OnceLock::new(),
        })
    }

    /// Concentration at `field`, `age` seconds after a unit mass was released at `source`, per m^3. Zero outside the ball.
    pub fn green(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> f64 {
        let (a, b) = (field / self.radius, source / self.radius);
        let (r, r0) = (a.norm(), b.norm());
        if age <= 0.0 || !(r <= 1.0 && r0 <= 1.0) {
            return 0.0;
        }
        let cosine = if r > 0.0 && r0 > 0.0 {
            (a.dot(&b) / (r * r0)).clamp(-1.0, 1.0)
        } else {
            1.0
        };
        let scaled = self.diffusivity * age / (self.radius * self.radius);
        let unit = if DECAY / scaled > LARGEST_ZERO * LARGEST_ZERO {
            short(r, r0, cosine, scaled, self.wall)
        } else {
            self.series(r, r0, cosine, scaled)
        };
        unit.max(0.0) / self.radius.powi(3)
    }

    fn series(&self, r: f64, r0: f64, cosine: f64, scaled: f64) -> f64 {
        let mut sum = if self.wall == SlabWall::Impermeable {
            0.75 / PI
        } else {
            0.0
        };
        let largest = (DECAY / scaled).sqrt().min(LARGEST_ZERO);
        let legendre = legendre(largest as usize + 1, cosine);
        for mode in self.modes.get_or_init(|| modes(self.wall)) {
            let exponent = mode.zero * mode.zero * scaled;
            if exponent > DECAY {
                // Modes are sorted by their zeros.
                break;
            }
            let shape = spherical(mode.degree, mode.zero * r) * spherical(mode.degree, mode.zero * r0);
            let polynomial = legendre.get(mode.degree as usize).copied().unwrap_or(0.0);
            sum += mode.weight * polynomial * shape * (-exponent).exp();
        }
        sum
    }
}

/// `P_0(x) ... P_degree(x)`.
fn legendre(degree: usize, x: f64) -> Vec<f64> {
    let mut values = vec![1.0, x];
    for l in 1..degree {
        let n = l as f64;
        values.push(((2.0 * n + 1.0) * x * values[l] - n * values[l - 1]) / (n + 1.0));
    }
    values
}

/// Every mode of the unit ball, by increasing zero.
fn modes(wall: SlabWall) -> Vec<Mode> {
    let mut modes = Vec::new();
    for degree in 0..LARGEST_ZERO as u32 {
        let l = f64::from(degree);
        // No positive zero lies below the degree.
        let start = l.max(0.5);
        let found = match wall {
            SlabWall::Impermeable => zeros(|x| spherical_derivative(degree, x), start, LARGEST_ZERO),
            SlabWall::Absorbing => zeros(|x| spherical(degree, x), start, LARGEST_ZERO),
        };
        modes.extend(found.into_iter().map(|zero| {
            let norm = match wall {
                SlabWall::Impermeable => 0.5 * (1.0 - l * (l + 1.0) / (zero * zero)) * spherical(degree, zero).powi(2),
                SlabWall::Absorbing => 0.5 * spherical(degree + 1, zero).powi(2),
            };
            Mode {
                degree,
                zero,
                weight: (2.0 * l + 1.0) / (4.0 * PI * norm),
            }
        }));
    }
    modes.sort_by(|a, b| a.zero.total_cmp(&b.zero));
    modes
}

/// Direct and mirrored Gaussian, the wall taken for flat at the point nearest to the source.
fn short(r: f64, r0: f64, cosine: f64, scaled: f64, wall: SlabWall) -> f64 {
    let at = |radius: f64| (-(r * r + radius * radius - 2.0 * r * radius * cosine) / (4.0 * scaled)).exp();
    let sign = match wall {
        SlabWall::Impermeable => 1.0,
        SlabWall::Absorbing => -1.0,
    };
    (at(r0) + sign * at(2.0 - r0)) / (4.0 * PI * scaled).powf(1.5)
}
