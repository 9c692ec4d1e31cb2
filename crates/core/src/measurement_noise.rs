//! The noise that a scheme counts on.

use nalgebra::{SMatrix, SVector};

/// A scheme that says which noise its reports' probabilities suppose. A receiver compares it with the noise of the sensing model that
/// simulates or describes the sensor: two different numbers are an error and no quietly wrong belief.
pub trait MeasurementNoise<const M: usize> {
    /// Noise covariance of a measurement whose noise-free value is `m`.
    fn noise_covariance_at(&self, m: &SVector<f64, M>) -> SMatrix<f64, M, M>;
}
