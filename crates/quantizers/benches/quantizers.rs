//! Speed of encoding and of Lloyd-Max designs, in multiples of one standard normal draw.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use fewbits_quantizers::density::{Density, Normal};
use fewbits_quantizers::{Quantizer, lloyd_max};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

fn main() {
    divan::main();
}

/// The unit.
#[divan::bench(sample_size = 2048)]
fn standard_normal(bencher: Bencher) {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

/// One encoding by eight levels.
#[divan::bench(sample_size = 2048)]
fn encode(bencher: Bencher) {
    let quantizer = Quantizer::from(&lloyd_max::gaussian(8).unwrap());
    bencher.bench(|| quantizer.encode(black_box(0.3)));
}

/// A design for a normal density, which starts from the kept table.
#[divan::bench(args = [8, 32, 256, 4096])]
fn lloyd_max_design(bencher: Bencher, levels: usize) {
    let density = Normal::with_deviation(0.3, 1.7).unwrap();
    bencher.bench(|| lloyd_max::design(black_box(&density), levels));
}

/// The kept table.
#[divan::bench(args = [8, 32])]
fn lloyd_max_table(bencher: Bencher, levels: usize) {
    bencher.bench(|| lloyd_max::gaussian(black_box(levels)));
}

/// A design from the companding solution, as when a table is made.
#[divan::bench(args = [8, 32, 256, 4096])]
fn lloyd_max_from_companding(bencher: Bencher, levels: usize) {
    let start = Normal::STANDARD.companding(levels);
    bencher.bench(|| lloyd_max::design_from(&Normal::STANDARD, black_box(&start)));
}
