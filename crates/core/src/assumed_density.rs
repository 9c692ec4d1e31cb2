//! The assumed-density filter: a Gaussian belief, updated by any factor.

use crate::dynamics::GaussianDynamics;
use crate::error::Error;
use crate::factor::{Factor, Tilted};
use crate::gaussian::Gaussian;
use crate::observed::Observed;
use crate::sensing::Sensing;
use fewbits_numerics::linalg::{congruence, congruence_of, semidefinite_factor, solve_semidefinite, times_transposed};
use nalgebra::{SMatrix, SVector};

/// Results of an update other than the new belief.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct UpdateInfo<const D: usize, const M: usize> {
    /// `ln p(observation | past)`, the increment of the log-likelihood of the data.
    pub log_likelihood: f64,
    /// Posterior mean minus prior mean of the noise-free measurement.
    pub correction: SVector<f64, M>,
    /// Regression of the state on the noise-free measurement, `G = P H' (H P H')^-1`.
    pub gain: SMatrix<f64, D, M>,
}

/// Time update, linearised at the mean `m`: mean `f(m)`, covariance `F P F' + Q` with `F` the Jacobian at `m`.
pub fn predict<const D: usize>(dynamics: &(impl GaussianDynamics<D> + ?Sized), belief: &Gaussian<D>) -> Gaussian<D> {
    dynamics.predict(belief, 1.0)
}

/// Measurement update for a linear sensor. The factor gives the posterior of `m = H x`; the posterior of `x` follows by linear regression
/// on `m`.
///
/// ```text
/// m ~ N(H mean, V),  V = H P H'
/// T = tilted moments of m given the observation
/// G = P H' V^-1                                      (pseudo-inverse where V is singular)
/// mean = mean + G (T.mean - H mean)
/// P = (I - G H) P (I - G H)' + G T.covariance G'
/// ```
/// Mean and covariance of the new belief are those of the exact posterior; only its shape is assumed to be Gaussian. With a value it is
/// the Kalman filter, with a sign bit the vector Dymbo filter, with silence the CFwMD filter.
///
/// # Errors
/// [`Error::Impossible`] if the observation has probability zero under the belief;
/// [`Error::NotANumber`] if a number of the belief, the model or the factor overflows or is NaN.
pub fn update<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    matrix: &SMatrix<f64, M, D>,
    factor: &impl Factor<M>,
) -> Result<(Gaussian<D>, UpdateInfo<D, M>), Error> {
    update_at(belief, matrix * belief.mean(), matrix, factor)
}

/// As [`update`] for any sensor, linearised at the belief's mean: `m = h(mean) + H (x - mean)`. With a value it is the extended
/// Kalman filter.
///
/// # Errors
/// As [`update`].
#[inline(always)]
pub fn update_through<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    observed: &Observed<impl Sensing<D, M>, impl Factor<M>, M>,
) -> Result<(Gaussian<D>, UpdateInfo<D, M>), Error> {
    let (predicted, jacobian) = (observed.measured(belief.mean()), observed.sensing.jacobian(belief.mean()));
    update_at(belief, predicted, &jacobian, &observed.factor)
}

/// `ln p(observation | past)`, and the posterior minus the prior mean of the noise-free measurement: [`update_through`] without
/// the posterior of the state.
///
/// # Errors
/// As [`update`].
pub(crate) fn evidence_through<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    observed: &Observed<impl Sensing<D, M>, impl Factor<M>, M>,
) -> Result<(f64, SVector<f64, M>), Error> {
    let (predicted, jacobian) = (observed.measured(belief.mean()), observed.sensing.jacobian(belief.mean()));
    let Tilt { correction, tilted, .. } = tilt(belief, predicted, &jacobian, &observed.factor)?;
    if !(tilted.log_evidence.is_finite() && correction.iter().all(|x| x.is_finite())) {
        let what = "the evidence (from the belief, the sensing model or the factor)";
        return Err(Error::unlikely_or_no_number(tilted.log_evidence, what));
    }
    Ok((tilted.log_evidence, correction))
}

/// The posterior of the noise-free measurement `y`, and what leads from it to that of the state.
struct Tilt<const D: usize, const M: usize> {
    /// `P H'`.
    cross: SMatrix<f64, D, M>,
    prior: Gaussian<M>,
    tilted: Tilted<M>,
    /// Posterior minus prior mean.
    correction: SVector<f64, M>,
}

/// The factor depends only on `y = H x`, so its posterior moments are computed for `y`.
#[inline(always)]
fn tilt<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    predicted: SVector<f64, M>,
    matrix: &SMatrix<f64, M, D>,
    factor: &impl Factor<M>,
) -> Result<Tilt<D, M>, Error> {
    let cross = times_transposed(belief.covariance(), matrix);
    let prior = Gaussian::from_symmetric_parts(predicted, congruence_of(matrix, &cross));
    if !prior.is_finite() {
        let what = "the predicted measurement (from the belief or the sensing model)";
        return Err(Error::NotANumber { what });
    }
    let tilted = factor.tilted(&prior)?;
    Ok(Tilt {
        cross,
        prior,
        correction: tilted.mean - prior.mean(),
        tilted,
    })
}

#[inline(always)]
fn update_at<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    predicted: SVector<f64, M>,
    matrix: &SMatrix<f64, M, D>,
    factor: &impl Factor<M>,
) -> Result<(Gaussian<D>, UpdateInfo<D, M>), Error> {
    let Tilt {
        cross,
        prior,
        tilted,
        correction,
    } = tilt(belief, predicted, matrix, factor)?;
    // Given `y`, the state is `x = mean + gain (y - predicted)` plus a residual that is independent of `y`. The observation leaves the
    // residual's covariance as it is. Both terms are positive semidefinite, so their sum is so under rounding too.
    let gain = solve_semidefinite(prior.covariance(), &cross.transpose())?.transpose();
    let keep = SMatrix::<f64, D, D>::identity() - times_transposed(&gain, &matrix.transpose());
    let covariance = congruence(&keep, belief.covariance()) + congruence(&gain, &tilted.covariance);
    let covariance = with_rounding(covariance, &keep, belief);
    let info = UpdateInfo {
        log_likelihood: tilted.log_evidence,
        correction,
        gain,
    };
    let mean = belief.mean() + gain * correction;
    let posterior = Gaussian::from_symmetric_parts(mean, covariance);
    if !(posterior.is_finite() && info.log_likelihood.is_finite()) {
        let what = "the posterior (from the belief, the sensing model or the factor)";
        return Err(Error::unlikely_or_no_number(info.log_likelihood, what));
    }
    Ok((posterior, info))
}

/// A variance that falls below this share of itself in one update is compared with its rounding.
const STEEP: f64 = 1e-12;
/// Rounding of a sum of a few products, relative to the largest.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The covariance after an update that keeps the part `keep` of `prior`, with the update's rounding added where a variance fell so far that
/// rounding may exceed the rest.
///
/// After a very long time without observation, the variances of position and velocity are so large, and the two so alike, that a double does
/// not hold what the next reports leave of them. Without this the covariance would become indefinite, and the mean would be trusted beyond
/// its own digits.
#[inline]
pub(crate) fn with_rounding<const D: usize>(
    covariance: SMatrix<f64, D, D>,
    keep: &SMatrix<f64, D, D>,
    prior: &Gaussian<D>,
) -> SMatrix<f64, D, D> {
    let is_steep = |i: usize| covariance[(i, i)] < STEEP * prior.covariance()[(i, i)];
    // A single coordinate has nothing to cancel with.
    if D == 1 || !(0..D).any(is_steep) {
        return covariance;
    }
    rounded(covariance, keep, prior)
}

#[cold]
fn rounded<const D: usize>(
    covariance: SMatrix<f64, D, D>,
    keep: &SMatrix<f64, D, D>,
    prior: &Gaussian<D>,
) -> SMatrix<f64, D, D> {
    // Of `keep P keep'`, term by term, and of the mean.
    let products = congruence(&keep.abs(), &prior.covariance().abs()).diagonal() * ROUNDING;
    let mean = prior.mean() * ROUNDING;
    let mut rounding: SVector<f64, D> = products + mean.component_mul(&mean);
    // The square of a mean may overflow; the largest number says as much.
    let widened = |rounding: &SVector<f64, D>| {
        let mut wider = covariance;
        (0..D).for_each(|i| wider[(i, i)] = (covariance[(i, i)] + rounding[i]).min(f64::MAX));
        wider
    };
    let mut wider = widened(&rounding);
    // A few times the rounding at most; twenty doublings are for what is no covariance already.
    for _ in 0..20 {
        if semidefinite_factor("covariance", &wider).is_ok() {
            break;
        }
        rounding *= 2.0;
        wider = widened(&rounding);
    }
    wider
}
