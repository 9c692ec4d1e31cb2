//! The laws of [`Likelihood`].

use super::Violation;
use crate::likelihood::Likelihood;
use nalgebra::SVector;

/// The log likelihood is finite or `-inf` at every state; at a state with a NaN it is NaN or at most the smallest value at the others. The
/// sweep adds what the scalar function returns, and writes NaN everywhere if lengths differ.
///
/// # Errors
/// If a law fails at a state; the violation names the first one.
pub fn sweep_is_scalar<const D: usize>(
    likelihood: &impl Likelihood<D>,
    states: &[SVector<f64, D>],
) -> Result<(), Violation> {
    let least = super::least_of_numbers(states, |x| likelihood.log_likelihood(x))?;
    let broken = SVector::<f64, D>::repeat(f64::NAN);
    super::never_raises(likelihood.log_likelihood(&broken), least, "NaN")?;
    let all: Vec<SVector<f64, D>> = states.iter().copied().chain([broken]).collect();
    super::sweep(
        &all,
        |columns, sums| likelihood.add_log_likelihoods(columns, sums),
        |x| likelihood.log_likelihood(x),
    )
}
