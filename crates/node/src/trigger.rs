//! A random trigger: the probability of sending keeps the estimator's belief Gaussian.

use crate::error::{Error, finite};

/// Probability `1 - exp(-innovation^2 precision / 2)` with which a sensor sends (Han and others 2015).
#[inline]
pub fn probability(innovation: f64, precision: f64) -> f64 {
    -libm::expm1(-0.5 * innovation * innovation * precision)
}

/// Whether the sample is sent. `uniform` is a new random number in `[0, 1)`, `precision` in inverse units squared.
///
/// # Errors
/// If the sample or its difference from the prediction is not finite.
#[inline]
pub fn speaks(sample: f64, prediction: f64, precision: f64, uniform: f64) -> Result<bool, Error> {
    let innovation = finite("innovation", finite("measurement", sample)? - prediction)?;
    Ok(uniform < probability(innovation, precision))
}
