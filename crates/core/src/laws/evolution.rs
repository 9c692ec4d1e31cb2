//! The laws of [`Evolution`].

use super::{Violation, agree, failed};
use crate::evolution::Evolution;
use nalgebra::SVector;

/// For linear evolutions: mean and covariance after `a + b` seconds equal those after `a` and then `b` seconds, and 0 seconds change
/// nothing. Compared to `tolerance`, relative to the standard deviations.
///
/// # Errors
/// If a step is refused, or the entry that disagrees.
pub fn stretches_compose<const D: usize>(
    evolution: &dyn Evolution<D>,
    [a, b]: [f64; 2],
    states: &[SVector<f64, D>],
    tolerance: f64,
) -> Result<(), Violation> {
    const COMPOSE: &str = "over(a + b) is over(a), then over(b)";
    const IDENTITY: &str = "over(0) changes nothing";
    let [first, second, both, none] = [a, b, a + b, 0.0].map(|seconds| failed(COMPOSE, evolution.over(seconds)));
    let (first, second, both, none) = (first?, second?, both?, none?);
    for state in states {
        let middle = first.mean(state);
        let (mean, expected) = (both.mean(state), second.mean(&middle));
        let jacobian = second.jacobian(&middle);
        // Noise of the first stretch is carried through the second by the Jacobian at its start.
        let composed =
            jacobian * first.noise_covariance_at(state) * jacobian.transpose() + second.noise_covariance_at(&middle);
        let covariance = both.noise_covariance_at(state);
        for i in 0..D {
            let scale = state.amax() + composed[(i, i)].sqrt();
            agree(COMPOSE, format!("coordinate {i} of the mean"), mean[i], expected[i], tolerance, scale)?;
            agree(IDENTITY, format!("coordinate {i}"), none.mean(state)[i], state[i], 0.0, 0.0)?;
            for j in 0..D {
                let scale = (composed[(i, i)] * composed[(j, j)]).sqrt();
                let at = format!("entry ({i}, {j}) of the covariance");
                agree(COMPOSE, at, covariance[(i, j)], composed[(i, j)], tolerance, scale)?;
                agree(IDENTITY, format!("entry ({i}, {j})"), none.noise_covariance_at(state)[(i, j)], 0.0, 0.0, 0.0)?;
            }
        }
    }
    Ok(())
}
