//! The predictive law of reports: from the moments of the belief, or from its points or Gaussians if the filter has any.

use super::health::Residual;
use super::one_wrong::log_sum;
use super::reading::{Content, Reading, Tested, WORD_BITS, conditioned, words};
use super::{FusionCentre, Member};
use crate::Error;
use crate::contract::{Points, StateFilter};
use fewbits_core::{BitString, Evidence, Gaussian, Observation};
use nalgebra::SVector;

/// What is known before the reports of an instant.
pub(super) enum Law<const D: usize> {
    /// Sensing is linearised at the mean.
    Moments(Gaussian<D>),
    /// Weighted points: exact for every sensor.
    Points(Points<D>),
    /// Gaussians and the logarithms of their weights. Sensing is linearised at the mean of each.
    Mixture(Vec<(f64, Gaussian<D>)>),
}

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
            Law::Mixture(modes) => {
                let mut found = Vec::with_capacity(reports.len());
                self.test_apart_by_mixture(modes, reports, &mut found);
                found
            }
        }
    }

    /// As [`test_apart`](Self::test_apart), by a mixture.
    fn test_apart_by_mixture(
        &self,
        modes: &[(f64, Gaussian<D>)],
        reports: &[&Reading<'_, D>],
        found: &mut Vec<Tested>,
    ) {
        match reports {
            [] => {}
            [one] => found.push(self.members[one.seat].test_by_mixture(one, modes)),
            _ => {
                let (left, right) = reports.split_at(reports.len() / 2);
                self.test_apart_by_mixture(&mixture_given(modes, right), left, found);
                self.test_apart_by_mixture(&mixture_given(modes, left), right, found);
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
            Law::Mixture(modes) => member.test_by_mixture(one, &mixture_given(modes, others)),
        }
    }
}

/// A mixture conditioned on reports. Those that no Gaussian explains are left out.
fn mixture_given<const D: usize>(modes: &[(f64, Gaussian<D>)], reports: &[&Reading<'_, D>]) -> Vec<(f64, Gaussian<D>)> {
    let mut modes = modes.to_vec();
    for known in reports.iter().filter_map(|report| report.known()) {
        let next = modes.iter().map(|(log, mode)| {
            let mut next = *mode;
            match known.condition(&mut next) {
                Ok(found) if next.is_finite() => (log + found.log_likelihood, next),
                _ => (f64::NEG_INFINITY, *mode),
            }
        });
        let next: Vec<_> = next.collect();
        if log_sum(next.iter().map(|(log, _)| *log)).is_finite() {
            modes = next;
        }
    }
    modes
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
            let beliefs: Vec<Gaussian<D>> = (0..weights.len()).map(known).collect::<Option<_>>()?;
            return self.residual_of_report(reading, &beliefs, weights, measured, (logs, measured));
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

    fn test_by_mixture(&self, reading: &Reading<'_, D>, modes: &[(f64, Gaussian<D>)]) -> Tested {
        let untested = |is_possible| Tested {
            is_possible,
            residual: None,
        };
        let Some(known) = reading.known() else {
            return untested(false);
        };
        let found: Option<Vec<(f64, f64)>> = modes.iter().map(|(_, mode)| placed(known.evidence(mode))).collect();
        // An observation that cannot update a belief may still have a probability.
        let Some(found) = found else { return untested(true) };
        let total = log_sum(modes.iter().map(|(log, _)| *log));
        let joint = modes.iter().zip(&found).map(|((weight, _), (log, _))| weight + log);
        if !(log_sum(joint) - total).is_finite() {
            return untested(false);
        }
        let weights: Vec<f64> = modes.iter().map(|(log, _)| (log - total).exp()).collect();
        let residual = match &reading.slot.observation {
            Observation::Received(bits) if reading.content == Content::Report => {
                self.residual_by_mixture(reading, bits, modes, &weights, &found)
            }
            _ => None,
        };
        Tested {
            is_possible: true,
            residual,
        }
    }

    fn residual_by_mixture(
        &self,
        reading: &Reading<'_, D>,
        received: &BitString,
        modes: &[(f64, Gaussian<D>)],
        weights: &[f64],
        found: &[(f64, f64)],
    ) -> Option<Residual> {
        let measured = modes.iter().map(|(_, mode)| self.sensor.measured(mode.mean()));
        let measured: Vec<f64> = measured.collect::<Option<_>>()?;
        // `p` of an observation and the correction of the measurement by it.
        let place = |found: &[(f64, f64)]| {
            let all = weights.iter().zip(found).zip(&measured);
            let sums = all.fold((0.0, 0.0, 0.0), |(p, with, mean), ((w, (log, correction)), h)| {
                let joint = w * log.exp();
                (p + joint, with + joint * (h + correction), mean + w * h)
            });
            (sums.0.ln(), sums.1 / sums.0 - sums.2)
        };
        if received.bits() == 1 && self.always_speaks {
            let (log, correction) = place(found);
            return Residual::of_bit((log.exp() / self.arrival).min(1.0), correction);
        }
        if modes.iter().all(|(_, mode)| self.sensor.value_variance(mode).is_some()) {
            let logs: Vec<f64> = found.iter().map(|(log, _)| *log).collect();
            let after: Vec<f64> = measured
                .iter()
                .zip(found)
                .map(|(h, (_, correction))| h + correction)
                .collect();
            let beliefs: Vec<Gaussian<D>> = modes.iter().map(|(_, mode)| *mode).collect();
            return self.residual_of_report(reading, &beliefs, weights, &measured, (&logs, &after));
        }
        if received.bits() == 0 || received.bits() > WORD_BITS {
            return None;
        }
        let (mut all, mut at, mut alternative) = (Vec::new(), 0, reading.slot.clone());
        for word in words(received.bits()) {
            let is_received = word == *received;
            if !self.sensor.decodes(&word) {
                continue;
            }
            alternative.observation = Observation::Received(word);
            let own: Option<Vec<_>> = modes
                .iter()
                .map(|(_, mode)| placed(self.sensor.evidence(&alternative, 1.0, mode)))
                .collect();
            let Some(own) = own else { continue };
            let (log, correction) = place(&own);
            if is_received {
                at = all.len();
            }
            if log.is_finite() {
                all.push((log, correction));
            }
        }
        Residual::of_word(&all, at)
    }

    /// Probability that a working sensor is silent, by points or a mixture.
    pub(super) fn silence_by(&self, reading: &Reading<'_, D>, law: &Law<D>) -> Option<f64> {
        let likelihood = self.sensor.likelihood(reading.slot, 1.0).ok()?;
        let (with, without) = match law {
            Law::Moments(_) => return None,
            Law::Points(points) => {
                let mut logs = points.log_weights.clone();
                likelihood.add_log_likelihoods(points.columns(), &mut logs);
                (log_sum(logs.into_iter()), log_sum(points.log_weights.iter().copied()))
            }
            Law::Mixture(modes) => {
                let found = modes
                    .iter()
                    .map(|(log, mode)| Some(log + placed(likelihood.evidence(mode))?.0));
                let found: Vec<f64> = found.collect::<Option<_>>()?;
                (log_sum(found.into_iter()), log_sum(modes.iter().map(|(log, _)| *log)))
            }
        };
        Some((with - without).exp().min(1.0))
    }
}

/// `ln p` and the correction; `-inf` for an impossible observation, and `None` for one that cannot update the belief.
fn placed(found: Result<Evidence, Error>) -> Option<(f64, f64)> {
    match found {
        Ok(found) => Some((found.log_likelihood, found.correction)),
        Err(Error::Impossible) => Some((f64::NEG_INFINITY, 0.0)),
        Err(_) => None,
    }
}

impl<const D: usize> Points<D> {
    fn point(&self, i: usize) -> SVector<f64, D> {
        SVector::from_fn(|d, _| self.states[d][i])
    }
}
