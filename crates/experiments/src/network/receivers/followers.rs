//! Signals followed within a guaranteed error, and a filter of what they measure.

use fewbits_adaptive::{Config, Packet, Receiver, Sensor};
use fewbits_baselines::over_bits::{Estimator, moments};
use fewbits_core::factor::Levels;
use fewbits_core::{
    BitReader, BitString, BitWriter, Cell, CodecError, Gaussian, LinearDynamics, Message, Observation, Observed,
    Sensing, SensorNode,
};
use fewbits_filters::{assumed_density, kalman};
use fewbits_numerics::ArgumentError;
use fewbits_protocol::BoxError;
use nalgebra::Vector1;
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Sensors that each follow their own measurements by `fewbits_adaptive`, knowing no model and told nothing, and a centre that
/// knows one: the reconstruction `v` says that the measurement lies in `[v - delta, v + delta)`, silence included.
///
/// While a receiver is out of step with its sensor, its reconstructions say nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Followers<G, S, const D: usize> {
    /// How the world moves.
    pub dynamics: G,
    /// How each sensor senses it.
    pub sensors: Vec<S>,
    /// Variance of their noise.
    pub noise_variance: f64,
    /// What all sensors and receivers agree on.
    pub config: Config,
    /// What is known before the first slot.
    pub start: Gaussian<D>,
}

impl<G, S, const D: usize> Followers<G, S, D> {
    /// Makes the half of a sensor.
    pub fn nodes(&self) -> impl Fn(usize) -> Box<dyn SensorNode<1>> + Clone + Send + Sync + use<G, S, D> {
        let config = self.config;
        move |_| Box::new(FollowedNode(Sensor::new(config)))
    }
}

/// What the centre of [`Followers`] knows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Followed<const D: usize> {
    /// The receivers' halves of the adaptive encoders, one for each sensor.
    pub receivers: Vec<Receiver>,
    state: Gaussian<D>,
}

fn invalid(error: impl std::fmt::Display) -> CodecError {
    CodecError::Invalid {
        what: "receivers",
        value: error.to_string(),
        expected: "one receiver for each sensor, of the agreed configuration",
    }
}

/// CBOR to the end of the bits.
impl<const D: usize> Message for Followed<D> {
    /// Number of sensors, and what they agree on.
    type Format = (usize, Config);

    fn encode(&self, _: &Self::Format, writer: &mut BitWriter) -> Result<(), CodecError> {
        let mut stored = Vec::new();
        ciborium::into_writer(self, &mut stored).map_err(invalid)?;
        stored.iter().try_for_each(|byte| writer.write(u64::from(*byte), 8))
    }

    fn decode((sensors, config): &Self::Format, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let mut stored = Vec::new();
        while reader.remaining() > 0 {
            stored.push(reader.read(8)? as u8);
        }
        let belief: Self = ciborium::from_reader(stored.as_slice()).map_err(invalid)?;
        if belief.receivers.len() != *sensors || belief.receivers.iter().any(|receiver| receiver.config() != config) {
            return Err(invalid(belief.receivers.len()));
        }
        Ok(belief)
    }
}

impl<G, S, const D: usize> Estimator for Followers<G, S, D>
where
    G: LinearDynamics<D>,
    S: Sensing<D, 1> + Clone,
{
    type Belief = Followed<D>;
    type Feedback = ();
    type Report = Packet;

    fn sensors(&self) -> usize {
        self.sensors.len()
    }

    fn start(&self) -> Followed<D> {
        Followed {
            receivers: vec![Receiver::new(self.config); self.sensors.len()],
            state: self.start,
        }
    }

    fn predict(&self, _: u64, belief: &Followed<D>) -> Result<Followed<D>, BoxError> {
        Ok(Followed {
            receivers: belief.receivers.clone(),
            state: kalman::predict(&self.dynamics, &belief.state),
        })
    }

    fn feedback(&self, _: &Followed<D>, _: usize) -> Result<(), BoxError> {
        Ok(())
    }

    fn update(
        &self,
        _: u64,
        predicted: &Followed<D>,
        observed: &[(usize, Observation<Packet>)],
    ) -> Result<Followed<D>, BoxError> {
        let mut belief = predicted.clone();
        for (i, (receiver, sensor)) in belief.receivers.iter_mut().zip(&self.sensors).enumerate() {
            let observation = observed.iter().find(|(at, _)| *at == i);
            // A packet that the sensor cannot have sent is one that was damaged.
            let tracked = receiver
                .receive(observation.map_or(&Observation::Lost, |(_, observation)| observation))
                .or_else(|_| receiver.receive(&Observation::Lost))?;
            let (Some(value), true) = (tracked.value, tracked.synchronised) else {
                continue;
            };
            let cell = Cell::new(value - self.config.delta(), value + self.config.delta())?;
            let observed = Observed::new(sensor.clone(), Levels::new(cell, self.noise_variance, 0.0, 1.0)?);
            belief.state = assumed_density::update_through(&belief.state, &observed)?.0;
        }
        Ok(belief)
    }

    fn estimate(&self, belief: &Followed<D>) -> Vec<(f64, f64)> {
        moments(&belief.state)
    }

    fn belief_format(&self) -> (usize, Config) {
        (self.sensors.len(), self.config)
    }

    fn feedback_format(&self, _: usize) {}

    fn report_format(&self, _: usize) {}
}

/// A sensor of [`Followers`].
struct FollowedNode(Sensor);

impl SensorNode<1> for FollowedNode {
    fn report(
        &mut self,
        _: &mut dyn Rng,
        measurement: &Vector1<f64>,
        _: &BitString,
    ) -> Result<Option<BitString>, fewbits_core::Error> {
        let refused =
            |error: &dyn std::fmt::Display| ArgumentError::new("measurement", measurement[0], error.to_string());
        let report = self.0.encode(measurement[0]).map_err(|error| refused(&error))?;
        let bits = report.map(|report| report.packet.to_bits(&())).transpose();
        Ok(bits.map_err(|error| refused(&error))?)
    }

    fn stored(&self) -> Option<BitString> {
        let mut bytes = Vec::new();
        ciborium::into_writer(&self.0, &mut bytes).ok()?;
        let bits = 8 * bytes.len();
        BitString::from_bytes(bytes, bits).ok()
    }

    fn restore(&mut self, memory: &BitString) -> Result<(), fewbits_core::Error> {
        let sensor = ciborium::from_reader(memory.bytes());
        self.0 = sensor.map_err(|error| ArgumentError::new("memory", error, "a stored adaptive sensor"))?;
        Ok(())
    }
}
