//! The predictive law of reports: from the moments of the belief, or from its points if the filter has any.

use super::health::Residual;
use super::one_wrong::log_sum;
use super::reading::{Content, Reading, Tested, WORD_BITS, conditioned, words};
use super::{FusionCentre, Member};
use crate::contract::{Points, StateFilter};
use fewbits_core::{Gaussian, Observation};
use fewbits_numerics::normal::{cdf, quantile};
use nalgebra::SVector;

/// What is known before the reports of an instant.
pub(super) enum Law<const D: usize> {
    /// Sensing is linearised at the mean.
    Moments(Gaussian<D>),
    /// Weighted points: exact for every sensor.
    Points(Points<D>),
}

/// Smallest probability of a tail whose residual is still told from others.
const TAIL: f64 = 1e-300;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Each of these reports tested given the others.
    pub(super) fn test_all(&self, law: &Law<D>, reports: &[&Reading<'_, D>]) -> Vec<Tested> {
        match law {
            Law::Moments(given) => {
                let mut found = Vec::with_capacity(reports.len());
                self.test_apart(given, reports, &mut found);
                found
            }
            Law::Points(points) => {
                let others = |own: usize| (0..reports.len()).filter(move |k| *k != own).map(|k| reports[k]);
                let of = |own: usize| {
                    let weights = weighted(points, others(own));
                    self.members[reports[own].seat].test_by_points(reports[own], points, &weights)
                };
                (0..reports.len()).map(of).collect()
            }
        }
    }

    /// One report tested given `others`.
    pub(super) fn test_given(&self, law: &Law<D>, others: &[&Reading<'_, D>], one: &Reading<'_, D>) -> Tested {
        let member = &self.members[one.seat];
        match law {
            Law::Moments(given) => member.test(one, &conditioned(given, others)),
            Law::Points(points) => {
                let weights = weighted(points, others.iter().copied());
                member.test_by_points(one, points, &weights)
            }
        }
    }
}

/// Log weights of the points given reports.
fn weighted<'r, 'a: 'r, const D: usize>(
    points: &Points<D>,
    reports: impl Iterator<Item = &'r Reading<'a, D>>,
) -> Vec<f64> {
    let mut logs = points.log_weights.clone();
    for known in reports.filter_map(Reading::known) {
        let before = logs.clone();
        known.add_log_likelihoods(points.columns(), &mut logs);
        // A report that no point explains is left out.
        if !log_sum(logs.iter().copied()).is_finite() {
            logs = before;
        }
    }
    logs
}

impl<const D: usize> Member<D> {
    fn test_by_points(&self, reading: &Reading<'_, D>, points: &Points<D>, log_weights: &[f64]) -> Tested {
        let impossible = Tested {
            is_possible: false,
            residual: None,
        };
        let Some(known) = reading.known() else {
            return impossible;
        };
        let mut logs = vec![0.0; log_weights.len()];
        known.add_log_likelihoods(points.columns(), &mut logs);
        let total = log_sum(log_weights.iter().copied());
        let joint = log_weights.iter().zip(&logs).map(|(weight, log)| weight + log);
        let evidence = log_sum(joint) - total;
        if !evidence.is_finite() {
            return impossible;
        }
        let weights: Vec<f64> = log_weights.iter().map(|log| (log - total).exp()).collect();
        let measured: Option<Vec<f64>> = (0..weights.len())
            .map(|i| self.sensor.measured(&points.point(i)))
            .collect();
        let residual = match (&reading.slot.observation, measured) {
            (Observation::Received(bits), Some(measured)) if reading.content == Content::Report => {
                self.residual_by_points(reading, bits.bits(), points, &weights, &measured, &logs)
            }
            _ => None,
        };
        Tested {
            is_possible: true,
            residual,
        }
    }

    fn residual_by_points(
        &self,
        reading: &Reading<'_, D>,
        bits: usize,
        points: &Points<D>,
        weights: &[f64],
        measured: &[f64],
        logs: &[f64],
    ) -> Option<Residual> {
        // `p` of an observation and the correction of the measurement by it.
        let place = |logs: &[f64]| {
            let sums =
                weights
                    .iter()
                    .zip(logs)
                    .zip(measured)
                    .fold((0.0, 0.0, 0.0), |(p, with, mean), ((w, log), h)| {
                        let joint = w * log.exp();
                        (p + joint, with + joint * h, mean + w * h)
                    });
            (sums.0.ln(), sums.1 / sums.0 - sums.2)
        };
        if bits == 1 && self.always_speaks {
            let (log, correction) = place(logs);
            return Residual::of_bit((log.exp() / self.arrival).min(1.0), correction);
        }
        let known = |i: usize| Gaussian::known(points.point(i)).ok();
        if self.sensor.value_variance(&known(0)?).is_some() {
            let variances: Option<Vec<f64>> = (0..weights.len())
                .map(|i| self.sensor.value_variance(&known(i)?))
                .collect();
            return self.residual_of_value(&variances?, weights, measured, logs);
        }
        if bits == 0 || bits > WORD_BITS {
            return None;
        }
        let Observation::Received(received) = &reading.slot.observation else {
            return None;
        };
        let (mut found, mut at, mut alternative) = (Vec::new(), 0, reading.slot.clone());
        for word in words(bits) {
            let is_received = word == *received;
            if !self.sensor.decodes(&word) {
                continue;
            }
            alternative.observation = Observation::Received(word);
            let Ok(likelihood) = self.sensor.likelihood(&alternative, 1.0) else {
                continue;
            };
            let mut own = vec![0.0; weights.len()];
            likelihood.add_log_likelihoods(points.columns(), &mut own);
            let (log, correction) = place(&own);
            if is_received {
                at = found.len();
            }
            if log.is_finite() {
                found.push((log, correction));
            }
        }
        Residual::of_word(&found, at)
    }

    /// The residual of a value by its probability integral: `P(value <= received)` is uniform if the law is right.
    fn residual_of_value(
        &self,
        variances: &[f64],
        weights: &[f64],
        measured: &[f64],
        logs: &[f64],
    ) -> Option<Residual> {
        let arrival = self.arrival.ln();
        let distance = |i: usize| {
            let nis = -2.0 * (logs[i] - arrival) - (std::f64::consts::TAU * variances[i]).ln();
            (nis.max(0.0) * variances[i]).sqrt()
        };
        // The value is this far above or below what one point expects; a second point tells which.
        let near = (0..logs.len()).max_by(|i, j| logs[*i].total_cmp(&logs[*j]))?;
        let far = (0..logs.len()).max_by(|i, j| {
            let off = |i: &usize| (measured[*i] - measured[near]).abs() / variances[*i].sqrt();
            off(i).total_cmp(&off(j))
        })?;
        let misfit = |value: f64| ((value - measured[far]).abs() - distance(far)).abs();
        let (above, below) = (measured[near] + distance(near), measured[near] - distance(near));
        let value = if misfit(above) <= misfit(below) { above } else { below };
        let (mut lower, mut upper) = (0.0, 0.0);
        for ((weight, mean), variance) in weights.iter().zip(measured).zip(variances) {
            let standard = (value - mean) / variance.sqrt();
            lower += weight * cdf(standard);
            upper += weight * cdf(-standard);
        }
        Residual::of_normal(if lower < upper {
            quantile(lower.max(TAIL))
        } else {
            -quantile(upper.max(TAIL))
        })
    }

    /// Probability that a working sensor is silent.
    pub(super) fn silence_by_points(&self, reading: &Reading<'_, D>, points: &Points<D>) -> Option<f64> {
        let likelihood = self.sensor.likelihood(reading.slot, 1.0).ok()?;
        let mut logs = points.log_weights.clone();
        likelihood.add_log_likelihoods(points.columns(), &mut logs);
        let found = log_sum(logs.into_iter()) - log_sum(points.log_weights.iter().copied());
        Some(found.exp().min(1.0))
    }
}

impl<const D: usize> Points<D> {
    fn point(&self, i: usize) -> SVector<f64, D> {
        SVector::from_fn(|d, _| self.states[d][i])
    }
}
