//! A Monte-Carlo estimate with its standard error, the same to the last bit on any number of threads.
//!
//! `cargo run --release -p fewbits-monte-carlo --example same_numbers_on_any_machine`

use fewbits_monte_carlo::{Moments, MonteCarlo, Stream};
use rand::RngExt;
use std::convert::Infallible;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let truth = std::f64::consts::FRAC_PI_4;
    for trials in [1_000, 10_000, 100_000] {
        // A stream belongs to what it is for, never to a thread.
        let run = MonteCarlo::new(Stream::new(1).named("quarter circle"), trials);
        let inside = run.fold(
            Moments::default,
            |sum, trial| {
                let mut rng = trial.stream.rng();
                let (x, y): (f64, f64) = (rng.random(), rng.random());
                sum.add(f64::from(u8::from(x * x + y * y < 1.0)));
                Ok::<_, Infallible>(())
            },
            |total, part| total.merge(&part),
        )?;
        let estimate = inside.estimate();
        let (error, z) = (inside.standard_error(), estimate.z_score(truth));
        println!("{trials:>7} trials: {:.6} +- {error:.6}, {z:+.2} standard errors off", inside.mean());
    }
    Ok(())
}
