//! Checks of the laws that this crate's traits state, to be called from a test of every implementation.
//!
//! Each function checks one law and returns a [`Violation`] that says what was expected and what was found. Laws about
//! frequencies draw from a random source and accept deviations up to four standard errors. With a fixed seed the result is reproducible.

pub mod belief;
pub mod dynamics;
pub mod evolution;
pub mod factor;
pub mod likelihood;
pub mod message;
pub mod scheme;
pub mod sensing;

pub use fewbits_numerics::wild;

use crate::columns::Columns;
use nalgebra::{SMatrix, SVector};

/// A law that an implementation does not obey.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{law}: {found}, expected {expected}")]
pub struct Violation {
    /// Statement of the law.
    pub law: &'static str,
    /// What was found, and for which input.
    pub found: String,
    /// What was expected.
    pub expected: String,
}

impl Violation {
    fn new(law: &'static str, found: impl std::fmt::Display, expected: impl std::fmt::Display) -> Self {
        Self {
            law,
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }
}

/// Number of standard errors by which a frequency or an average may deviate.
const STANDARD_ERRORS: f64 = 4.0;

/// Turns an error of the implementation under test into a violation.
fn failed<T>(law: &'static str, result: Result<T, impl std::fmt::Display>) -> Result<T, Violation> {
    result.map_err(|error| Violation::new(law, error, "no error"))
}

/// Compares two numbers that must agree to `tolerance`, relative to the larger of `scale` and the expected.
fn agree(
    law: &'static str,
    at: impl std::fmt::Display,
    found: f64,
    expected: f64,
    tolerance: f64,
    scale: f64,
) -> Result<(), Violation> {
    let same = found == expected || (found - expected).abs() <= tolerance * expected.abs().max(scale);
    if same {
        Ok(())
    } else {
        Err(Violation::new(law, format!("{found} at {at}"), expected))
    }
}

/// A log likelihood is finite or `-inf` at every point. Returns the smallest.
fn least_of_numbers<const D: usize>(
    points: &[SVector<f64, D>],
    log_likelihood: impl Fn(&SVector<f64, D>) -> f64,
) -> Result<f64, Violation> {
    let mut least = f64::INFINITY;
    for x in points {
        let value = log_likelihood(x);
        if value.is_nan() || value == f64::INFINITY {
            return Err(Violation::new("a log likelihood is a number", format!("{value} at {x:?}"), "finite or -inf"));
        }
        least = least.min(value);
    }
    Ok(least)
}

/// A likelihood at an input of NaN must not exceed the smallest one at numbers.
fn never_raises(value: f64, least: f64, at: impl std::fmt::Display) -> Result<(), Violation> {
    if value.is_nan() || value <= least {
        Ok(())
    } else {
        let expected = format!("NaN, or at most {least}");
        Err(Violation::new("a NaN never raises a weight", format!("{value} at {at}"), expected))
    }
}

/// Compares a sweep with the scalar function at the same points, and lets it run over slices of unequal lengths.
fn sweep<const D: usize>(
    points: &[SVector<f64, D>],
    add: impl Fn(Columns<'_, D>, &mut [f64]),
    alone: impl Fn(&SVector<f64, D>) -> f64,
) -> Result<(), Violation> {
    const LENGTHS: &str = "a sweep over slices of unequal lengths writes NaN";
    let columns: [Vec<f64>; D] = std::array::from_fn(|k| points.iter().map(|x| x[k]).collect());
    let mut sums = vec![0.25; points.len()];
    add(columns.each_ref().map(Vec::as_slice), &mut sums);
    for (x, sum) in points.iter().zip(&sums) {
        // A sweep may give a state with a NaN either a NaN or no weight.
        let no_number = x.iter().any(|x| x.is_nan()) && (sum.is_nan() || *sum == f64::NEG_INFINITY);
        if !no_number {
            agree("a sweep is the scalar", format!("{x:?}"), *sum, 0.25 + alone(x), 1e-12, 1.0)?;
        }
    }
    if D > 0 {
        for length in [points.len() + 1, points.len().saturating_sub(1)] {
            let mut sums = vec![0.25; length];
            add(columns.each_ref().map(Vec::as_slice), &mut sums);
            if let Some(sum) = sums.iter().find(|sum| !sum.is_nan()) {
                return Err(Violation::new(LENGTHS, format!("{sum} of {length} for {} points", points.len()), "NaN"));
            }
        }
    }
    Ok(())
}

/// The average of the draws is within [`STANDARD_ERRORS`] of `expected`; `slack` forgives rounding.
fn average_is(
    law: &'static str,
    at: impl std::fmt::Display,
    draws: impl Iterator<Item = f64>,
    expected: f64,
    slack: f64,
) -> Result<(), Violation> {
    let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
    for x in draws {
        count += 1.0;
        // Welford's recursion of mean and sum of squares.
        let delta = x - mean;
        mean += delta / count;
        squares += delta * (x - mean);
    }
    let error = (squares / f64::max(count - 1.0, 1.0) / count).sqrt();
    if (mean - expected).abs() <= STANDARD_ERRORS * error + slack {
        Ok(())
    } else {
        Err(Violation::new(law, format!("{mean} +- {error} at {at}"), expected))
    }
}

/// Draws have the mean and the covariance, entry by entry.
fn have_moments<const D: usize>(
    [mean_law, covariance_law]: [&'static str; 2],
    draws: &[SVector<f64, D>],
    mean: &SVector<f64, D>,
    covariance: &SMatrix<f64, D, D>,
) -> Result<(), Violation> {
    for i in 0..D {
        let slack = 1e-12 * (mean[i].abs() + covariance[(i, i)].sqrt());
        average_is(mean_law, format!("coordinate {i}"), draws.iter().map(|x| x[i]), mean[i], slack)?;
        for j in 0..=i {
            let products = draws.iter().map(|x| (x[i] - mean[i]) * (x[j] - mean[j]));
            let slack = 1e-12 * (covariance[(i, i)] * covariance[(j, j)]).sqrt() + f64::MIN_POSITIVE;
            average_is(covariance_law, format!("entry ({i}, {j})"), products, covariance[(i, j)], slack)?;
        }
    }
    Ok(())
}
