//! The laws of [`Dynamics`] and its refinements.

use super::{Violation, agree, have_moments};
use crate::columns::state_at;
use crate::dynamics::{Dynamics, GaussianDynamics, LinearDynamics};
use nalgebra::SVector;
use rand::Rng;

/// `propagate` and `propagate_columns` have the conditional mean [`Dynamics::mean`] and, for Gaussian dynamics, the covariance
/// `noise_covariance_at`, entry by entry within four standard errors of `draws` draws.
///
/// # Errors
/// If an entry disagrees; the violation names it.
pub fn draws_have_the_law<const D: usize>(
    dynamics: &impl GaussianDynamics<D>,
    rng: &mut dyn Rng,
    state: &SVector<f64, D>,
    draws: usize,
) -> Result<(), Violation> {
    const LAWS: [&str; 2] = [
        "draws have the mean of the dynamics",
        "draws have the noise of the dynamics",
    ];
    let mut columns: [Vec<f64>; D] = std::array::from_fn(|d| vec![state[d]; draws]);
    dynamics.propagate_columns(rng, columns.each_mut().map(Vec::as_mut_slice));
    let columns = columns.each_ref().map(Vec::as_slice);
    let swept: Vec<_> = (0..draws).map(|i| state_at(&columns, i)).collect();
    let single: Vec<_> = (0..draws).map(|_| dynamics.propagate(rng, state)).collect();
    for points in [single, swept] {
        have_moments(LAWS, &points, &dynamics.mean(state), &dynamics.noise_covariance_at(state))?;
    }
    Ok(())
}

/// The Jacobian is the derivative of the mean, by central differences of relative step `1e-5`.
///
/// # Errors
/// If an entry disagrees by more than `1e-6` of the largest; the violation names it.
pub fn jacobian_is_the_derivative<const D: usize>(
    dynamics: &impl GaussianDynamics<D>,
    state: &SVector<f64, D>,
) -> Result<(), Violation> {
    super::sensing::derivative(state, |x| dynamics.mean(x), &dynamics.jacobian(state))
}

/// Linear dynamics have the mean `F x`, the Jacobian `F` and the noise `Q` at every state.
///
/// # Errors
/// If an entry disagrees; the violation names it.
pub fn is_linear<const D: usize>(
    dynamics: &impl LinearDynamics<D>,
    states: &[SVector<f64, D>],
) -> Result<(), Violation> {
    const LAW: &str = "linear dynamics are the same at every state";
    for state in states {
        let (mean, linear) = (Dynamics::mean(dynamics, state), dynamics.transition() * state);
        for i in 0..D {
            agree(LAW, format!("the mean of {state:?}"), mean[i], linear[i], 1e-13, linear.amax())?;
            for j in 0..D {
                let (found, expected) = (dynamics.jacobian(state)[(i, j)], dynamics.transition()[(i, j)]);
                agree(LAW, "the Jacobian", found, expected, 0.0, 0.0)?;
                let found = dynamics.noise_covariance_at(state)[(i, j)];
                agree(LAW, "the noise", found, dynamics.noise_covariance()[(i, j)], 0.0, 0.0)?;
            }
        }
    }
    Ok(())
}
