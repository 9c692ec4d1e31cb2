//! A network of censoring sensors with feedback, as its fusion centre knows it.

use crate::Error;
use crate::censored::{Censored, MissingReports};
use crate::rule::CensoringRule;
use crate::scheme::{Censoring, CovarianceFeedback, rule_under};
use fewbits_core::{Gaussian, LinearSensing, Link, NumberFormat, Observation, Observed, Scheme, Sensing};
use fewbits_filters::StateFilter;
use fewbits_filters::centre::{FusionCentre, Reporting};
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

/// One observation per sensor, and the number of reports that were sent.
pub type Transmitted<const M: usize> = (Vec<Observation<SVector<f64, M>>>, usize);

/// A sensor of a [`Network`] as a fusion centre knows it, with the scheme `C` and the feedback `A`.
pub type Remote<S, C, A, const D: usize, const M: usize> = Reporting<S, C, fn(&Gaussian<D>, &Gaussian<M>) -> A, M>;

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
        rule_under(self.sensor(i)?, predicted, self.threshold)
    }

    fn sensor(&self, i: usize) -> Result<&S, ArgumentError> {
        let expected = || format!("an index below {}, the number of sensors", self.sensors.len());
        self.sensors
            .get(i)
            .ok_or_else(|| ArgumentError::new("i", i, expected()))
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

    /// Sensor `i` as a fusion centre knows it, with covariance feedback: identical scalar sensors are a group, whose silence is one factor.
    ///
    /// # Errors
    /// If there is no sensor `i`; as [`CovarianceFeedback::new`].
    pub(crate) fn remote(&self, i: usize) -> Result<Remote<S, CovarianceFeedback<S, D, M>, Gaussian<D>, D, M>, Error> {
        let sensor = self.sensor(i)?.clone();
        let scheme = CovarianceFeedback::new(sensor.clone(), self.threshold, self.format)?;
        let ask = (|predicted, _| *predicted) as fn(&Gaussian<D>, &Gaussian<M>) -> Gaussian<D>;
        Ok(Reporting::new(sensor, scheme, self.link, ask).in_group(self.identical[i] as u32))
    }

    /// Sensor `i` as a fusion centre knows it in a slot with this rule, which both ends know: that of the sensor's own recursion or of a schedule.
    /// A centre takes the rule of the next slot by [`FusionCentre::renew`]. Identical sensors have the same rule.
    ///
    /// # Errors
    /// If there is no sensor `i`; as [`Censoring::new`].
    pub fn remote_under(
        &self,
        i: usize,
        rule: &CensoringRule<M>,
    ) -> Result<Remote<S, Censoring<S, D, M>, SVector<f64, D>, D, M>, Error> {
        let ask = (|predicted, _| *predicted.mean()) as fn(&Gaussian<D>, &Gaussian<M>) -> SVector<f64, D>;
        let sensor = self.sensor(i)?.clone();
        Ok(Reporting::new(sensor, self.scheme(i, rule)?, self.link, ask).in_group(self.identical[i] as u32))
    }

    /// Joins all sensors to a centre, numbered from 0, with covariance feedback.
    ///
    /// # Errors
    /// As [`CovarianceFeedback::new`] and [`FusionCentre::join`].
    pub fn join<F: StateFilter<D>>(&self, centre: &mut FusionCentre<D, F>) -> Result<(), Error>
    where
        S: LinearSensing<D, M> + 'static,
    {
        (0..self.sensors.len()).try_for_each(|i| centre.join(i as u32, self.remote(i)?))
    }

    /// The observations of one instant as likelihoods, in the order in which a Gaussian is best conditioned on them: the values, then the missing
    /// reports. Those of identical scalar sensors under the same rule are one. Together they are the `Likelihood` of the instant, for any
    /// filter; a value updates a Gaussian by the Kalman filter. `None` stands for a sensor that was not asked.
    ///
    /// # Errors
    /// If the numbers of rules or observations are wrong, a number is not finite, or a value violates its rule.
    pub fn likelihoods(
        &self,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Option<Observation<SVector<f64, M>>>],
    ) -> Result<Vec<Observed<S, Censored<M>, M>>, Error> {
        self.count(rules.len(), observations.len())?;
        let mut all = Vec::with_capacity(observations.len());
        for (i, sensor) in self.sensors.iter().enumerate() {
            if let Some(Observation::Received(value)) = &observations[i] {
                let factor = self.scheme(i, &rules[i])?.received(broadcast, value, &self.link)?;
                all.push(Observed::new(sensor.clone(), factor));
            }
        }
        for (i, sensor) in self.sensors.iter().enumerate() {
            if let Some(missing) = self.missing_together(rules, observations, i) {
                let factor = self.scheme(i, &rules[i])?.missing(broadcast, &self.link, missing)?;
                all.push(Observed::new(sensor.clone(), factor));
            }
        }
        Ok(all)
    }

    /// The missing reports that share the factor of sensor `i`: its own and, for scalar measurements, those of later identical
    /// sensors under the same rule. `None` if the report of `i` arrived, or the factor of an earlier sensor includes it.
    fn missing_together(
        &self,
        rules: &[CensoringRule<M>],
        observed: &[Option<Observation<SVector<f64, M>>>],
        i: usize,
    ) -> Option<MissingReports> {
        let missing = |j: usize| observed[j].is_some_and(|observed| observed.received().is_none());
        let alike = |j: usize| missing(j) && self.identical[j] == self.identical[i] && rules[j] == rules[i];
        if !missing(i) || (M == 1 && (0..i).any(alike)) {
            return None;
        }
        let last = if M == 1 { self.sensors.len() } else { i + 1 };
        let of = |kind| (i..last).filter(|j| alike(*j) && observed[*j] == Some(kind)).count();
        Some(MissingReports {
            nothing: of(Observation::Nothing),
            lost: of(Observation::Lost),
        })
    }
}
