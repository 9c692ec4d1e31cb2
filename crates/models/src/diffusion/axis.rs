//! Diffusion along one coordinate.

use super::half_space::{self, Flux, Wall};
use crate::Error;
use fewbits_numerics::error::{finite, positive};
use std::f64::consts::PI;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Bounds {
    Open,
    Wall { wall: Wall, flux: Flux },
}

/// The Green's function of one coordinate: concentration (per metre) after a unit mass was released at one point.
///
/// With wind `v`, `c = c* exp(v (z - z0) / 2 kappa - v^2 t / 4 kappa)`, where `c*` diffuses without wind (equation 7 of the paper). If
/// the wind crosses a wall, the loss velocity for `c*` becomes `loss + v/2` if the wall's condition is about the total flux, and
/// `loss - v/2` if it is about the diffusive flux.
///
/// ```
/// use fewbits_models::diffusion::{Axis, Flux, Wall};
/// let open = Axis::open(1.3)?;
/// let ground = Axis::half_space(1.3, Wall::IMPERMEABLE)?;
/// assert!((ground.green(0.0, 1.0, 0.5) - 2.0 * open.green(0.0, 1.0, 0.5)).abs() < 1e-15);
/// let windy = Axis::half_space(1.3, Wall::permeable(0.8)?)?.with_wind(-0.9, Flux::Total)?;
/// assert!((windy.green(1.0, 1.0, 1.0) - 0.269_042_819_271_137).abs() < 1e-13);
/// # Ok::<(), fewbits_models::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    diffusivity: f64,
    wind: f64,
    bounds: Bounds,
}

impl Axis {
    /// A coordinate without walls, `diffusivity` in m^2/s.
    ///
    /// # Errors
    /// If `diffusivity` is not a positive number.
    pub fn open(diffusivity: f64) -> Result<Self, Error> {
        Ok(Self {
            diffusivity: positive("diffusivity", diffusivity)?,
            wind: 0.0,
            bounds: Bounds::Open,
        })
    }

    /// The coordinate `z >= 0` above a wall at 0 (equation 5).
    ///
    /// # Errors
    /// If `diffusivity` is not a positive number.
    pub fn half_space(diffusivity: f64, wall: Wall) -> Result<Self, Error> {
        let bounds = Bounds::Wall {
            wall,
            flux: Flux::Total,
        };
        Ok(Self {
            bounds,
            ..Self::open(diffusivity)?
        })
    }

    /// The same coordinate with a wind along it, in m/s; `flux` states which flux the wall's condition is about.
    ///
    /// # Errors
    /// If `wind` is not finite.
    pub fn with_wind(self, wind: f64, flux: Flux) -> Result<Self, Error> {
        finite("wind", wind)?;
        let bounds = match self.bounds {
            Bounds::Wall { wall, .. } => Bounds::Wall { wall, flux },
            Bounds::Open => Bounds::Open,
        };
        Ok(Self { wind, bounds, ..self })
    }

    /// Diffusivity, m^2/s.
    pub(crate) fn diffusivity(&self) -> f64 {
        self.diffusivity
    }

    /// Concentration at `field`, `age` seconds after a unit mass was released at `source`, per metre. Zero outside the walls,
    /// and at age zero and before.
    pub fn green(&self, field: f64, source: f64, age: f64) -> f64 {
        if age <= 0.0 {
            return 0.0;
        }
        let k = self.diffusivity;
        let distance = field - source;
        match self.bounds {
            // Equation 7 with its Gaussian completed to a square: the mass moves with the wind.
            Bounds::Open => {
                let spread = 4.0 * k * age;
                let moved = distance - self.wind * age;
                (-moved * moved / spread).exp() / (PI * spread).sqrt()
            }
            Bounds::Wall { wall, flux } => {
                let v = self.wind;
                let change = match flux {
                    Flux::Total => 0.5 * v,
                    Flux::Diffusive => -0.5 * v,
                };
                // ln of the factor by which the wind changes c*.
                let shift = v * distance / (2.0 * k) - v * v * age / (4.0 * k);
                half_space::green(field, source, age, k, wall.loss() + change, shift)
            }
        }
    }
}
