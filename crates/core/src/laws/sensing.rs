//! The laws of [`Sensing`].

use super::{Violation, agree, have_moments};
use crate::sensing::Sensing;
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// The Jacobian is the derivative of the mean, and the sweep writes what the scalar function returns.
///
/// # Errors
/// If Jacobian or sweep disagree; the violation names state and entry.
pub fn is_consistent<const D: usize, const M: usize>(
    sensing: &impl Sensing<D, M>,
    states: &[SVector<f64, D>],
) -> Result<(), Violation> {
    let columns: [Vec<f64>; D] = std::array::from_fn(|k| states.iter().map(|x| x[k]).collect());
    let mut means: [Vec<f64>; M] = std::array::from_fn(|_| vec![0.0; states.len()]);
    let out = means.each_mut().map(Vec::as_mut_slice);
    sensing.mean_columns(&columns.each_ref().map(Vec::as_slice), out);
    for (i, state) in states.iter().enumerate() {
        let mean = sensing.mean(state);
        for k in 0..M {
            agree("a sweep is the scalar", format!("{state:?}"), means[k][i], mean[k], 1e-12, mean.amax())?;
        }
        derivative(state, |x| sensing.mean(x), &sensing.jacobian(state))?;
    }
    Ok(())
}

/// Measurements have the mean `h(x)` and the covariance `R(x)`, within four standard errors of `draws` draws.
///
/// # Errors
/// If an entry disagrees; the violation names it.
pub fn draws_have_the_law<const D: usize, const M: usize, R: Rng>(
    sensing: &impl Sensing<D, M>,
    rng: &mut R,
    state: &SVector<f64, D>,
    draws: usize,
) -> Result<(), Violation> {
    const LAWS: [&str; 2] = ["measurements have their mean", "measurements have their noise"];
    let points: Vec<SVector<f64, M>> = (0..draws).map(|_| sensing.sample(rng, state)).collect();
    have_moments(LAWS, &points, &sensing.mean(state), &sensing.noise_covariance_at(state))
}

/// Compares a Jacobian with central differences; steps are `1e-5` of the state's largest coordinate.
pub(super) fn derivative<const D: usize, const M: usize>(
    state: &SVector<f64, D>,
    mean: impl Fn(&SVector<f64, D>) -> SVector<f64, M>,
    jacobian: &SMatrix<f64, M, D>,
) -> Result<(), Violation> {
    let scale = if state.amax() > 0.0 { state.amax() } else { 1.0 };
    let step = 1e-5 * scale;
    for d in 0..D {
        let (mut ahead, mut behind) = (*state, *state);
        ahead[d] += step;
        behind[d] -= step;
        let slope = (mean(&ahead) - mean(&behind)) / (ahead[d] - behind[d]);
        for k in 0..M {
            let at = format!("entry ({k}, {d}) at {state:?}");
            agree("a Jacobian is the derivative", at, jacobian[(k, d)], slope[k], 1e-6, jacobian.amax())?;
        }
    }
    Ok(())
}
