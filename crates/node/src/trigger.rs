//! A random trigger that keeps the belief Gaussian.

use crate::error::{Error, finite};

/// Probability `1 - exp(-innovation^2 precision / 2)` with which a sensor reports (Han and others 2015).
#[inline]
pub fn probability(innovation: f64, precision: f64) -> f64 {
    -libm::expm1(-0.5 * innovation * innovation * precision)
}

/// Whether the sample is reported; `uniform` is a new random number of `[0, 1)`, `precision` in inverse units squared.
///
/// # Errors
/// If the sample is not finite, or its distance from the prediction.
#[inline]
pub fn speaks(sample: f64, prediction: f64, precision: f64, uniform: f64) -> Result<bool, Error> {
    let innovation = finite("innovation", finite("measurement", sample)? - prediction)?;
    Ok(uniform < probability(innovation, precision))
}
