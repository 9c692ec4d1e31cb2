//! Speed of designing and evaluating one-bit sensors. Ratios to the single evaluations in the same run are what to compare.

#![allow(clippy::unwrap_used)]

use divan::Bencher;
use fewbits_binary_patterns::search::LinearSearch;
use fewbits_binary_patterns::{BinaryQuantizer, Source, uniform_cells};
use rayon::ThreadPoolBuilder;

fn main() {
    divan::main();
}

fn search(bits: usize, sensors: usize) -> LinearSearch {
    let source = Source::uniform(1.0).unwrap();
    let noise = source.noise_deviation(18.2).unwrap();
    LinearSearch::with_deviation(source, uniform_cells(1.0, bits).unwrap(), noise, sensors).unwrap()
}

/// The unit: one encoding of a measurement by four thresholds.
#[divan::bench]
fn encode(bencher: Bencher) {
    let quantizer = BinaryQuantizer::new(vec![-0.75, -0.25, 0.25, 0.75]).unwrap();
    bencher.bench(|| quantizer.encode(divan::black_box(0.3)));
}

/// The exact error of one set of eight sensors.
#[divan::bench]
fn one_set_unit(bencher: Bencher) {
    let bank = search(3, 8).bank(&[2, 2, 3, 3, 3, 3, 4, 6]).unwrap();
    bencher.bench(|| bank.mmse());
}

/// Fifty sensors in three groups, 5508 outcomes.
#[divan::bench]
fn fifty_sensors(bencher: Bencher) {
    let masks: Vec<u32> = [(4, 17), (6, 16), (3, 17)]
        .iter()
        .flat_map(|&(m, n)| vec![m; n])
        .collect();
    let bank = search(3, 50).bank(&masks).unwrap();
    bencher.bench(|| bank.mmse());
}

/// All 2702 sets; target 100 ms on one core.
#[divan::bench(args = [1, 2])]
fn exhaustive_b3_n8(bencher: Bencher, threads: usize) {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let search = search(3, 8);
    bencher.bench(|| pool.install(|| search.best()));
}

/// All 277 755 sets; target 8 s on one core, and scaling with threads.
#[divan::bench(args = [1, 2], sample_count = 3)]
fn exhaustive_b4_n8(bencher: Bencher, threads: usize) {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let search = search(4, 8);
    bencher.bench(|| pool.install(|| search.best()));
}
