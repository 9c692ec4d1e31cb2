//! Ten sensors send only what surprises. Eight of them die; the centre stops believing their silence.
use fewbits_cfwmd::scheme::CovarianceFeedback;
use fewbits_core::{Belief, Evolution, Gaussian, Link, NumberFormat, SchemeNode, Sensing, SensorNode};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use rand::RngExt;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Stream::new(1).rng();
    let world = ContinuousLinear::ornstein_uhlenbeck(0.0, 20.0, 10.0)?; // mean, seconds, variance
    let (prior, sensing) = (Gaussian::scalar(0.0, 10.0)?, LinearSensor::direct(1.0)?);
    let scheme = CovarianceFeedback::new(sensing, 1.0, NumberFormat::Double)?;
    let mut centre = FusionCentre::new(&mut rng, world, MomentFilter, &prior)?;
    for number in 0..10 {
        let ask = |state: &Gaussian<1>, _: &Gaussian<1>| *state;
        centre.join(number, Reporting::new(sensing, scheme.clone(), Link::lossy(0.2)?, ask))?;
    }
    let (mut node, mut truth, mut nees) = (SchemeNode::new(scheme), prior.sample(&mut rng), 0.0);
    for k in 1..=300_u32 {
        truth = Evolution::over(&world, 1.0)?.propagate(&mut rng, &truth);
        centre.advance(&mut rng, k.into())?;
        let mut slots = Vec::new();
        for number in 0..10 {
            let (feedback, sample) = (centre.feedback(number)?, sensing.sample(&mut rng, &truth));
            let report = node.report(&mut rng, &sample, &feedback)?;
            let arrives = (number >= 8 || k <= 100) && rng.random_bool(0.8);
            slots.push(Slot::new(number, feedback, report.filter(|_| arrives).into()));
        }
        for event in centre.receive(&mut rng, &slots)?.events {
            println!("{k:4} s: {event:?}");
        }
        nees += centre.estimate().normalised_error_squared(&truth)? / 300.0;
    }
    println!("NEES {nees:.2}");
    Ok(())
}
