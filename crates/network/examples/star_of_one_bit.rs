//! Four one-bit sensors over a radio that loses a frame in ten: error, bits, joules, days.

use fewbits_core::{Belief, Dynamics, Gaussian, SchemeNode, Sensing, SensorNode};
use fewbits_dymbo::{CountFusion, ParallelEstimator, ParallelFilter, ScalarPlant};
use fewbits_monte_carlo::Stream;
use fewbits_network::{BitStar, Channel, Check, Clock, Radio, Seconds, Setup};
use fewbits_protocol::{Feedback, OverBits, ReportLength};
use nalgebra::Vector1;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (plant, slots) = (ScalarPlant::new(0.95, 0.2, 1.0)?, 1000);
    let start = Gaussian::scalar(0.0, plant.dynamics().stationary_variance()?)?;
    let mut rng = Stream::new(1).rng();
    let mut state = start.sample(&mut rng);
    let (mut truths, mut measurements) = (Vec::new(), Vec::<Vec<Vector1<f64>>>::new());
    for _ in 0..slots {
        state = plant.dynamics().propagate(&mut rng, &state);
        truths.push(state[0]);
        measurements.push((0..4).map(|_| plant.sensor().sample(&mut rng, &state)).collect());
    }
    let channel = Channel::lossy(0.1)?;
    let link = channel.link(10.0, Some(144), Check::Whole)?; // what the filter knows of it
    let filter = ParallelFilter::new(plant, 4, CountFusion::Exact)?.with_link(link);
    let estimator = ParallelEstimator::new(filter, start)?;
    let scheme = estimator.scheme();
    let centre = move || Ok(OverBits::new(estimator.clone()));
    let node = move |_| -> Box<dyn SensorNode<1>> { Box::new(SchemeNode::new(scheme)) };
    let (clock, report) = (Clock::new(Seconds::new(0.1)?)?, ReportLength::Fixed(1));
    let star = BitStar::new(centre, Feedback::Echoed, report, node, measurements, clock, Stream::new(2))?;
    let setup = Setup {
        channel,
        ..Setup::new(Radio::cc2420(0.0)?, Stream::new(3))
    };
    let mut network = star.simulate(10.0, setup)?;
    network.run_until(clock.end(slots))?;
    let truths: Vec<Vec<f64>> = truths.into_iter().map(|x: f64| vec![x]).collect();
    println!("{}", network.summary().with_errors(&truths, &network.nodes()[0].means())?);
    Ok(())
}
