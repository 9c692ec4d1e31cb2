//! The laws of [`Factor`].

use super::{Violation, agree, failed};
use crate::factor::{Factor, Tilted};
use crate::gaussian::Gaussian;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::SVector;

/// Law 1: the log likelihood is finite or `-inf` at every finite measurement. At a measurement with a NaN it is NaN or at most
/// the smallest value at the others.
///
/// # Errors
/// If the law fails at a measurement; the violation names the first one.
pub fn is_a_number<const M: usize>(factor: &impl Factor<M>, measurements: &[SVector<f64, M>]) -> Result<(), Violation> {
    let least = super::least_of_numbers(measurements, |m| factor.log_likelihood(m))?;
    for (m, k) in measurements.iter().flat_map(|m| (0..M).map(move |k| (m, k))) {
        let mut broken = *m;
        broken[k] = f64::NAN;
        super::never_raises(factor.log_likelihood(&broken), least, format!("{broken:?}"))?;
    }
    Ok(())
}

/// Law 2: the sweep adds what the scalar function returns, also at measurements with a NaN. If lengths differ it writes NaN everywhere.
///
/// # Errors
/// If the law fails at a measurement; the violation names the first one.
pub fn sweep_is_scalar<const M: usize>(
    factor: &impl Factor<M>,
    measurements: &[SVector<f64, M>],
) -> Result<(), Violation> {
    let broken = measurements.iter().take(1).map(|m| m.map(|_| f64::NAN));
    let all: Vec<SVector<f64, M>> = measurements.iter().copied().chain(broken).collect();
    super::sweep(&all, |columns, sums| factor.add_log_likelihoods(&columns, sums), |m| factor.log_likelihood(m))
}

/// Law 3: `tilted` agrees with the trapezoid rule of `points` nodes over the prior's mean `+- reach`. The caller chooses both so
/// that the rule resolves the posterior. Evidence, mean and variance are compared to `tolerance`, relative to the posterior's deviation.
///
/// # Errors
/// If `tilted` fails, or the moment that disagrees.
pub fn tilted_is_quadrature(
    factor: &impl Factor<1>,
    prior: &Gaussian<1>,
    reach: f64,
    points: usize,
    tolerance: f64,
) -> Result<(), Violation> {
    const LAW: &str = "tilted moments are those of the likelihood";
    let Tilted {
        log_evidence,
        mean,
        covariance,
    } = failed(LAW, factor.tilted(prior))?;
    let (centre, variance) = (prior.mean()[0], prior.covariance()[0]);
    let step = 2.0 * reach / (points - 1) as f64;
    let nodes = || (0..points).map(|i| -reach + step * i as f64);
    // The trapezoidal rule over the likelihood times the prior, relative to the peak.
    let log = |t: f64| factor.log_likelihood(&[centre + t].into()) - 0.5 * t * t / variance;
    let logs: Vec<f64> = nodes().map(log).collect();
    let peak = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = logs.iter().map(|l| (l - peak).exp()).collect();
    // Moments about the prior's mean, so that they keep their digits if it is far from zero.
    let total: f64 = weights.iter().sum();
    let first = nodes().zip(&weights).map(|(t, w)| t * w).sum::<f64>() / total;
    let second = nodes()
        .zip(&weights)
        .map(|(t, w)| w * (t - first) * (t - first))
        .sum::<f64>()
        / total;
    let evidence = peak + (total * step).ln() - LN_SQRT_2PI - 0.5 * variance.ln();
    agree(LAW, "the evidence", log_evidence, evidence, tolerance, 1.0)?;
    agree(LAW, "the mean", (mean[0] - centre) / second.sqrt(), first / second.sqrt(), tolerance, 1.0)?;
    agree(LAW, "the variance", covariance[0], second, tolerance, 0.0)
}
