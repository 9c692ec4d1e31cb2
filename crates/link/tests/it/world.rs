//! A world of ten sensors of a scalar, and their centre.

use fewbits_baselines::dymbo::centre::ParallelEstimator;
use fewbits_baselines::over_bits::OverBits;
use fewbits_cfwmd::scheme::CovarianceFeedback;
use fewbits_core::{BitString, Gaussian, Link, NumberFormat, Observation, SchemeNode, SensorNode};
use fewbits_dymbo::{CountFusion, ParallelFilter, ScalarPlant, SignBit};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting};
use fewbits_link::{FusionReceiver, Key, Peer, Step};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{CentreSettings, Feedback, Member, Receiver, ReportLength, Schedule, update_asked};
use nalgebra::Vector1;
use std::num::NonZeroU64;

pub const SENSORS: u32 = 10;

/// How the ten report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reports {
    /// The sign of the innovation: Dymbo.
    Signs,
    /// The value if it is far enough from the prediction: CFwMD.
    Censored,
    /// The sign of the innovation, of four sensors that are fused together: Dymbo with K = 4.
    Counted,
    /// The measurement within half a unit, by sensors that know no model: the adaptive codec.
    Followed,
}

impl Reports {
    pub fn sensors(self) -> u32 {
        if self == Self::Counted { 4 } else { SENSORS }
    }
}

pub fn receiver(reports: Reports, loss: f64) -> Box<dyn Receiver> {
    match reports {
        Reports::Signs | Reports::Censored => Box::new(mixed(reports, loss)),
        Reports::Counted => {
            let plant = ScalarPlant::new(0.95, 0.975, 1.0).unwrap();
            let filter = ParallelFilter::new(plant, 4, CountFusion::Exact).unwrap();
            let filter = filter.with_link(Link::lossy(loss).unwrap());
            let prior = Gaussian::scalar(0.0, 10.0).unwrap();
            Box::new(OverBits::new(ParallelEstimator::new(filter, prior).unwrap()))
        }
        Reports::Followed => Box::new(OverBits::new(crate::followed::Average)),
    }
}

pub fn mixed(reports: Reports, loss: f64) -> FusionReceiver<1, MomentFilter> {
    let model = ContinuousLinear::ornstein_uhlenbeck(0.0, 20.0, 10.0).unwrap();
    let sensing = LinearSensor::direct(1.0).unwrap();
    let prior = Gaussian::scalar(0.0, 10.0).unwrap();
    let mut centre = FusionCentre::new(&mut Stream::new(1).rng(), model, MomentFilter, &prior).unwrap();
    let link = Link::lossy(loss).unwrap();
    for number in 0..SENSORS {
        match reports {
            Reports::Signs => {
                let ask = |_: &Gaussian<1>, m: &Gaussian<1>| m.mean()[0];
                centre.join(number, Reporting::new(sensing, SignBit::new(1.0).unwrap(), link, ask))
            }
            _ => {
                let ask = |state: &Gaussian<1>, _: &Gaussian<1>| *state;
                centre.join(number, Reporting::new(sensing, censored(), link, ask))
            }
        }
        .unwrap();
    }
    FusionReceiver::new(centre, 1.0, Stream::new(2))
}

fn censored() -> CovarianceFeedback<LinearSensor<1, 1>, 1, 1> {
    CovarianceFeedback::new(LinearSensor::direct(1.0).unwrap(), 1.0, NumberFormat::Double).unwrap()
}

pub fn node(reports: Reports) -> Box<dyn SensorNode<1> + Send> {
    match reports {
        Reports::Signs | Reports::Counted => Box::new(SchemeNode::new(SignBit::new(1.0).unwrap())),
        Reports::Followed => Box::new(crate::followed::node()),
        Reports::Censored => Box::new(SchemeNode::new(censored())),
    }
}

/// What a sensor measures in a slot: the same whoever asks.
pub fn measurement(sensor: u32, slot: u32) -> Vector1<f64> {
    let noise: f64 = {
        use rand_distr::Distribution;
        let mut rng = Stream::new(3).indexed(u64::from(sensor)).indexed(u64::from(slot)).rng();
        rand_distr::StandardNormal.sample(&mut rng)
    };
    Vector1::new(3.0 * (f64::from(slot % 10_000) / 15.0).sin() + noise)
}

pub fn settings(reports: Reports, period: u64, sensors: usize) -> CentreSettings {
    let report = match reports {
        Reports::Signs | Reports::Counted => ReportLength::Fixed(1),
        Reports::Censored | Reports::Followed => ReportLength::Varying,
    };
    let member = Member {
        feedback: Feedback::Told,
        report,
    };
    CentreSettings::new(vec![member; sensors], Schedule::new(NonZeroU64::new(period).unwrap()))
}

pub fn key(number: u32) -> Key {
    let mut bytes = [0x42; 32];
    bytes[..4].copy_from_slice(&number.to_be_bytes());
    Key::new(&bytes).unwrap()
}

pub fn peers(sensors: u32) -> Vec<Peer> {
    (0..sensors)
        .map(|number| Peer {
            number,
            key: key(number),
            address: None,
        })
        .collect()
}

/// A slot: what was observed, and the estimate.
pub type Record = (u64, Vec<Observation<BitString>>, Vec<(f64, f64)>);

/// What a receiver that was never stopped makes of the same observations: to the bit.
pub fn assert_replayed(receiver: &mut dyn Receiver, steps: &[Step]) {
    for step in steps {
        receiver.predict(step.slot).unwrap();
        update_asked(receiver, step.observed_when_asked());
        assert_eq!(receiver.estimate(), step.estimate, "slot {}", step.slot);
    }
}
