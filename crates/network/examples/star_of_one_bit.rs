//! Four one-bit sensors over a radio that loses a frame in ten: error, bits, joules, days.

use fewbits_core::{Belief, Dynamics, Gaussian, Sensing};
use fewbits_dymbo::SignBit;
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting};
use fewbits_link::FusionReceiver;
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_network::{BitStar, Channel, Check, Clock, Radio, Seconds, Setup};
use nalgebra::Vector1;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The state forgets its past within 20 slots; its stationary deviation is 1.4.
    let (world, sensor) = (ContinuousLinear::ornstein_uhlenbeck(0.0, 20.0, 1.4)?, LinearSensor::direct(1.0)?);
    let (period, slots) = (1.0, 1000);
    let start = Gaussian::scalar(0.0, 1.4 * 1.4)?;
    let mut rng = Stream::new(1).rng();
    let mut state = start.sample(&mut rng);
    let (mut truths, mut measurements) = (Vec::new(), Vec::<Vec<Vector1<f64>>>::new());
    for _ in 0..slots {
        state = world.over(period)?.propagate(&mut rng, &state);
        truths.push(state[0]);
        measurements.push((0..4).map(|_| sensor.sample(&mut rng, &state)).collect());
    }
    let channel = Channel::lossy(0.1)?;
    let link = channel.link(10.0, Some(144), Check::Whole)?; // what the filter knows of it
    let scheme = SignBit::new(1.0)?;
    let centre = move || {
        let mut centre = FusionCentre::new(&mut Stream::new(4).rng(), world, MomentFilter, &start)?;
        for number in 0..4 {
            let told = |_: &Gaussian<1>, measured: &Gaussian<1>| measured.mean()[0];
            centre.join(number, Reporting::new(sensor, scheme, link, told))?;
        }
        Ok(FusionReceiver::new(centre, period, Stream::new(5)))
    };
    let clock = Clock::new(Seconds::new(period)?)?;
    let star = BitStar::of_scheme(centre, scheme, measurements, clock, Stream::new(2))?;
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
