//! Five sensors send two bits each per step; a grid of 15 x 15 follows the target.

use fewbits_core::Gaussian;
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{Encoder, GridFilter, Network, QuantizedRange, RangeNoise, Reports, Target, Tracker};
use nalgebra::{Matrix4, Vector2, Vector4};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let target = Target::printed()?; // one step a second, manoeuvres of 0.1
    let scheme = QuantizedRange::new(4, RangeNoise::from_snr_db(50.0)?)?;
    let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]].map(Vector2::from);
    // Cells as wide as the innovation: every node computes them, no bit is spent on it.
    let network = Network::new(&places, scheme, Encoder::adaptive(4)?)?;

    let covariance = Matrix4::from_diagonal(&Vector4::new(0.04, 0.04, 0.01, 0.01));
    let mut belief = Gaussian::new(Vector4::new(13.0, 17.0, 0.0, -0.6), covariance)?;
    let (mut rng, tracker) = (Stream::new(1).rng(), GridFilter::default());
    let mut squares = 0.0;
    for (k, truth) in target
        .simulate(&mut rng, &Vector4::new(13.0, 17.0, 0.0, -0.6), 25)
        .iter()
        .enumerate()
    {
        let ranges = network.measure(&mut rng, truth[0], truth[1]);
        let observed = network.observe(&target, k, &belief, &ranges, Reports::Levels)?;
        belief = tracker.step(&mut rng, &target, k, &belief, &observed)?.0;
        squares += ((belief.mean()[0] - truth[0]).powi(2) + (belief.mean()[1] - truth[1]).powi(2)) / 25.0;
    }
    println!("{} bits a step, RMS position error {:.3}", network.report_bits(), squares.sqrt());
    assert!(squares < 0.03);
    Ok(())
}
