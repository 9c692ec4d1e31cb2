//! What one bit says about a number, over links of falling quality.
//!
//! `cargo run -p fewbits-core --example what_a_bit_is_worth`

use fewbits_core::factor::{Factor, Levels};
use fewbits_core::{Gaussian, Link, Message, Sign};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let prior = Gaussian::scalar(0.0, 1.0)?;
    let bit = Sign::of(0.8, 0.0)?;
    println!("a report of {} bit; the variance was 1", bit.to_bits(&())?.bits());
    for crossover in [0.0, 0.05, 0.2, 0.5] {
        let factor = Levels::sign(bit, 0.0, 0.25, &Link::flipping(crossover)?)?;
        let posterior = factor.tilted(&prior)?;
        println!(
            "inverted with probability {crossover:4}: mean {:6.3}, variance {:6.3}, probability {:.2}",
            posterior.mean[0],
            posterior.covariance[0],
            posterior.log_evidence.exp()
        );
    }
    Ok(())
}
