//! Follows a drifting signal with one bit a sample over a link that inverts one bit in twenty and loses one in ten.
//!
//! ```text
//! cargo run -p fewbits-dymbo --example one_bit
//! ```

use fewbits_core::{Dynamics, Gaussian, Link, Sensing};
use fewbits_dymbo::{DymboFilter, ScalarFilter, ScalarPlant};
use rand::SeedableRng;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(4);
    let plant = ScalarPlant::new(0.99, 0.1, 1.0)?;
    let filter = DymboFilter::new(plant).with_link(Link::new(0.1, 0.05)?);

    let mut belief = Gaussian::scalar(0.0, plant.dynamics().stationary_variance()?)?;
    let mut state = [1.0].into();
    let (mut bits, mut squared_error) = (0, 0.0);
    for n in 1..=1000 {
        state = plant.dynamics().propagate(&mut rng, &state);
        let sample = plant.sensor().sample(&mut rng, &state);
        let (next, info) = filter.exchange(&mut rng, &belief, sample[0])?;
        belief = next;
        bits += info.bits;
        squared_error += (belief.mean()[0] - state[0]).powi(2);
        if n % 200 == 0 {
            println!(
                "{n:4}  truth {:6.2}  estimate {:6.2} +- {:.2}",
                state[0],
                belief.mean()[0],
                belief.covariance()[0].sqrt()
            );
        }
    }
    println!(
        "{bits} bits received, mean squared error {:.3} (Kalman filter {:.3})",
        squared_error / 1000.0,
        plant.steady_state(1.0)?.filtered_variance
    );
    Ok(())
}
