//! Costs of the numerics, in multiples of one standard normal draw.

use divan::{Bencher, black_box};
use fewbits_numerics::normal;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

fn main() {
    // Fixed samples: calibration of nanosecond functions is at the mercy of whatever else runs.
    divan::Divan::from_args().sample_size(2048).main();
}

#[divan::bench]
fn standard_normal(bencher: Bencher) {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

#[divan::bench(args = [(-0.5, 0.7), (3.0, 4.5), (30.0, 31.0), (2.0, 2.001)])]
fn log_interval(bencher: Bencher, (a, b): (f64, f64)) {
    bencher.bench(|| normal::log_interval(black_box(a), black_box(b)));
}

#[divan::bench(args = [-5.0, 0.5])]
fn log_cdf(bencher: Bencher, x: f64) {
    bencher.bench(|| normal::log_cdf(black_box(x)));
}

#[divan::bench(args = [(-0.5, 0.7), (9.0, 10.0)])]
fn truncated_moments(bencher: Bencher, (a, b): (f64, f64)) {
    bencher.bench(|| normal::truncated_moments(black_box(a), black_box(b)));
}
