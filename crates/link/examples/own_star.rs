//! A scheme of one's own over a topology of one's own with losses of one's own, and what it costs.

use fewbits_core::{Gaussian, Link, OnAxes, SchemeNode};
use fewbits_dymbo::SignBit;
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting};
use fewbits_link::FusionReceiver;
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_network::{BitStar, Clock, Field, Instant, Loss, Measurements, Radio, Seconds, SensorId, Setup};
use fewbits_protocol::{Feedback, ReportLength};
use nalgebra::Vector1;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scheme = SignBit::new(0.25)?; // any `Scheme`
    let centre = move || {
        let prior = Gaussian::scalar(0.0, 4.0)?;
        let mut centre =
            FusionCentre::new(&mut Stream::new(1).rng(), ContinuousLinear::random_walk(0.01)?, MomentFilter, &prior)?;
        for (number, loss) in [(0, 0.05), (1, 0.3)] {
            let sensing = OnAxes::<_, 1, 1>::new(LinearSensor::direct(0.25)?, [0])?;
            let ask = |_: &Gaussian<1>, predicted: &Gaussian<1>| predicted.mean()[0];
            centre.join(number, Reporting::new(sensing, scheme, Link::lossy(loss)?, ask))?;
        }
        Ok(FusionReceiver::new(centre, 1.0, Stream::new(2)))
    };
    let measured = Measurements::from_fn(500, |slot, sensor| {
        Some(Vector1::new((f64::from(slot) / 50.0).sin() + 0.1 * sensor as f64))
    });
    let clock = Clock::new(Seconds::new(1.0)?)?;
    let node = move |_| -> Box<dyn fewbits_core::SensorNode<1>> { Box::new(SchemeNode::new(scheme)) };
    let star = BitStar::new(centre, Feedback::Told, ReportLength::Fixed(1), node, measured, clock, Stream::new(3))?;
    let field = Field::star(2, 30.0)?; // or `Field::new` over positions of one's own
    let mut setup = Setup::new(Radio::cc2420(0.0)?, Stream::new(4));
    setup.link_loss.insert((SensorId(2), SensorId(0)), Loss::Fixed(0.3));
    let mut network = star.simulate_on(field, setup)?;
    network.run_until(Instant(501_000_000_000))?;
    println!("{}{:?}", network.summary(), network.nodes()[0].estimates().last());
    Ok(())
}
