//! A centre is stored as bytes in the middle of a run; its copy goes on with the same bits.
use fewbits_core::{Belief, FullValue, Gaussian, Link, SchemeNode, SensorNode};
use fewbits_filters::centre::{CentreState, FusionCentre, Reporting, Slot};
use fewbits_filters::{BootstrapFilter, ResamplingRule};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use rand::Rng;

type Centre = FusionCentre<1, BootstrapFilter<1>>;

fn seated(rng: &mut dyn Rng) -> Result<Centre, Box<dyn std::error::Error>> {
    let world = ContinuousLinear::ornstein_uhlenbeck(0.0, 10.0, 4.0)?;
    let filter = BootstrapFilter::new(ResamplingRule::default(), 500)?;
    let mut centre = FusionCentre::new(rng, world, filter, &Gaussian::scalar(0.0, 4.0)?)?;
    centre.join(0, Reporting::values(LinearSensor::direct(0.5)?, FullValue::new(0.5)?, Link::PERFECT))?;
    Ok(centre)
}

fn step(centre: &mut Centre, rng: &mut dyn Rng) -> Result<f64, Box<dyn std::error::Error>> {
    let time = centre.time() + 1.0;
    let feedback = centre.advance(rng, time)?.feedback(0)?;
    let sample = [(0.3 * time).sin()].into();
    let report = SchemeNode::new(FullValue::new(0.5)?).report(rng, &sample, &feedback)?;
    centre.receive(rng, &[Slot::new(0, feedback, report.into())])?;
    Ok(centre.belief().mean()[0])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Stream::new(1).rng();
    let mut first = seated(&mut rng)?;
    (0..50).try_for_each(|_| step(&mut first, &mut rng).map(drop))?;
    let (bytes, stream) = (first.state().to_bytes()?, serde_json::to_string(&rng)?); // what is stored
    let (mut second, mut same) = (seated(&mut Stream::new(2).rng())?, serde_json::from_str(&stream)?);
    let _: &mut rand_pcg::Pcg64Dxsm = &mut same;
    second.restore(CentreState::from_bytes(&bytes)?)?;
    let goes_on = (0..50).all(|_| matches!((step(&mut first, &mut rng), step(&mut second, &mut same)), (Ok(a), Ok(b)) if a.to_bits() == b.to_bits()));
    println!("{} bytes; goes on with the same bits: {goes_on}", bytes.len());
    Ok(())
}
