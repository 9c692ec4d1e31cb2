//! The predictive law of reports: from the moments of the belief, or from its points or Gaussians if the filter has any.

use super::health::Residual;
use super::one_wrong::log_sum;
use super::reading::{Content, Reading, Tested, conditioned};
use super::{FusionCentre, Member, RemoteSensor};
use crate::Error;
use crate::contract::{Points, StateFilter};
use fewbits_core::circle::nearest;
use fewbits_core::{BitString, Evidence, Gaussian, Likelihood, Observation};
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
                    self.members[reports[own].seat].test_by_parts(reports[own], Parts::Points(points), &weights)
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
                member.test_by_parts(one, Parts::Points(points), &weights)
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

/// A law in parts.
#[derive(Clone, Copy)]
enum Parts<'a, const D: usize> {
    Points(&'a Points<D>),
    Modes(&'a [(f64, Gaussian<D>)]),
}

impl<const D: usize> Parts<'_, D> {
    fn len(&self) -> usize {
        match self {
            Self::Points(points) => points.log_weights.len(),
            Self::Modes(modes) => modes.len(),
        }
    }

    fn belief(&self, i: usize) -> Option<Gaussian<D>> {
        match self {
            Self::Points(points) => Gaussian::known(points.point(i)).ok(),
            Self::Modes(modes) => Some(modes[i].1),
        }
    }

    /// What a sensor measures at the mean of each part, without noise.
    fn measured(&self, sensor: &dyn RemoteSensor<D>) -> Option<Vec<f64>> {
        let mut all: Vec<f64> = match self {
            Self::Points(points) => (0..self.len())
                .map(|i| sensor.measured(&points.point(i)))
                .collect::<Option<_>>()?,
            Self::Modes(modes) => modes
                .iter()
                .map(|(_, mode)| sensor.measured(mode.mean()))
                .collect::<Option<_>>()?,
        };
        if let (Some(period), Some(first)) = (sensor.period(), all.first().copied()) {
            all.iter_mut().for_each(|m| *m = nearest(*m, first, period));
        }
        Some(all)
    }

    /// Of each part `ln p` of an observation, and the correction of the measurement by it: none of a point.
    fn evidence(&self, observed: &dyn Likelihood<D>) -> Option<Vec<(f64, f64)>> {
        match self {
            Self::Points(points) => {
                let mut logs = vec![0.0; self.len()];
                observed.add_log_likelihoods(points.columns(), &mut logs);
                Some(logs.into_iter().map(|log| (log, 0.0)).collect())
            }
            Self::Modes(modes) => modes.iter().map(|(_, mode)| placed(observed.evidence(mode))).collect(),
        }
    }

    /// The beliefs of all parts, if the sensor sends a value under each.
    fn of_values(&self, sensor: &dyn RemoteSensor<D>) -> Option<Vec<Gaussian<D>>> {
        // What a sensor sends does not depend on the point.
        let asked = if matches!(self, Self::Points(_)) { 1 } else { self.len() };
        for i in 0..asked {
            sensor.value_variance(&self.belief(i)?)?;
        }
        (0..self.len()).map(|i| self.belief(i)).collect()
    }
}

impl<const D: usize> Member<D> {
    fn test_by_mixture(&self, reading: &Reading<'_, D>, modes: &[(f64, Gaussian<D>)]) -> Tested {
        let log_weights: Vec<f64> = modes.iter().map(|(log, _)| *log).collect();
        self.test_by_parts(reading, Parts::Modes(modes), &log_weights)
    }

    fn test_by_parts(&self, reading: &Reading<'_, D>, parts: Parts<'_, D>, log_weights: &[f64]) -> Tested {
        let Some(known) = reading.known() else {
            return Tested::without_residual(false);
        };
        // An observation that cannot update a belief may still have a probability.
        let Some(found) = parts.evidence(known) else {
            return Tested::without_residual(true);
        };
        let total = log_sum(log_weights.iter().copied());
        let joint = log_weights.iter().zip(&found).map(|(weight, (log, _))| weight + log);
        if !(log_sum(joint) - total).is_finite() {
            return Tested::without_residual(false);
        }
        let weights: Vec<f64> = log_weights.iter().map(|log| (log - total).exp()).collect();
        let residual = match &reading.slot.observation {
            Observation::Received(bits) if reading.content == Content::Report => {
                self.residual_by_parts(reading, bits, parts, &weights, &found)
            }
            _ => None,
        };
        Tested {
            is_possible: true,
            residual,
        }
    }

    fn residual_by_parts(
        &self,
        reading: &Reading<'_, D>,
        received: &BitString,
        parts: Parts<'_, D>,
        weights: &[f64],
        found: &[(f64, f64)],
    ) -> Option<Residual> {
        let measured = parts.measured(&*self.sensor)?;
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
        if let Some(beliefs) = parts.of_values(&*self.sensor) {
            let (logs, after): (Vec<f64>, Vec<f64>) = found
                .iter()
                .zip(&measured)
                .map(|((log, correction), h)| (*log, h + correction))
                .unzip();
            return self.residual_of_report(reading, &beliefs, weights, &measured, (&logs, &after));
        }
        self.residual_of_word(reading.slot, received, |other| {
            let likelihood = self.sensor.likelihood(other, 1.0).ok()?;
            Some(place(&parts.evidence(&*likelihood)?)).filter(|(log, _)| log.is_finite())
        })
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
