//! A scheme of one's own over a topology of one's own with losses of one's own, and what it costs.

use fewbits_core::{Gaussian, Link};
use fewbits_dymbo::SignBit;
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting};
use fewbits_link::FusionReceiver;
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_network::{BitStar, Clock, Field, Loss, Measurements, Radio, Seconds, SensorId, Setup};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scheme = SignBit::new(0.25)?; // any `Scheme`
    let centre = move || {
        let (world, prior) = (ContinuousLinear::random_walk(0.01)?, Gaussian::scalar(0.0, 4.0)?);
        let mut centre = FusionCentre::new(&mut Stream::new(1).rng(), world, MomentFilter, &prior)?;
        for (number, loss) in [(0, 0.05), (1, 0.05), (2, 0.3)] {
            let told = |_: &Gaussian<1>, measured: &Gaussian<1>| measured.mean()[0];
            centre.join(number, Reporting::new(LinearSensor::direct(0.25)?, scheme, Link::lossy(loss)?, told))?;
        }
        Ok(FusionReceiver::new(centre, 1.0, Stream::new(2)))
    };
    let wave = |slot: u32, sensor: usize| (f64::from(slot) / 50.0).sin() + 0.1 * sensor as f64;
    let measured = Measurements::from_fn(500, move |slot, sensor| Some([wave(slot, sensor)].into()));
    let clock = Clock::new(Seconds::new(1.0)?)?;
    let star = BitStar::of_scheme(centre, scheme, measured, clock, Stream::new(3))?.relaying();
    let links = Field::from_csv("0,1,30\n0,2,30\n1,3,45")?; // the third sensor reports through the first
    let mut setup = Setup::new(Radio::cc2420(0.0)?, Stream::new(4));
    setup.link_loss.insert((SensorId(3), SensorId(1)), Loss::Fixed(0.3));
    let mut network = star.simulate_on(links, setup)?;
    network.run_until(clock.end(500))?;
    println!("{}\n{:?}", network.summary(), network.nodes()[0].means().last());
    Ok(())
}
