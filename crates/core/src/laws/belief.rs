//! The laws of [`Belief`] and [`Density`].

use super::{Violation, agree, average_is, have_moments};
use crate::belief::{Belief, Density};
use crate::columns::state_at;
use crate::gaussian::FactoredGaussian;
use rand::Rng;

/// Draws have the belief's mean and covariance, each entry within four standard errors. Draws into columns of unequal lengths are NaN.
///
/// # Errors
/// If an entry differs by more; the violation names it.
pub fn samples_have_the_moments<const D: usize, R: Rng + ?Sized>(
    belief: &impl Belief<D>,
    rng: &mut R,
    draws: usize,
) -> Result<(), Violation> {
    const LAWS: [&str; 2] = [
        "samples have the mean of their belief",
        "samples have the covariance of their belief",
    ];
    let mut columns: [Vec<f64>; D] = std::array::from_fn(|_| vec![0.0; draws]);
    belief.sample_columns(rng, columns.each_mut().map(Vec::as_mut_slice));
    let columns = columns.each_ref().map(Vec::as_slice);
    let states: Vec<_> = (0..draws).map(|i| state_at(&columns, i)).collect();
    have_moments(LAWS, &states, &belief.mean(), &belief.covariance())?;
    if D > 1 {
        let mut columns: [Vec<f64>; D] = std::array::from_fn(|d| vec![0.25; 3 + d % 2]);
        belief.sample_columns(rng, columns.each_mut().map(Vec::as_mut_slice));
        not_a_number("draws into columns of unequal lengths are NaN", columns.iter().flatten())?;
    }
    Ok(())
}

fn not_a_number<'a>(law: &'static str, mut numbers: impl Iterator<Item = &'a f64>) -> Result<(), Violation> {
    match numbers.find(|x| !x.is_nan()) {
        Some(number) => Err(Violation::new(law, number, "NaN")),
        None => Ok(()),
    }
}

/// The density integrates to one within four standard errors, by importance sampling from `proposal`, which should be wider than the
/// belief. The sweep adds what the scalar function returns, and writes NaN if lengths differ.
///
/// # Errors
/// If the integral is not one, or the sweep disagrees at a state; the violation names either.
pub fn density_integrates_to_one<const D: usize, R: Rng + ?Sized>(
    belief: &impl Density<D>,
    proposal: &FactoredGaussian<D>,
    rng: &mut R,
    draws: usize,
) -> Result<(), Violation> {
    let mut columns: [Vec<f64>; D] = std::array::from_fn(|_| vec![0.0; draws]);
    proposal.sample_columns(rng, columns.each_mut().map(Vec::as_mut_slice));
    // Sweeps add to what is there: a start that is not zero shows one that overwrites.
    let mut logs = vec![0.25; draws];
    belief.add_log_densities(&columns.each_ref().map(Vec::as_slice), &mut logs);
    let mut ratios = Vec::with_capacity(draws);
    for (i, log) in logs.iter().enumerate() {
        let x = state_at(&columns.each_ref().map(Vec::as_slice), i);
        let alone = belief.log_density(&x);
        agree("a sweep is the scalar", format!("{x:?}"), *log, 0.25 + alone, 1e-12, 1.0)?;
        ratios.push((alone - proposal.log_pdf(&x)).exp());
    }
    for length in [draws + 1, draws.saturating_sub(1)] {
        let mut logs = vec![0.25; length];
        belief.add_log_densities(&columns.each_ref().map(Vec::as_slice), &mut logs);
        not_a_number("a sweep over slices of unequal lengths writes NaN", logs.iter())?;
    }
    average_is("a density integrates to one", "the whole space", ratios.into_iter(), 1.0, 1e-12)
}
