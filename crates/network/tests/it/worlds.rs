//! Truths and measurements, the same for an estimator alone and over a network.

use fewbits_core::factor::{Constant, Partition, Scalar};
use fewbits_core::{Dynamics, Error, Gaussian, Link, NumberFormat, Observation, Scheme, Sensing, Sign};
use fewbits_dymbo::{CountFusion, ParallelFilter, ScalarPlant};
use fewbits_models::{Ar1, LinearSensor, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use fewbits_network::estimators::ParallelDymboEstimator;
use fewbits_network::{Clock, Radio, Seconds, Setup};
use nalgebra::{Matrix4, Vector1, Vector4};
use rand::Rng;

pub fn plant() -> ScalarPlant {
    ScalarPlant::new(0.9, 0.5, 1.0).unwrap()
}

pub fn start() -> Gaussian<1> {
    Gaussian::scalar(0.0, plant().dynamics().stationary_variance().unwrap()).unwrap()
}

/// Measurements of `sensors` sensors in `slots` slots of the scalar world.
pub fn scalar(sensors: usize, slots: usize, seed: u64) -> Vec<Vec<Vector1<f64>>> {
    let (dynamics, sensor) = (Ar1::new(0.9, 0.5).unwrap(), LinearSensor::direct(1.0).unwrap());
    let mut rng = Stream::new(seed).rng();
    let mut state = Vector1::new(1.0);
    (0..slots)
        .map(|_| {
            state = dynamics.propagate(&mut rng, &state);
            (0..sensors).map(|_| sensor.sample(&mut rng, &state)).collect()
        })
        .collect()
}

pub fn plane_sensors() -> Vec<LinearSensor<4, 1>> {
    let along = [Vector4::new(1.0, 0.0, 0.0, 0.0), Vector4::new(0.0, 0.0, 1.0, 0.0)];
    [0, 1, 0, 1]
        .map(|axis| LinearSensor::scalar(along[axis], 1.0).unwrap())
        .to_vec()
}

pub fn plane_start() -> Gaussian<4> {
    Gaussian::new(Vector4::new(0.0, 1.0, 0.0, -1.0), Matrix4::identity() * 0.5).unwrap()
}

/// Measurements of the sensors of a target in the plane.
pub fn plane(slots: usize) -> Vec<Vec<Vector1<f64>>> {
    let dynamics = constant_velocity_2d(1.0, 0.05).unwrap();
    let mut rng = Stream::new(5).rng();
    let mut state = *plane_start().mean();
    (0..slots)
        .map(|_| {
            state = dynamics.propagate(&mut rng, &state);
            plane_sensors()
                .iter()
                .map(|sensor| sensor.sample(&mut rng, &state))
                .collect()
        })
        .collect()
}

pub fn clock() -> Clock {
    Clock::new(Seconds::new(1.0).unwrap()).unwrap()
}

pub fn setup(seed: u64) -> Setup {
    Setup::new(Radio::cc2420(0.0).unwrap(), Stream::new(seed).named("network"))
}

/// Three one-bit sensors over a link that is known to be faulty.
pub fn counted(link: Link) -> ParallelDymboEstimator {
    let filter = ParallelFilter::new(plant(), 3, CountFusion::Linear)
        .unwrap()
        .with_link(link);
    ParallelDymboEstimator::new(filter, start()).unwrap()
}

/// The stranger's scheme of `docs/own-scheme.md`.
#[derive(Debug, Clone)]
pub struct TwoSided {
    pub reach: f64,
    pub noise_variance: f64,
}

impl Scheme<1> for TwoSided {
    type State = ();
    type Feedback = f64;
    type Report = Sign;
    type Factor = Scalar;

    fn start(&self) {}

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn report_format(&self) {}

    fn encode<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        (): &mut (),
        measurement: &Vector1<f64>,
        prediction: &f64,
    ) -> Result<Option<Sign>, Error> {
        Ok(Some(Sign::of((measurement[0] - prediction).abs(), self.reach)?))
    }

    fn factor(&self, prediction: &f64, observation: &Observation<Sign>, link: &Link) -> Result<Scalar, Error> {
        let received = match observation {
            Observation::Received(sign) => *sign,
            Observation::Nothing => return Ok(Constant::new(link.loss())?.into()),
            Observation::Lost => return Ok(Constant::ONE.into()),
        };
        let given = |sent: Sign| (1.0 - link.loss()) * link.word_probability(sent as u64, received as u64, 1);
        let edges = vec![prediction - self.reach, prediction + self.reach];
        let given_cell = [Sign::Above, Sign::Below, Sign::Above].map(given).to_vec();
        Ok(Partition::new(edges, given_cell, self.noise_variance)?.into())
    }
}
