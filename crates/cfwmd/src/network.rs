//! A network of censoring sensors with feedback, as its fusion centre knows it.

use crate::Error;
use crate::assumed_density::{ScalarSilence, hear_scalar_silence, hear_silence};
use crate::message::{Format, Report};
use crate::rule::CensoringRule;
use crate::silence::check_loss;
use fewbits_core::{Encoder, Gaussian, Observation};
use fewbits_filters::kalman;
use fewbits_models::LinearSensor;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, at_least_one};
use nalgebra::{SMatrix, SVector};

/// What the fusion centre knows of the network: the sensors, the threshold `eta` of all, and the loss rate of the links.
#[derive(Debug, Clone, PartialEq)]
pub struct Network<const D: usize, const M: usize> {
    sensors: Vec<LinearSensor<D, M>>,
    /// For each sensor the first one that is identical with it.
    twin: Vec<usize>,
    threshold: f64,
    loss: f64,
}

/// What a step of fusion learned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusionInfo {
    /// `ln p(all that was heard | heard before)`: densities of the values, probabilities of the silences. For the
    /// assumed-density filter an approximation, as its belief is.
    pub log_likelihood: f64,
    /// Number of values received.
    pub received: usize,
}

/// The sensor's half with feedback: compares its measurement with the broadcast prediction of it.
///
/// Cheap and free of allocation: one product with the factor of `S`, which is data-free in the linear case.
#[derive(Debug, Clone)]
pub struct CensoringSensor<const M: usize> {
    /// The rule of this step.
    pub rule: CensoringRule<M>,
    /// How its values travel.
    pub format: Format,
}

impl<const M: usize> Encoder for CensoringSensor<M> {
    type Measurement = SVector<f64, M>;
    /// The prediction of this sensor's measurement, as the fusion centre broadcast it: if the broadcast is rounded, both
    /// sides must use the rounded one.
    type Feedback = SVector<f64, M>;
    type Message = Report<M>;

    fn encode(&self, measurement: &SVector<f64, M>, prediction: &SVector<f64, M>) -> Report<M> {
        let rounded = measurement.map(|z| self.format.rounded(z));
        if self.rule.speaks(&(rounded - prediction)) {
            Report::Value(rounded)
        } else {
            Report::Silence
        }
    }
}

impl<const D: usize, const M: usize> Network<D, M> {
    /// A network of at least one sensor with threshold `eta >= 0` and loss in `[0, 1)`.
    ///
    /// # Errors
    /// Arguments out of range.
    pub fn new(sensors: Vec<LinearSensor<D, M>>, threshold: f64, loss: f64) -> Result<Self, Error> {
        at_least_one("sensors", sensors.len())?;
        fewbits_numerics::error::non_negative("threshold", threshold)?;
        check_loss(loss)?;
        let twin = (0..sensors.len())
            .map(|i| sensors.iter().position(|s| *s == sensors[i]).unwrap_or(i))
            .collect();
        Ok(Self {
            sensors,
            twin,
            threshold,
            loss,
        })
    }

    /// The sensors.
    pub fn sensors(&self) -> &[LinearSensor<D, M>] {
        &self.sensors
    }

    /// Number of sensors.
    pub fn len(&self) -> usize {
        self.sensors.len()
    }

    /// Never true: a network has at least one sensor.
    pub fn is_empty(&self) -> bool {
        self.sensors.is_empty()
    }

    /// `eta`.
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// Probability that a message that is sent does not arrive.
    pub fn loss(&self) -> f64 {
        self.loss
    }

    /// The first sensor that is identical with sensor `i`; identical sensors share evaluations.
    pub fn twin(&self, i: usize) -> usize {
        self.twin[i]
    }

    /// The rule of sensor `i` weighed with `S = R + H P H'`, `P` the fusion centre's (or a scheduled) predicted covariance.
    ///
    /// # Errors
    /// An unknown sensor; a covariance that is not finite or not positive semidefinite.
    pub fn rule_under(&self, i: usize, predicted: &SMatrix<f64, D, D>) -> Result<CensoringRule<M>, Error> {
        let sensor = self.sensors.get(i).ok_or(Error::UnknownSensor {
            sensor: i,
            sensors: self.len(),
        })?;
        let innovation = sensor.matrix() * predicted * sensor.matrix().transpose() + sensor.noise_covariance();
        CensoringRule::new(&fewbits_numerics::linalg::symmetrised(&innovation), self.threshold)
    }

    /// Checks that what was heard can have come from this network under these rules and this broadcast.
    ///
    /// # Errors
    /// [`Error::ObservationCount`], values that are not finite, [`Error::ProtocolViolation`], [`Error::ImpossibleSilence`].
    pub fn audit(
        &self,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        heard: &[Observation<SVector<f64, M>>],
    ) -> Result<(), Error> {
        if heard.len() != self.len() {
            return Err(Error::ObservationCount {
                heard: heard.len(),
                sensors: self.len(),
            });
        }
        if rules.len() != self.len() {
            return Err(ArgumentError::new("rules", rules.len(), format!("{} rules, one a sensor", self.len())).into());
        }
        all_finite("broadcast", broadcast.as_slice())?;
        for (i, (observation, rule)) in heard.iter().zip(rules).enumerate() {
            match observation {
                Observation::Received(value) => {
                    all_finite("measurement", value.as_slice())?;
                    rule.audit(i, &(value - self.sensors[i].matrix() * broadcast))?;
                }
                Observation::Silent if rule.threshold() == 0.0 && self.loss == 0.0 => {
                    return Err(Error::ImpossibleSilence { sensor: i });
                }
                Observation::Silent | Observation::Lost => {}
            }
        }
        Ok(())
    }

    /// One update of the Gaussian fusion centre: values, then silences. `broadcast` is the state prediction that the sensors
    /// compared with; without rounding it is the mean of `predicted`.
    ///
    /// Identical scalar sensors are heard together and exactly; distinct or vector ones one after the other.
    ///
    /// # Errors
    /// As [`audit`](Self::audit); the belief handed in is untouched.
    pub fn fuse(
        &self,
        predicted: &Gaussian<D>,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        heard: &[Observation<SVector<f64, M>>],
    ) -> Result<(Gaussian<D>, FusionInfo), Error> {
        self.audit(rules, broadcast, heard)?;
        let (mut belief, mut info) = self.fuse_values(predicted, heard)?;
        for (i, sensor) in self.sensors.iter().enumerate() {
            let count = self.heard_together(rules, heard, i);
            if count == 0 {
                continue;
            }
            let prediction = sensor.matrix() * broadcast;
            let (next, log_likelihood) = if M == 1 {
                let silence = ScalarSilence {
                    centre: prediction[0],
                    half_width: rules[i].first_half_width(),
                    noise_variance: sensor.noise_covariance()[(0, 0)],
                    loss: self.loss,
                    count,
                };
                hear_scalar_silence(&belief, &sensor.matrix().row(0).transpose(), &silence)?
            } else {
                hear_silence(&belief, sensor, &rules[i], &prediction, self.loss)?
            };
            belief = next;
            info.log_likelihood += log_likelihood;
        }
        Ok((belief, info))
    }

    /// How many silent sensors are heard in the name of sensor `i`: itself and, for scalar measurements, its later twins under
    /// the same rule; none if it spoke or an earlier twin stands for it.
    pub(crate) fn heard_together(
        &self,
        rules: &[CensoringRule<M>],
        heard: &[Observation<SVector<f64, M>>],
        i: usize,
    ) -> usize {
        let alike = |j: usize| {
            self.twin[j] == self.twin[i]
                && heard[j] == Observation::Silent
                && rules[j].first_half_width() == rules[i].first_half_width()
        };
        if heard[i] != Observation::Silent {
            0
        } else if M > 1 {
            1
        } else if (0..i).any(alike) {
            0
        } else {
            (i..self.len()).filter(|j| alike(*j)).count()
        }
    }

    /// The baseline (the paper's CFoMD, and all-send and random censoring): a Kalman filter on what was received, deaf to
    /// silence.
    ///
    /// # Errors
    /// [`Error::ObservationCount`], values that are not finite.
    pub fn fuse_values(
        &self,
        predicted: &Gaussian<D>,
        heard: &[Observation<SVector<f64, M>>],
    ) -> Result<(Gaussian<D>, FusionInfo), Error> {
        if heard.len() != self.len() {
            return Err(Error::ObservationCount {
                heard: heard.len(),
                sensors: self.len(),
            });
        }
        let mut belief = *predicted;
        let mut info = FusionInfo {
            log_likelihood: 0.0,
            received: 0,
        };
        for (sensor, observation) in self.sensors.iter().zip(heard) {
            if let Observation::Received(value) = observation {
                let (next, update) = kalman::update(sensor, &belief, value)?;
                belief = next;
                info.log_likelihood += update.log_likelihood;
                info.received += 1;
            }
        }
        Ok((belief, info))
    }
}
