//! Model of a network of censoring sensors with feedback, as its fusion centre knows it, and the fusion step.

use crate::Error;
use crate::censored::{Censored, MissingReports};
use crate::rule::CensoringRule;
use crate::scheme::{Censoring, rule_under};
use fewbits_core::{Gaussian, LinearSensing, Link, NumberFormat, Observation, Observed, Scheme, Sensing};
use fewbits_filters::{assumed_density, kalman};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, entries, non_negative};
use nalgebra::SVector;
use rand::Rng;

/// The sensors, their common threshold `eta`, the links, and the format of the values.
#[derive(Debug, Clone, PartialEq)]
pub struct Network<S, const D: usize, const M: usize> {
    sensors: Vec<S>,
    /// For each sensor the index of the first sensor that is identical with it.
    identical: Vec<usize>,
    threshold: f64,
    link: Link,
    format: NumberFormat,
}

/// Likelihood and received values of one fusion step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct FusionInfo {
    /// `ln p(all observations | those of the past)`: densities of the values, probabilities of the silences. It is an approximation for
    /// the assumed-density filter, because its belief is one.
    pub log_likelihood: f64,
    /// Number of values received.
    pub received: usize,
}

/// One observation per sensor, and the number of reports that were sent.
pub type Transmitted<const M: usize> = (Vec<Observation<SVector<f64, M>>>, usize);

impl<S: Sensing<D, M> + Clone + PartialEq, const D: usize, const M: usize> Network<S, D, M> {
    /// A network of at least one sensor with threshold `eta >= 0`; values travel in double precision.
    ///
    /// # Errors
    /// If there is no sensor or the threshold is negative.
    pub fn new(sensors: Vec<S>, threshold: f64, link: Link) -> Result<Self, Error> {
        at_least_one("sensors", sensors.len())?;
        let identical = (0..sensors.len())
            .map(|i| sensors.iter().position(|s| *s == sensors[i]).unwrap_or(i))
            .collect();
        Ok(Self {
            sensors,
            identical,
            threshold: non_negative("threshold", threshold)?,
            link,
            format: NumberFormat::Double,
        })
    }

    /// The same network with values in another format.
    #[must_use]
    pub fn with_format(self, format: NumberFormat) -> Self {
        Self { format, ..self }
    }

    /// The sensors.
    pub fn sensors(&self) -> &[S] {
        &self.sensors
    }

    /// Threshold `eta` on the normalised innovation squared.
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// The links' probabilities of loss and of inversion that the fusion centre assumes.
    pub fn link(&self) -> &Link {
        &self.link
    }

    /// Number format of the sent values.
    pub fn format(&self) -> NumberFormat {
        self.format
    }

    /// The rule of sensor `i` for the predicted belief of the fusion centre, or a scheduled one: the innovation is weighed with
    /// `S = R + H P H'`, `P` the predicted covariance and `H` the Jacobian at the predicted mean.
    ///
    /// # Errors
    /// If there is no sensor `i`, or `S` is not positive definite.
    pub fn rule_under(&self, i: usize, predicted: &Gaussian<D>) -> Result<CensoringRule<M>, Error> {
        let expected = || format!("an index below {}, the number of sensors", self.sensors.len());
        let sensor = self
            .sensors
            .get(i)
            .ok_or_else(|| ArgumentError::new("i", i, expected()))?;
        rule_under(sensor, predicted, self.threshold)
    }

    /// [`Network::rule_under`] for every sensor.
    ///
    /// # Errors
    /// As [`Network::rule_under`].
    pub fn rules_under(&self, predicted: &Gaussian<D>) -> Result<Vec<CensoringRule<M>>, Error> {
        (0..self.sensors.len()).map(|i| self.rule_under(i, predicted)).collect()
    }

    /// The scheme of sensor `i` in a slot with this rule.
    fn scheme(&self, i: usize, rule: &CensoringRule<M>) -> Result<Censoring<S, D, M>, Error> {
        Censoring::new(self.sensors[i].clone(), rule.clone(), self.format)
    }

    /// Simulates one slot of all sensors. Each compares its measurement with the broadcast; what it sends crosses its link. `rules` and
    /// `measurements` have one entry per sensor.
    ///
    /// # Errors
    /// If the numbers of rules or measurements are wrong or a number is not finite.
    pub fn transmit<R: Rng>(
        &self,
        rng: &mut R,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        measurements: &[SVector<f64, M>],
    ) -> Result<Transmitted<M>, Error> {
        self.count(rules.len(), measurements.len())?;
        let mut sent = 0;
        let observations = (0..self.sensors.len()).map(|i| {
            let scheme = self.scheme(i, &rules[i])?;
            let report = scheme.encode(rng, &mut (), &measurements[i], broadcast)?;
            sent += usize::from(report.is_some());
            let arrived = self.link.transmit(rng, report.as_ref(), &self.format);
            arrived.map_err(|e| ArgumentError::new("report", e.to_string(), "a message of its format").into())
        });
        Ok((observations.collect::<Result<_, Error>>()?, sent))
    }

    pub(crate) fn count(&self, rules: usize, observations: usize) -> Result<(), Error> {
        entries("rules", rules, self.sensors.len())?;
        Ok(entries("observations", observations, self.sensors.len())?)
    }

    /// The observations as a likelihood for particle and grid filters. There is one entry per group of identical scalar sensors that
    /// sent a value, one per group of identical scalar sensors whose reports are missing under the same rule, and one per other sensor.
    ///
    /// # Errors
    /// If the numbers of rules or observations are wrong, a number is not finite, or a value violates its rule.
    pub fn likelihood(
        &self,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Observation<SVector<f64, M>>],
    ) -> Result<Vec<Observed<S, Censored<M>, M>>, Error> {
        self.count(rules.len(), observations.len())?;
        let plain = !matches!(self.format, NumberFormat::Fixed(_));
        let mut all = Vec::new();
        for (i, observation) in observations.iter().enumerate() {
            let mut push = |factor| all.push(Observed::new(self.sensors[i].clone(), factor));
            if let Observation::Received(value) = observation {
                let single = self.scheme(i, &rules[i])?.received(broadcast, value, &self.link)?;
                if !(M == 1 && plain) {
                    push(single);
                }
            }
            // Scalar values of identical sensors are combined into one factor; the first sensor of the group carries it.
            if M == 1 && plain && self.identical[i] == i {
                let like = |j: usize| self.identical[j] == i;
                let received = |j: usize| observations[j].received().filter(|_| like(j)).copied();
                let values: Vec<_> = (i..observations.len()).filter_map(received).collect();
                if !values.is_empty() {
                    let noise = self.sensors[i].noise_covariance_at(broadcast);
                    push(Censored::values(&values, &noise, self.link.of_received()?)?);
                }
            }
            if let Some(missing) = self.missing_together(rules, |j| Some(observations[j]), i) {
                push(self.scheme(i, &rules[i])?.missing(broadcast, &self.link, missing)?);
            }
        }
        Ok(all)
    }

    /// The missing reports that share the factor of sensor `i`: its own and, for scalar measurements, those of later identical
    /// sensors under the same rule. `None` if the report of `i` arrived, or the factor of an earlier sensor includes it.
    fn missing_together(
        &self,
        rules: &[CensoringRule<M>],
        observed: impl Fn(usize) -> Option<Observation<SVector<f64, M>>>,
        i: usize,
    ) -> Option<MissingReports> {
        let missing = |j: usize| observed(j).is_some_and(|observed| observed.received().is_none());
        let alike = |j: usize| missing(j) && self.identical[j] == self.identical[i] && rules[j] == rules[i];
        if !missing(i) || (M == 1 && (0..i).any(alike)) {
            return None;
        }
        let last = if M == 1 { self.sensors.len() } else { i + 1 };
        let of = |kind| (i..last).filter(|j| alike(*j) && observed(*j) == Some(kind)).count();
        Some(MissingReports {
            nothing: of(Observation::Nothing),
            lost: of(Observation::Lost),
        })
    }
}

impl<S: LinearSensing<D, M> + Clone + PartialEq, const D: usize, const M: usize> Network<S, D, M> {
    /// One update of the Gaussian fusion centre: received values first, then missing reports. `broadcast` is the predicted state that the
    /// sensors compared with: the mean of `predicted`, rounded to the format.
    ///
    /// Missing reports of identical scalar sensors are fused in one exact step, those of other sensors one after the other.
    ///
    /// # Errors
    /// As [`Network::likelihood`]; [`Error::Impossible`] if the observations have probability zero.
    pub fn fuse(
        &self,
        predicted: &Gaussian<D>,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Observation<SVector<f64, M>>],
    ) -> Result<(Gaussian<D>, FusionInfo), Error> {
        let asked: Vec<_> = observations.iter().copied().map(Some).collect();
        self.fuse_asked(predicted, rules, broadcast, &asked)
    }

    /// As [`fuse`](Self::fuse). `None` stands for a sensor without observation: it was not asked, or its report cannot be used. Neither
    /// its value nor its silence is fused.
    ///
    /// # Errors
    /// As [`fuse`](Self::fuse).
    pub fn fuse_asked(
        &self,
        predicted: &Gaussian<D>,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Option<Observation<SVector<f64, M>>>],
    ) -> Result<(Gaussian<D>, FusionInfo), Error> {
        self.count(rules.len(), observations.len())?;
        let (mut belief, mut info, mut plain) = (*predicted, FusionInfo::default(), 0_usize);
        let update = |belief: &mut Gaussian<D>, i: usize, factor: &Censored<M>| -> Result<f64, Error> {
            let (next, step) = assumed_density::update(belief, self.sensors[i].matrix(), factor)?;
            *belief = next;
            Ok(step.log_likelihood)
        };
        for (i, sensor) in self.sensors.iter().enumerate() {
            let Some(Observation::Received(value)) = observations[i] else {
                continue;
            };
            info.received += 1;
            let scheme = self.scheme(i, &rules[i])?;
            if matches!(self.format, NumberFormat::Fixed(_)) {
                info.log_likelihood += update(&mut belief, i, &scheme.received(broadcast, &value, &self.link)?)?;
            } else {
                // A received value: a Kalman update, which is the closed form for its factor.
                scheme.check_value(&sensor.mean(broadcast), &value, &self.link)?;
                let (next, step) = kalman::update(sensor, &belief, &value)?;
                belief = next;
                info.log_likelihood += step.log_likelihood;
                plain += 1;
            }
        }
        if plain > 0 {
            info.log_likelihood += plain as f64 * self.link.of_received()?.ln();
        }
        for i in 0..self.sensors.len() {
            if let Some(missing) = self.missing_together(rules, |j| observations[j], i) {
                let factor = self.scheme(i, &rules[i])?.missing(broadcast, &self.link, missing)?;
                info.log_likelihood += update(&mut belief, i, &factor)?;
            }
        }
        Ok((belief, info))
    }
}
