//! The assumed-density filter: one update for every factor.

use crate::Error;
use fewbits_core::{Factor, Gaussian};
use nalgebra::{Cholesky, SMatrix, SVector};

/// What an update reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct UpdateInfo<const D: usize, const M: usize> {
    /// `ln p(observation | past)`, the increment of the log-likelihood of the data.
    pub log_likelihood: f64,
    /// Mean of the noise-free measurement after the observation, minus before.
    pub correction: SVector<f64, M>,
    /// Regression of the state on the noise-free measurement, `G = P H' (H P H')^-1`.
    pub gain: SMatrix<f64, D, M>,
}

/// Gaussian update through a linear(ised) sensor: what the factor says about `m = H x`, `x` follows by regression.
///
/// ```text
/// m ~ N(H mean, V),  V = H P H'
/// T = tilted moments of m given the observation
/// G = P H' V^-1
/// mean = mean + G (T.mean - H mean)
/// P = (I - G H) P (I - G H)' + G T.covariance G'
/// ```
/// The new mean and covariance are the exact ones of the posterior; the Gaussian shape is the assumption. With a value it is
/// the Kalman filter, with a sign bit the vector filter of Dymbo, with silence that of CFwMD.
///
/// # Errors
/// [`fewbits_core::Error::Impossible`] if the observation has probability zero under the belief.
pub fn update<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    matrix: &SMatrix<f64, M, D>,
    factor: &impl Factor<M>,
) -> Result<(Gaussian<D>, UpdateInfo<D, M>), Error> {
    let cross = belief.covariance() * matrix.transpose();
    let prior = Gaussian::from_trusted_parts(matrix * belief.mean(), matrix * cross);
    let tilted = factor.tilted(&prior)?;
    let correction = tilted.mean - prior.mean();
    let gain = match Cholesky::new(*prior.covariance()) {
        Some(factor) => factor.solve(&cross.transpose()).transpose(),
        // A measurement that is known beforehand teaches nothing.
        None => SMatrix::zeros(),
    };
    let keep = SMatrix::<f64, D, D>::identity() - gain * matrix;
    let covariance = keep * belief.covariance() * keep.transpose() + gain * tilted.covariance * gain.transpose();
    let info = UpdateInfo {
        log_likelihood: tilted.log_evidence,
        correction,
        gain,
    };
    Ok((Gaussian::from_trusted_parts(belief.mean() + gain * correction, covariance), info))
}
