//! The region on the ground where the concentration exceeds a threshold.

use super::air::{Air, Ground, MIN_MAGNITUDE};
use crate::Error;
use fewbits_numerics::error::positive;
use fewbits_numerics::roots::bracketed;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Radius (m) of the disk on impermeable ground, without wind, in which the concentration of a source exceeds `threshold` (kg/m^3), `age`
/// seconds after it began to release `rate` (kg/s). It is the root `R` of `rate erfc(R / sqrt(4 kappa t)) / (2 pi kappa R) = threshold`;
/// zero at age zero.
///
/// # Errors
/// If `rate`, `threshold` or `diffusivity` is not a positive number.
pub fn contour_radius(rate: f64, threshold: f64, age: f64, diffusivity: f64) -> Result<f64, Error> {
    positive("rate", rate)?;
    positive("threshold", threshold)?;
    let air = Air::new(diffusivity, Vector3::zeros(), Ground::Impermeable)?.with_closest(MIN_MAGNITUDE)?;
    let excess = |log_radius: f64| {
        let field = Vector3::x() * log_radius.exp();
        (rate * air.concentration(&field, &Vector3::zeros(), age) / threshold).ln()
    };
    // Upper bound: without the factor erfc.
    let high = rate / (2.0 * PI * diffusivity * threshold);
    let low = MIN_MAGNITUDE.max(high * 1e-12).ln();
    if excess(low) <= 0.0 {
        return Ok(0.0);
    }
    // If rounding leaves no change of sign, the root is at the bound.
    Ok(bracketed(excess, low, high.ln(), 0.0).map_or(high, f64::exp))
}
