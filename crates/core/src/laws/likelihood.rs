//! The laws of [`Likelihood`].

use super::{Violation, agree};
use crate::likelihood::Likelihood;
use nalgebra::SVector;

/// Finite or `-inf` at every state, and the sweep adds what the scalar function returns.
///
/// # Errors
/// The first state at which a law fails.
pub fn sweep_is_scalar<const D: usize>(
    likelihood: &impl Likelihood<D>,
    states: &[SVector<f64, D>],
) -> Result<(), Violation> {
    let columns: [Vec<f64>; D] = std::array::from_fn(|k| states.iter().map(|x| x[k]).collect());
    let mut sums = vec![0.25; states.len()];
    likelihood.add_log_likelihoods(columns.each_ref().map(Vec::as_slice), &mut sums);
    for (x, sum) in states.iter().zip(&sums) {
        let alone = likelihood.log_likelihood(x);
        if alone.is_nan() || alone == f64::INFINITY {
            return Err(Violation::new("a log likelihood is a number", format!("{alone} at {x:?}"), "finite or -inf"));
        }
        agree("a sweep is the scalar", format!("{x:?}"), *sum, 0.25 + alone, 1e-12, 1.0)?;
    }
    Ok(())
}
