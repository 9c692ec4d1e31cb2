//! Ten signals followed by the adaptive codec, and their average.

use crate::world::SENSORS;
use fewbits_adaptive::{Config, Packet, Receiver, Sensor};
use fewbits_baselines::over_bits::Estimator;
use fewbits_core::{BitReader, BitString, BitWriter, CodecError, Error, Message, Observation, SensorNode};
use fewbits_protocol::BoxError;
use nalgebra::Vector1;
use rand::Rng;

const DELTA: f64 = 0.5;

fn config() -> Config {
    Config::new(DELTA).and_then(|c| c.resilient(4, Some(4))).unwrap()
}

/// The average of the reconstructions of sensors that are in step.
#[derive(Clone)]
pub struct Average;

#[derive(Clone)]
pub struct Followed(Vec<Receiver>);

/// As JSON, to the end of the bits.
impl Message for Followed {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        let bytes = serde_json::to_vec(&self.0).unwrap();
        bytes.iter().try_for_each(|byte| writer.write(u64::from(*byte), 8))
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let mut bytes = Vec::new();
        while reader.remaining() > 0 {
            bytes.push(reader.read(8)? as u8);
        }
        let what = "receivers";
        let expected = "stored receivers";
        serde_json::from_slice(&bytes)
            .map(Self)
            .map_err(|error| CodecError::Invalid {
                what,
                value: error.to_string(),
                expected,
            })
    }
}

impl Estimator for Average {
    type Belief = Followed;
    type Feedback = ();
    type Report = Packet;

    fn sensors(&self) -> usize {
        SENSORS as usize
    }
    fn start(&self) -> Followed {
        Followed(vec![Receiver::new(config()); SENSORS as usize])
    }
    fn predict(&self, _: u64, belief: &Followed) -> Result<Followed, BoxError> {
        Ok(belief.clone())
    }
    fn feedback(&self, _: &Followed, _: usize) -> Result<(), BoxError> {
        Ok(())
    }
    fn update(
        &self,
        _: u64,
        predicted: &Followed,
        observed: &[(usize, Observation<Packet>)],
    ) -> Result<Followed, BoxError> {
        let mut belief = predicted.clone();
        for (i, receiver) in belief.0.iter_mut().enumerate() {
            let observation = observed.iter().find(|(at, _)| *at == i);
            let observation = observation.map_or(&Observation::Lost, |(_, observation)| observation);
            if receiver.receive(observation).is_err() {
                receiver.receive(&Observation::Lost)?;
            }
        }
        Ok(belief)
    }
    fn estimate(&self, belief: &Followed) -> Vec<(f64, f64)> {
        let tracked = belief
            .0
            .iter()
            .map(Receiver::tracked)
            .filter(|tracked| tracked.synchronised);
        let values: Vec<f64> = tracked.filter_map(|tracked| tracked.value).collect();
        vec![(values.iter().sum::<f64>() / values.len().max(1) as f64, values.len() as f64)]
    }
    fn belief_format(&self) {}
    fn feedback_format(&self, _: usize) {}
    fn report_format(&self, _: usize) {}
}

struct Node(Sensor);

pub fn node() -> impl SensorNode<1> {
    Node(Sensor::new(config()))
}

impl SensorNode<1> for Node {
    fn report(
        &mut self,
        _: &mut dyn Rng,
        measurement: &Vector1<f64>,
        _: &BitString,
    ) -> Result<Option<BitString>, Error> {
        let report = self.0.encode(measurement[0]).unwrap();
        Ok(report.map(|report| report.packet.to_bits(&()).unwrap()))
    }
}
