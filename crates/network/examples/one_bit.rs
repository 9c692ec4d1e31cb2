//! Four one-bit sensors over a radio that loses a frame in ten: error, bits, joules, days.

use fewbits_core::{Belief, Dynamics, Gaussian, Sensing};
use fewbits_dymbo::{CountFusion, ParallelFilter, ScalarPlant};
use fewbits_monte_carlo::Stream;
use fewbits_network::estimators::Counted;
use fewbits_network::{Channel, Check, Clock, Radio, Seconds, SensorId, Setup, Star};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (plant, slots) = (ScalarPlant::new(0.95, 0.2, 1.0)?, 1000);
    let start = Gaussian::scalar(0.0, plant.dynamics().stationary_variance()?)?;
    let mut rng = Stream::new(1).rng();
    let mut state = start.sample(&mut rng);
    let (mut truths, mut measurements) = (Vec::new(), Vec::new());
    for _ in 0..slots {
        state = plant.dynamics().propagate(&mut rng, &state);
        truths.push(state[0]);
        measurements.push((0..4).map(|_| plant.sensor().sample(&mut rng, &state)).collect());
    }
    let channel = Channel::lossy(0.1)?;
    let link = channel.link(10.0, Some(144), 81, Check::Whole)?; // what the filter knows of it
    let filter = ParallelFilter::new(plant, 4, CountFusion::Exact)?.with_link(link);
    let clock = Clock::new(Seconds::new(0.1)?)?;
    let star = Star::echoed(Counted::new(filter, start)?, measurements, clock, Stream::new(2))?;
    let setup = Setup {
        channel,
        ..Setup::new(Radio::cc2420(0.0)?, Stream::new(3))
    };
    let mut network = star.simulate(10.0, setup)?;
    network.run_until(clock.end(slots))?;
    let squares = truths
        .iter()
        .zip(network.nodes()[0].estimates())
        .map(|(x, e)| (x - e[0]).powi(2));
    let (books, sensor) =
        (network.ledger(), network.energy(SensorId(1))?.value() / network.now().since_start().value());
    println!(
        "RMSE {:.3}, of {} on air {} payload",
        (squares.sum::<f64>() / f64::from(slots)).sqrt(),
        books.messages().air,
        books.messages().payload
    );
    println!("{:?}; {:.1} days on two AA cells", books.faults(), 18_720.0 / sensor / 86_400.0);
    Ok(())
}
