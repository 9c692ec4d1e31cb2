//! The cross-covariance of two sensors' own filters, as the publication needs it without feedback.

use fewbits_cfwmd::rule::OwnStep;
use fewbits_core::LinearDynamics;
use nalgebra::SMatrix;

/// One step of the cross-covariance of the prediction errors of two sensors' own filters:
/// `C <- (1 - W_i H_i) C (1 - W_j H_j)'`, then `F C F' + Q`.
///
/// All sensors share the start, so the recursion begins with `F P0 F' + Q`. It begins with `Q` alone only if the start is known exactly
/// (erratum `cfwmd-5`).
pub fn cross_covariance_step<const D: usize, const M: usize>(
    dynamics: &impl LinearDynamics<D>,
    cross: &SMatrix<f64, D, D>,
    first: (&OwnStep<D, M>, &SMatrix<f64, M, D>),
    second: (&OwnStep<D, M>, &SMatrix<f64, M, D>),
) -> SMatrix<f64, D, D> {
    let keep =
        |(step, matrix): (&OwnStep<D, M>, &SMatrix<f64, M, D>)| SMatrix::<f64, D, D>::identity() - step.gain * matrix;
    let transition = dynamics.transition();
    let after = keep(first) * cross * keep(second).transpose();
    transition * after * transition.transpose() + dynamics.noise_covariance()
}
