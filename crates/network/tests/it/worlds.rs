//! Truths and measurements, the same for an estimator alone and over a network.

use fewbits_baselines::dymbo::centre::ParallelEstimator;
use fewbits_baselines::over_bits::{Estimator, OverBits, moments};
use fewbits_core::{
    Dynamics, FullValue, Gaussian, Link, NumberFormat, Observation, Observed, Scheme, SchemeNode, Sensing, SensorNode,
};
use fewbits_dymbo::{CountFusion, ParallelFilter, ScalarPlant};
use fewbits_filters::assumed_density;
use fewbits_models::{Ar1, LinearSensor, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use fewbits_network::{BitStar, Clock, Measurements, Radio, Seconds, Setup};
use fewbits_protocol::{BoxError, Feedback, ReportLength};
use nalgebra::{Matrix4, SVector, Vector1, Vector4};

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
pub type Counted = BitStar<OverBits<ParallelEstimator>, 1>;

pub fn counted(link: Link, feedback: Feedback, measurements: impl Into<Measurements<Vector1<f64>>>) -> Counted {
    let filter = ParallelFilter::new(plant(), 3, CountFusion::Linear).unwrap();
    let estimator = ParallelEstimator::new(filter.with_link(link), start()).unwrap();
    let nodes = each(estimator.scheme());
    star(estimator, feedback, ReportLength::Fixed(1), nodes, measurements)
}

/// The sensors' halves of a scheme.
pub fn each<C>(scheme: C) -> impl Fn(usize) -> Box<dyn SensorNode<1>> + Send + Sync + 'static
where
    C: Scheme<1> + Clone + Send + Sync + 'static,
    C::State: 'static,
{
    move |_| Box::new(SchemeNode::new(scheme.clone()))
}

pub fn star<E, const M: usize>(
    estimator: E,
    feedback: Feedback,
    report: ReportLength,
    node: impl Fn(usize) -> Box<dyn SensorNode<M>> + Send + Sync + 'static,
    measurements: impl Into<Measurements<SVector<f64, M>>>,
) -> BitStar<OverBits<E>, M>
where
    E: Estimator + Clone + Send + Sync + 'static,
{
    let centre = move || Ok(OverBits::new(estimator.clone()));
    BitStar::new(centre, feedback, report, node, measurements, clock(), Stream::new(1)).unwrap()
}

/// The Kalman filter of three sensors that send every measurement over a known link.
#[derive(Debug, Clone)]
pub struct AllSend(pub Link);

impl Estimator for AllSend {
    type Belief = Gaussian<1>;
    type Feedback = ();
    type Report = f64;

    fn sensors(&self) -> usize {
        3
    }
    fn start(&self) -> Gaussian<1> {
        start()
    }
    fn predict(&self, _: u64, belief: &Gaussian<1>) -> Result<Gaussian<1>, BoxError> {
        Ok(plant().predict(belief))
    }
    fn feedback(&self, _: &Gaussian<1>, _: usize) -> Result<(), BoxError> {
        Ok(())
    }
    fn update(
        &self,
        _: u64,
        predicted: &Gaussian<1>,
        observed: &[(usize, Observation<f64>)],
    ) -> Result<Gaussian<1>, BoxError> {
        let mut belief = *predicted;
        for (_, observation) in observed {
            let factor = FullValue::new(1.0)?.factor(&(), observation, &self.0)?;
            let observed = Observed::new(LinearSensor::<1, 1>::direct(1.0)?, factor);
            belief = assumed_density::update_through(&belief, &observed)?.0;
        }
        Ok(belief)
    }
    fn estimate(&self, belief: &Gaussian<1>) -> Vec<(f64, f64)> {
        moments(belief)
    }
    fn belief_format(&self) -> NumberFormat {
        NumberFormat::Double
    }
    fn feedback_format(&self, _: usize) {}
    fn report_format(&self, _: usize) -> NumberFormat {
        NumberFormat::Double
    }
}
