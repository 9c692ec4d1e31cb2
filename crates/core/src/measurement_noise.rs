//! The measurement noise that a scheme assumes.

use nalgebra::{SMatrix, SVector};

/// A scheme whose likelihoods assume a certain measurement noise. A receiver compares it with the noise of the sensing model;
/// if the two differ it returns an error, since the belief would be wrong.
pub trait MeasurementNoise<const M: usize> {
    /// Noise covariance of a measurement whose noise-free value is `m`.
    fn noise_covariance_at(&self, m: &SVector<f64, M>) -> SMatrix<f64, M, M>;
}
