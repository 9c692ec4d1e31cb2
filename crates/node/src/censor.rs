//! Censoring sensors: a sample is sent only if it is far enough from its prediction.
//!
//! | threshold | function |
//! |---|---|
//! | known for each slot: a constant, or a table made beforehand | [`speaks`]; for integer codes, [`speaks_of_codes`] |
//! | computed from the covariance that is broadcast with the prediction | [`half_width`] |
//! | about the sensor's own prediction, without any broadcast | [`OwnFilter`] |

use crate::error::{Error, finite};
use crate::math::sqrt;

/// Whether the sample is sent: `|sample - prediction| >= half_width`. A tie is sent.
///
/// # Errors
/// If the sample or the prediction is not finite, or the half width is NaN.
#[inline]
pub fn speaks(sample: f64, prediction: f64, half_width: f64) -> Result<bool, Error> {
    let innovation = finite("measurement", sample)? - finite("prediction", prediction)?;
    if half_width.is_nan() {
        return Err(Error::new("half_width", half_width, "a number"));
    }
    Ok(reaches(innovation, half_width))
}

/// Whether an innovation is sent: `|innovation| >= half_width`. NaN is not.
#[inline]
pub fn reaches(innovation: f64, half_width: f64) -> bool {
    innovation.abs() >= half_width
}

/// [`speaks`] for integer codes, without floating point.
#[inline]
pub fn speaks_of_codes(sample: i32, prediction: i32, half_width: u32) -> bool {
    sample.abs_diff(prediction) >= half_width
}

/// Half width `sqrt(threshold S)` of the interval of silence, with `S = h P h' + noise_variance`. `row` is the measurement row `h`,
/// `covariance` the broadcast `P`.
///
/// # Errors
/// If `threshold S` is negative or not finite.
pub fn half_width<const D: usize>(
    row: &[f64; D],
    covariance: &[[f64; D]; D],
    noise_variance: f64,
    threshold: f64,
) -> Result<f64, Error> {
    let mut variance = 0.0;
    for j in 0..D {
        let mut through = 0.0;
        for i in 0..D {
            through += row[i] * covariance[i][j];
        }
        variance += through * row[j];
    }
    let square = threshold * (variance + noise_variance);
    if square.is_finite() && square >= 0.0 {
        Ok(sqrt(square))
    } else {
        Err(Error::new("covariance", square, "threshold times innovation variance finite, 0 or above"))
    }
}

/// A sensor of scalar samples `h x + noise` that compares them with the prediction of its own filter. It updates the filter with
/// every sample, whether it sends it or not.
///
/// ```text
/// predicted = F estimate,  innovation = sample - h predicted
/// report the sample if |innovation| >= half_width
/// estimate = predicted + gain innovation
/// ```
///
/// Gain and half width follow from the models without data. For a constant model they are constant after a few slots; otherwise
/// use a table with one entry per slot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnFilter<const D: usize> {
    transition: [[f64; D]; D],
    row: [f64; D],
    estimate: [f64; D],
}

impl<const D: usize> OwnFilter<D> {
    /// A filter with transition matrix `F` (by rows), measurement row `h` and the estimate before the first slot.
    ///
    /// # Errors
    /// If a number is not finite.
    pub fn new(transition: [[f64; D]; D], row: [f64; D], estimate: [f64; D]) -> Result<Self, Error> {
        for value in transition.iter().flatten() {
            finite("transition", *value)?;
        }
        for value in &row {
            finite("row", *value)?;
        }
        for value in &estimate {
            finite("estimate", *value)?;
        }
        Ok(Self {
            transition,
            row,
            estimate,
        })
    }

    /// The estimate after the last sample.
    pub fn estimate(&self) -> &[f64; D] {
        &self.estimate
    }

    /// Whether the sample is sent. Updates the filter with it in any case.
    ///
    /// # Errors
    /// If the sample is not finite, the half width is NaN, or the estimate would not be finite. The filter is then unchanged.
    pub fn speaks(&mut self, sample: f64, gain: &[f64; D], half_width: f64) -> Result<bool, Error> {
        let mut predicted = [0.0; D];
        for (value, row) in predicted.iter_mut().zip(&self.transition) {
            *value = product(row, &self.estimate);
        }
        let prediction = product(&self.row, &predicted);
        let report = speaks(sample, prediction, half_width)?;
        let innovation = sample - prediction;
        for (value, gain) in predicted.iter_mut().zip(gain) {
            *value = finite("gain", *value + gain * innovation)?;
        }
        self.estimate = predicted;
        Ok(report)
    }
}

/// The scalar product, summed in order.
fn product<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += a * b;
    }
    sum
}
