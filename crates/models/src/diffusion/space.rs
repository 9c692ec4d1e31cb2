//! Diffusion in three dimensions.

use super::axis::Axis;
use super::integrate::over_ages;
use crate::Error;
use fewbits_numerics::error::refuse;
use nalgebra::Vector3;

/// The concentration after the instantaneous release of a unit mass at one point.
///
/// Laws: `green` is zero at age zero and before, and never negative or NaN. Without wind `green(a, b, t) = green(b, a, t)`. Its integral
/// over the field is one if no wall absorbs, and otherwise never grows.
pub trait ImpulseResponse {
    /// Concentration at `field` (kg/m^3 per kg), `age` seconds after the release at `source`.
    fn green(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> f64;

    /// Diffusivity, m^2/s.
    fn diffusivity(&self) -> f64;
}

/// An environment whose Green's function is the product of those of three coordinates: unbounded or half-space, with wind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Space {
    axes: [Axis; 3],
}

impl Space {
    /// The product of three coordinates.
    ///
    /// # Errors
    /// If the diffusivities differ: the product does not solve the diffusion equation then.
    pub fn new(axes: [Axis; 3]) -> Result<Self, Error> {
        let expected = axes[0].diffusivity();
        match axes.iter().find(|axis| axis.diffusivity() != expected) {
            None => Ok(Self { axes }),
            Some(other) => refuse("diffusivity", other.diffusivity(), format!("{expected} on every axis")),
        }
    }
}

impl ImpulseResponse for Space {
    fn green(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> f64 {
        (0..3).map(|i| self.axes[i].green(field[i], source[i], age)).product()
    }

    fn diffusivity(&self) -> f64 {
        self.axes[0].diffusivity()
    }
}

/// Concentration per unit rate (kg/m^3 per kg/s) of a source that has released at a constant rate for `age` seconds: the integral of the
/// Green's function over the age, computed in `u = age^(-1/2)`, in which it is smooth. Relative accuracy 1e-12.
///
/// If source and field are closer than `closest` metres, they are moved apart along x: the concentration is infinite at the source.
pub fn step_response(
    response: &impl ImpulseResponse,
    field: &Vector3<f64>,
    source: &Vector3<f64>,
    age: f64,
    closest: f64,
) -> f64 {
    if age <= 0.0 {
        return 0.0;
    }
    let distance = (field - source).norm();
    let field = if distance < closest {
        source + Vector3::new(closest, 0.0, 0.0)
    } else {
        *field
    };
    over_ages(response.diffusivity(), distance.max(closest), age, |since| response.green(&field, source, since))
}
