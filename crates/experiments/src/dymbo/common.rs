//! What the Dymbo figures share.

use crate::Error;
use fewbits_dymbo::ScalarPlant;
use fewbits_filters::ScalarSteadyState;
use std::f64::consts::FRAC_2_PI;

/// Longest simulated run in steps.
pub(super) const LONGEST_RUN: usize = 10_000;

/// The plant of unit measurement noise, every refusal reported as that of a parameter.
pub(super) fn plant(figure: &'static str, a: f64, gamma: f64) -> Result<ScalarPlant, Error> {
    let refuse = |name: &str, value: f64, expected: &str| Error::BadParameter {
        figure,
        name: name.to_owned(),
        value: value.to_string(),
        expected: expected.to_owned(),
    };
    if !(gamma > 0.0 && gamma.is_finite()) {
        return Err(refuse("gamma", gamma, "a finite number above 0"));
    }
    ScalarPlant::with_noise_ratio(a, gamma)
        .map_err(|_| refuse("a", a, "a number in [-1, 1]: one bit cannot hold an unstable plant"))
}

/// Plants that must also be stationary.
pub(super) fn stationary_plant(figure: &'static str, a: f64, gamma: f64) -> Result<(ScalarPlant, f64), Error> {
    let plant = plant(figure, a, gamma)?;
    let variance = plant
        .dynamics()
        .stationary_variance()
        .map_err(|_| Error::BadParameter {
            figure,
            name: "a".to_owned(),
            value: a.to_string(),
            expected: "a number above -1 and below 1: the figure starts from the stationary state".to_owned(),
        })?;
    Ok((plant, variance))
}

/// Pairs two lists entry by entry; a list of one entry stands for as many as the other has.
pub(super) fn pairs(figure: &'static str, a: &[f64], gamma: &[f64]) -> Result<Vec<(f64, f64)>, Error> {
    let longest = a.len().max(gamma.len());
    if a.is_empty() || gamma.is_empty() || [a.len(), gamma.len()].iter().any(|n| *n != 1 && *n != longest) {
        return Err(Error::BadParameter {
            figure,
            name: "gamma".to_owned(),
            value: format!("{} entries beside {} of `a`", gamma.len(), a.len()),
            expected: "lists of the same length, or one entry that stands for all".to_owned(),
        });
    }
    let at = |list: &[f64], i: usize| list[if list.len() == 1 { 0 } else { i }];
    Ok((0..longest).map(|i| (at(a, i), at(gamma, i))).collect())
}

/// Refuses an empty list.
pub(super) fn not_empty<T>(figure: &'static str, name: &str, list: &[T]) -> Result<(), Error> {
    if list.is_empty() {
        return Err(bad(figure, name, "empty", "a list with at least one entry"));
    }
    Ok(())
}

/// A refused parameter.
pub(super) fn bad(figure: &'static str, name: &str, value: impl ToString, expected: &str) -> Error {
    Error::BadParameter {
        figure,
        name: name.to_owned(),
        value: value.to_string(),
        expected: expected.to_owned(),
    }
}

/// Steady state of the sign-bit filter.
pub(super) fn dymbo_steady(plant: &ScalarPlant) -> Result<ScalarSteadyState, Error> {
    Ok(plant.steady_state(FRAC_2_PI)?)
}

/// Steady filtered variance of the Kalman filter.
pub(super) fn kalman_variance(plant: &ScalarPlant) -> Result<f64, Error> {
    Ok(plant.steady_state(1.0)?.filtered_variance)
}

/// `points` numbers from `low` to `high`, evenly spaced in the logarithm.
pub(super) fn log_spaced(low_exponent: f64, high_exponent: f64, points: usize) -> Vec<f64> {
    let step = (high_exponent - low_exponent) / (points.max(2) - 1) as f64;
    (0..points)
        .map(|i| 10_f64.powf(low_exponent + i as f64 * step))
        .collect()
}

/// The value in `values` whose key is closest to `key`.
pub(super) fn nearest(points: &[(f64, f64)], key: f64) -> f64 {
    let distance = |p: &&(f64, f64)| (p.0 - key).abs();
    points
        .iter()
        .min_by(|p, q| distance(p).total_cmp(&distance(q)))
        .map_or(f64::NAN, |p| p.1)
}
