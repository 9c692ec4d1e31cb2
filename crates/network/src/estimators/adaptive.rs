//! Signals followed within a guaranteed error, and a filter of what they measure.

use crate::error::Error;
use crate::estimator::{Estimator, Replicable, ReportEnd, gaussian_bits, gaussian_of};
use fewbits_adaptive::{Config, Packet, Receiver, Sensor};
use fewbits_core::factor::InCell;
use fewbits_core::{BitReader, BitString, BitWriter, Cell, CodecError, Gaussian, LinearDynamics, Observation, Sensing};
use fewbits_filters::{assumed_density, kalman};
use nalgebra::Vector1;
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};

/// Sensors that each follow their own measurements by [`fewbits_adaptive`], knowing no model and told nothing, and a centre that
/// knows one: the reconstruction `v` says that the measurement lies in `[v - delta, v + delta)`, silence included.
///
/// Packets do not say where they end, their frames do: an echo of several packets has a length before each
/// ([`ReportEnd::OfMessage`]).
///
/// While a receiver is out of step with its sensor, its reconstructions say nothing. Over links that lose packets, take a
/// [`Config::resilient`].
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

/// What the centre of [`Followers`] knows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Followed<const D: usize> {
    receivers: Vec<Receiver>,
    state: Gaussian<D>,
}

impl<const D: usize> Followed<D> {
    /// The receivers, sensor by sensor.
    pub fn receivers(&self) -> &[Receiver] {
        &self.receivers
    }

    /// The belief about the state.
    pub fn state(&self) -> &Gaussian<D> {
        &self.state
    }
}

impl<G, S, const D: usize> Estimator for Followers<G, S, D>
where
    G: LinearDynamics<D>,
    S: Sensing<D, 1> + Clone,
{
    type Belief = Followed<D>;
    type Measurement = Vector1<f64>;
    type Question = ();
    type Report = Packet;
    type Memory = Sensor;

    fn sensors(&self) -> usize {
        self.sensors.len()
    }

    fn start(&self) -> Followed<D> {
        Followed {
            receivers: vec![Receiver::new(self.config); self.sensors.len()],
            state: self.start,
        }
    }

    fn memory(&self, _: usize) -> Sensor {
        Sensor::new(self.config)
    }

    fn predict(&self, _: &mut Pcg64Dxsm, _: u32, belief: &Followed<D>) -> Result<Followed<D>, Error> {
        Ok(Followed {
            receivers: belief.receivers.clone(),
            state: kalman::predict(&self.dynamics, &belief.state),
        })
    }

    fn question(&self, _: u32, _: &Followed<D>, _: usize) -> Result<(), Error> {
        Ok(())
    }

    fn question_format(&self, _: usize) {}

    fn report_format(&self, _: usize) {}

    fn report_end(&self) -> ReportEnd {
        ReportEnd::OfMessage
    }

    fn report(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        _: usize,
        memory: &mut Sensor,
        measurement: &Vector1<f64>,
        (): &(),
    ) -> Result<Option<Packet>, Error> {
        let report = memory
            .encode(measurement[0])
            .map_err(|error| Error::estimator("adaptive", error))?;
        Ok(report.map(|report| report.packet))
    }

    fn update(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        predicted: &Followed<D>,
        observations: &[Option<Observation<Packet>>],
    ) -> Result<Followed<D>, Error> {
        let mut belief = predicted.clone();
        for ((receiver, sensor), observation) in belief.receivers.iter_mut().zip(&self.sensors).zip(observations) {
            // A packet that the sensor cannot have sent is one that was damaged.
            let tracked = receiver
                .receive(observation.as_ref().unwrap_or(&Observation::Lost))
                .or_else(|_| receiver.receive(&Observation::Lost))
                .map_err(|error| Error::estimator("adaptive", error))?;
            let (Some(value), true) = (tracked.value, tracked.synchronised) else {
                continue;
            };
            let cell = Cell::new(value - self.config.delta(), value + self.config.delta())?;
            let factor = InCell::new(cell, self.noise_variance, 0.0, 1.0)?;
            let observed = fewbits_core::Observed::new(sensor.clone(), factor);
            belief.state = assumed_density::update_through(&belief.state, &observed)?.0;
        }
        Ok(belief)
    }

    fn mean(&self, belief: &Followed<D>) -> Vec<f64> {
        belief.state.mean().as_slice().to_vec()
    }
}

impl<G, S, const D: usize> Replicable for Followers<G, S, D>
where
    G: LinearDynamics<D>,
    S: Sensing<D, 1> + Clone,
{
    fn belief_bits(&self, belief: &Followed<D>) -> Result<BitString, Error> {
        let (mut writer, mut stored) = (BitWriter::new(), Vec::new());
        gaussian_bits(&belief.state, &mut writer)?;
        ciborium::into_writer(&belief.receivers, &mut stored).map_err(|error| Error::estimator("adaptive", error))?;
        stored.iter().try_for_each(|byte| writer.write(u64::from(*byte), 8))?;
        Ok(writer.finish())
    }

    fn belief_of(&self, bits: &BitString) -> Result<Followed<D>, Error> {
        let mut reader = BitReader::new(bits);
        let state = gaussian_of(&mut reader)?;
        let mut stored = Vec::new();
        while reader.remaining() > 0 {
            stored.push(reader.read(8)? as u8);
        }
        let receivers: Vec<Receiver> =
            ciborium::from_reader(stored.as_slice()).map_err(|error| Error::estimator("adaptive", error))?;
        if receivers.len() != self.sensors.len() || receivers.iter().any(|receiver| *receiver.config() != self.config) {
            let expected = "one receiver for each sensor, of the agreed configuration";
            return Err(CodecError::Invalid {
                what: "receivers",
                value: receivers.len().to_string(),
                expected,
            }
            .into());
        }
        Ok(Followed { receivers, state })
    }
}
