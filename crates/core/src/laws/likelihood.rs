//! The laws of [`Likelihood`].

use super::Violation;
use crate::likelihood::Likelihood;
use crate::points;
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

/// Points that a likelihood of a linear sensor moves have the moments of its update of a Gaussian, and the same evidence.
///
/// `columns` are points of equal weight.
///
/// # Errors
/// If a moment disagrees by more than `1e-9` of the standard deviations, or a function fails; the violation names it.
pub fn points_have_the_moments<const D: usize>(
    likelihood: &impl Likelihood<D>,
    columns: &[Vec<f64>; D],
) -> Result<(), Violation> {
    const LAW: &str = "moved points have the moments of the posterior";
    let count = columns.iter().map(Vec::len).min().unwrap_or(0);
    let weights = vec![1.0 / count as f64; count];
    let before = points::moments(&columns.each_ref().map(Vec::as_slice), &weights);
    let (mut expected, mut moved) = (before, columns.clone());
    let evidence = super::failed(LAW, likelihood.condition(&mut expected))?;
    let found = super::failed(LAW, likelihood.move_points(moved.each_mut().map(Vec::as_mut_slice), &weights))?;
    super::agree(LAW, "the evidence", found.log_likelihood, evidence.log_likelihood, 1e-9, 1.0)?;
    let after = points::moments(&moved.each_ref().map(Vec::as_slice), &weights);
    let deviations = before.standard_deviations();
    for i in 0..D {
        super::agree(LAW, "a mean", after.mean()[i], expected.mean()[i], 1e-9, deviations[i])?;
        for j in 0..D {
            let (found, expected) = (after.covariance()[(i, j)], expected.covariance()[(i, j)]);
            super::agree(LAW, "a covariance", found, expected, 1e-9, deviations[i] * deviations[j])?;
        }
    }
    Ok(())
}
