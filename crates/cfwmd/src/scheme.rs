//! Censoring sensors with feedback: the sensor's half, and the likelihood of its reports and silences.

use crate::Error;
use crate::censored::{Censored, MissingReports};
use crate::rule::CensoringRule;
use fewbits_core::circle::all_nearest;
use fewbits_core::rand::Rng;
use fewbits_core::{
    Deterministic, Gaussian, LinearSensing, Link, MeasurementNoise, NumberFormat, Observation, Scheme, Sensing,
};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, non_negative};
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{SMatrix, SVector};

/// A sensor that compares its measurement with the broadcast predicted state, under a rule that both ends know. The rule of
/// this slot comes from the sensor's own covariance recursion (the paper's CFwMD) or from a schedule.
///
/// The sensor decides on the unrounded measurement and sends it rounded to the format. Both ends use the broadcast as it was rounded for
/// sending.
#[derive(Debug, Clone, PartialEq)]
pub struct Censoring<S, const D: usize, const M: usize> {
    sensing: S,
    rule: CensoringRule<M>,
    format: NumberFormat,
}

impl<const D: usize, const M: usize, S: Sensing<D, M>> Censoring<S, D, M> {
    /// The scheme of one sensor in one slot.
    ///
    /// # Errors
    /// If `format` is one of a few levels and `M > 1`: the cell of a rounded vector without an ellipsoid has no closed form.
    pub fn new(sensing: S, rule: CensoringRule<M>, format: NumberFormat) -> Result<Self, Error> {
        if M > 1 && matches!(format, NumberFormat::Fixed(_)) {
            return Err(ArgumentError::new("format", format!("{format:?}"), "floating point for vectors").into());
        }
        Ok(Self { sensing, rule, format })
    }

    /// The rule of this slot.
    pub fn rule(&self) -> &CensoringRule<M> {
        &self.rule
    }

    /// The factor of the missing reports of sensors identical with this one; for vector measurements of one report.
    ///
    /// # Errors
    /// If the broadcast is not finite; as [`Censored::missing`].
    pub fn missing(
        &self,
        broadcast: &SVector<f64, D>,
        link: &Link,
        reports: MissingReports,
    ) -> Result<Censored<M>, Error> {
        let prediction = self.sensing.mean(broadcast);
        let noise = self.sensing.noise_covariance_at(broadcast);
        Ok(Censored::missing(&self.rule, &prediction, &noise, link, reports)?)
    }

    /// The factor of a received value.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the rule would not have sent the value. If a number is not finite, or the link may invert bits: over such a
    /// link a value needs a checksum; a report that fails it is [`Observation::Lost`].
    pub fn received(
        &self,
        broadcast: &SVector<f64, D>,
        value: &SVector<f64, M>,
        link: &Link,
    ) -> Result<Censored<M>, Error> {
        let (prediction, arrival) = (self.prediction_near(value, broadcast), link.of_received()?);
        let noise = self.sensing.noise_covariance_at(broadcast);
        if let NumberFormat::Fixed(levels) = &self.format {
            finite_over(link, value, &prediction)?;
            let factor = Censored::level(value[0], levels, &self.rule, prediction[0], noise[(0, 0)], arrival);
            return factor.map_err(|_| Error::Impossible);
        }
        self.check_value(&prediction, value, link)?;
        Ok(Censored::value(value, &noise, arrival)?)
    }

    /// The predicted measurement; components on a circle are nearest to `value`.
    fn prediction_near(&self, value: &SVector<f64, M>, broadcast: &SVector<f64, D>) -> SVector<f64, M> {
        all_nearest(self.sensing.mean(broadcast), value, &self.sensing.periods())
    }

    /// Checks a received value: it is finite, the rule would have sent it against this prediction, and the link inverts no bits.
    pub(crate) fn check_value(
        &self,
        prediction: &SVector<f64, M>,
        value: &SVector<f64, M>,
        link: &Link,
    ) -> Result<(), Error> {
        finite_over(link, value, prediction)?;
        // Relative rounding error of single precision, half the spacing of its numbers.
        let share = if self.format == NumberFormat::Single { 6e-8 } else { 0.0 };
        self.rule.check(&(value - prediction), &value.map(|z| z.abs() * share))
    }
}

fn finite_over<const M: usize>(
    link: &Link,
    value: &SVector<f64, M>,
    prediction: &SVector<f64, M>,
) -> Result<(), Error> {
    all_finite("report", value.as_slice())?;
    fewbits_numerics::error::within("crossover", link.crossover(), 0.0, 0.0)?;
    Ok(all_finite("prediction", prediction.as_slice())?)
}

impl<const D: usize, const M: usize, S: Sensing<D, M>> Censoring<S, D, M> {
    /// The report of a measurement for the broadcast prediction; `None` is silence.
    ///
    /// # Errors
    /// If the measurement or the prediction is not finite.
    pub(crate) fn report(
        &self,
        measurement: &SVector<f64, M>,
        broadcast: &SVector<f64, D>,
    ) -> Result<Option<SVector<f64, M>>, Error> {
        let prediction = self.prediction_near(measurement, broadcast);
        all_finite("prediction", prediction.as_slice())?;
        send_if(&self.rule, measurement, &prediction, &self.format)
    }
}

impl<const D: usize, const M: usize, S: Sensing<D, M>> Deterministic<M> for Censoring<S, D, M> {}

impl<const D: usize, const M: usize, S: Sensing<D, M>> Scheme<M> for Censoring<S, D, M> {
    type State = ();
    /// The predicted state of the fusion centre.
    type Feedback = SVector<f64, D>;
    type Report = SVector<f64, M>;
    type Factor = Censored<M>;

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn report_format(&self) -> NumberFormat {
        self.format
    }

    fn encode(
        &self,
        _: &mut dyn Rng,
        (): &mut (),
        measurement: &SVector<f64, M>,
        broadcast: &SVector<f64, D>,
    ) -> Result<Option<SVector<f64, M>>, Error> {
        self.report(measurement, broadcast)
    }

    fn factor(
        &self,
        broadcast: &SVector<f64, D>,
        observation: &Observation<SVector<f64, M>>,
        link: &Link,
    ) -> Result<Censored<M>, Error> {
        match observation {
            Observation::Received(value) => self.received(broadcast, value, link),
            Observation::Nothing => self.missing(broadcast, link, MissingReports { nothing: 1, lost: 0 }),
            Observation::Lost => self.missing(broadcast, link, MissingReports { nothing: 0, lost: 1 }),
        }
    }
}

/// The rounded measurement; `None` if the rule does not send it.
pub(crate) fn send_if<const M: usize>(
    rule: &CensoringRule<M>,
    measurement: &SVector<f64, M>,
    prediction: &SVector<f64, M>,
    format: &NumberFormat,
) -> Result<Option<SVector<f64, M>>, Error> {
    all_finite("measurement", measurement.as_slice())?;
    if !rule.sends(&(measurement - prediction)) {
        return Ok(None);
    }
    let mut report = *measurement;
    for z in report.iter_mut() {
        *z = format.rounded(*z)?;
    }
    Ok(Some(report))
}

/// A sensor that also receives the covariance of the prediction and weighs its innovation with `S = R + H P H'` (the paper's
/// CFwMD2). The message budget is met, but every broadcast contains a covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct CovarianceFeedback<S, const D: usize, const M: usize> {
    sensing: S,
    threshold: f64,
    format: NumberFormat,
}

impl<const D: usize, const M: usize, S: Sensing<D, M> + Clone> CovarianceFeedback<S, D, M> {
    /// The scheme with threshold `eta >= 0`.
    ///
    /// # Errors
    /// If the threshold is negative; as [`Censoring::new`].
    pub fn new(sensing: S, threshold: f64, format: NumberFormat) -> Result<Self, Error> {
        let unit = CensoringRule::new(&SMatrix::identity(), non_negative("threshold", threshold)?)?;
        Censoring::new(sensing.clone(), unit, format)?;
        Ok(Self {
            sensing,
            threshold,
            format,
        })
    }

    /// The scheme of the slot with this broadcast.
    ///
    /// # Errors
    /// If `R + H P H'` is not positive definite.
    pub fn under(&self, broadcast: &Gaussian<D>) -> Result<Censoring<S, D, M>, Error> {
        let rule = rule_under(&self.sensing, broadcast, self.threshold)?;
        Censoring::new(self.sensing.clone(), rule, self.format)
    }
}

/// The rule with `S = R + H P H'`, the sensing linearised at the belief's mean.
pub(crate) fn rule_under<const D: usize, const M: usize>(
    sensing: &impl Sensing<D, M>,
    predicted: &Gaussian<D>,
    threshold: f64,
) -> Result<CensoringRule<M>, Error> {
    let matrix = sensing.jacobian(predicted.mean());
    let noise = sensing.noise_covariance_at(predicted.mean());
    let innovation = matrix * predicted.covariance() * matrix.transpose() + noise;
    CensoringRule::new(&symmetrised(&innovation), threshold)
}

/// For linear sensors, whose noise does not depend on the state.
impl<const D: usize, const M: usize, S: LinearSensing<D, M>> MeasurementNoise<M> for Censoring<S, D, M> {
    fn noise_covariance_at(&self, _: &SVector<f64, M>) -> SMatrix<f64, M, M> {
        *self.sensing.noise_covariance()
    }
}

/// For linear sensors, whose noise does not depend on the state.
impl<const D: usize, const M: usize, S: LinearSensing<D, M>> MeasurementNoise<M> for CovarianceFeedback<S, D, M> {
    fn noise_covariance_at(&self, _: &SVector<f64, M>) -> SMatrix<f64, M, M> {
        *self.sensing.noise_covariance()
    }
}

impl<const D: usize, const M: usize, S: Sensing<D, M> + Clone> Deterministic<M> for CovarianceFeedback<S, D, M> {}

impl<const D: usize, const M: usize, S: Sensing<D, M> + Clone> Scheme<M> for CovarianceFeedback<S, D, M> {
    type State = ();
    /// The prediction of the fusion centre: `D + D (D + 1)/2` numbers.
    type Feedback = Gaussian<D>;
    type Report = SVector<f64, M>;
    type Factor = Censored<M>;

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn report_format(&self) -> NumberFormat {
        self.format
    }

    fn encode(
        &self,
        _: &mut dyn Rng,
        (): &mut (),
        measurement: &SVector<f64, M>,
        broadcast: &Gaussian<D>,
    ) -> Result<Option<SVector<f64, M>>, Error> {
        let sensor = self.under(broadcast)?;
        sensor.report(measurement, broadcast.mean())
    }

    fn factor(
        &self,
        broadcast: &Gaussian<D>,
        observation: &Observation<SVector<f64, M>>,
        link: &Link,
    ) -> Result<Censored<M>, Error> {
        let sensor = self.under(broadcast)?;
        sensor.factor(broadcast.mean(), observation, link)
    }
}
