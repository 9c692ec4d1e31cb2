//! Cost of the engine, in multiples of one standard normal draw.

use divan::Bencher;
use fewbits_monte_carlo::{Moments, MonteCarlo, Stream};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::convert::Infallible;

fn main() {
    divan::Divan::from_args().sample_size(2048).main();
}

#[divan::bench]
fn standard_normal(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

/// A thousand trials of one normal draw each: divide by a thousand for the overhead of a trial.
#[divan::bench(sample_size = 4)]
fn monte_carlo_1000_trials(bencher: Bencher) {
    let run = MonteCarlo::new(Stream::new(1), 1000);
    bencher.bench(|| {
        run.fold(
            Moments::default,
            |sum, trial| {
                sum.add(trial.stream.rng().sample(StandardNormal));
                Ok::<_, Infallible>(())
            },
            |total, part| total.merge(&part),
        )
    });
}
