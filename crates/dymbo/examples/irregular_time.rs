//! One bit a sample at irregular times, of a signal about a mean whose variance was stated nine times too small: it is learnt.
use fewbits_core::{Belief, Evolution, Gaussian, Link, SchemeNode, Sensing, SensorNode};
use fewbits_dymbo::SignBit;
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, NoiseLearning, Reporting, Slot};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use rand::RngExt;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Stream::new(1).rng();
    // Mean 20, forgotten within 10 seconds, variance 9; the centre supposes a variance of 1.
    let world = ContinuousLinear::ornstein_uhlenbeck(20.0, 10.0, 9.0)?;
    let supposed = ContinuousLinear::ornstein_uhlenbeck(20.0, 10.0, 1.0)?;
    let (prior, sensing, scheme) = (Gaussian::scalar(20.0, 9.0)?, LinearSensor::direct(0.5)?, SignBit::new(0.5)?);
    let centre = FusionCentre::new(&mut rng, supposed, MomentFilter, &prior)?;
    let mut centre = centre.learning_noise(NoiseLearning::DEFAULT)?;
    let threshold = |_: &Gaussian<1>, m: &Gaussian<1>| m.mean()[0];
    centre.join(0, Reporting::new(sensing, scheme, Link::PERFECT, threshold))?;
    let (mut node, mut truth, mut squares) = (SchemeNode::new(scheme), prior.sample(&mut rng), 0.0);
    for k in 0..2000 {
        let seconds = rng.random_range(0.1..2.0);
        truth = Evolution::over(&world, seconds)?.propagate(&mut rng, &truth);
        let time = centre.time() + seconds;
        let feedback = centre.advance(&mut rng, time)?.feedback(0)?;
        let sample = sensing.sample(&mut rng, &truth);
        let report = node.report(&mut rng, &sample, &feedback)?;
        centre.receive(&mut rng, &[Slot::new(0, feedback, report.into())])?;
        if k >= 1000 {
            squares += (centre.estimate().mean()[0] - truth[0]).powi(2) / 1000.0;
        }
    }
    println!(
        "RMS error {:.2}, process noise learnt: {:.1} times what was stated",
        squares.sqrt(),
        centre.noise_scale()
    );
    Ok(())
}
