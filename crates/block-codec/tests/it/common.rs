//! Signals with the traits of recordings.

use fewbits_monte_carlo::Stream;
use rand::RngExt;
use rand_distr::StandardNormal;

/// A random walk with rests, bursts, spikes and an instrument's steps.
pub fn mixed(seed: u64, n: usize) -> Vec<f64> {
    let mut rng = Stream::new(seed).rng();
    let (mut x, mut v, mut kind) = (20.0, 0.0, 0);
    (0..n)
        .map(|i| {
            if i % 97 == 0 {
                kind = rng.random_range(0..5);
            }
            let u: f64 = rng.sample(StandardNormal);
            match kind {
                0 => {}
                1 => x += 0.05 * u,
                2 => {
                    v = 0.95 * v + 0.02 * u;
                    x += v;
                }
                3 => x += 0.5 * u,
                _ => x = (x * 10.0).round() / 10.0,
            }
            if rng.random::<f64>() < 0.003 { x + 40.0 * u } else { x }
        })
        .collect()
}
