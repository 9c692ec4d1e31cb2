//! Samples per second of blocks, beside pco on the same indices. A column of 20,000 rows, as of a file.

#![allow(clippy::unwrap_used)]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use fewbits_block_codec::{BlockCodec, Effort};
use fewbits_monte_carlo::Stream;
use pco::ChunkConfig;
use pco::standalone::{simple_compress, simple_decompress};
use rand::RngExt;
use rand_distr::StandardNormal;

const ROWS: usize = 20_000;
/// Bounds in units of the signal's steps: some 0.6, 2 and 4 bits per sample.
const BOUNDS: [f64; 3] = [4.0, 0.5, 0.1];

fn main() {
    divan::main();
}

/// A random walk whose steps have standard deviation one, to two decimals.
fn signal() -> Vec<f64> {
    let mut rng = Stream::new(1).rng();
    let mut x = 0.0;
    let mut next = || {
        x += rng.sample::<f64, _>(StandardNormal);
        (x * 100.0_f64).round() / 100.0
    };
    (0..ROWS).map(|_| next()).collect()
}

fn indices(delta: f64) -> Vec<i64> {
    signal().iter().map(|x| (x / (2.0 * delta)).round() as i64).collect()
}

#[divan::bench]
fn standard_normal_unit(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher
        .counter(ItemsCount::new(ROWS))
        .bench_local(|| (0..ROWS).map(|_| rng.sample::<f64, _>(StandardNormal)).sum::<f64>());
}

fn write(bencher: Bencher, delta: f64, effort: Effort) {
    let (codec, samples) = (BlockCodec::new(delta).unwrap().with_effort(effort), signal());
    bencher
        .counter(ItemsCount::new(ROWS))
        .bench_local(|| codec.encode(black_box(&samples)).unwrap());
}

fn read(bencher: Bencher, delta: f64, effort: Effort) {
    let codec = BlockCodec::new(delta).unwrap().with_effort(effort);
    let bytes = codec.encode(&signal()).unwrap();
    bencher
        .counter(ItemsCount::new(ROWS))
        .bench_local(|| codec.decode(black_box(&bytes), ROWS).unwrap());
}

#[divan::bench(args = BOUNDS)]
fn thorough_writes(bencher: Bencher, delta: f64) {
    write(bencher, delta, Effort::Thorough);
}

#[divan::bench(args = BOUNDS)]
fn thorough_reads(bencher: Bencher, delta: f64) {
    read(bencher, delta, Effort::Thorough);
}

#[divan::bench(args = BOUNDS)]
fn fast_writes(bencher: Bencher, delta: f64) {
    write(bencher, delta, Effort::Fast);
}

#[divan::bench(args = BOUNDS)]
fn fast_reads(bencher: Bencher, delta: f64) {
    read(bencher, delta, Effort::Fast);
}

#[divan::bench(args = BOUNDS)]
fn pco_writes(bencher: Bencher, delta: f64) {
    let indices = indices(delta);
    bencher
        .counter(ItemsCount::new(ROWS))
        .bench_local(|| simple_compress(black_box(&indices), &ChunkConfig::default()).unwrap());
}

#[divan::bench(args = BOUNDS)]
fn pco_reads(bencher: Bencher, delta: f64) {
    let bytes = simple_compress(&indices(delta), &ChunkConfig::default()).unwrap();
    bencher
        .counter(ItemsCount::new(ROWS))
        .bench_local(|| simple_decompress::<i64>(black_box(&bytes)).unwrap());
}
