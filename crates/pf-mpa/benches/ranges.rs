//! Cost of a range to [`RangeTracker`]: while the place is searched, and while it is tracked, in multiples of one standard normal draw.
//!
//! Bits of a range: 32 is a range in full. The counted items are ranges. The room is one of six anchors with a common bias and an error of scale;
//! rooms of three anchors cost twice as much, and the first ranges behind a search several times as much.

#![allow(clippy::unwrap_used)]

use divan::counter::ItemsCount;
use divan::{AllocProfiler, Bencher};
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{RangeSettings, RangeTracker, Travel};
use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;

#[global_allocator]
static ALLOC: AllocProfiler = AllocProfiler::system();

/// Ranges before tracking is measured.
const SETTLED: usize = 100;
/// Ranges in one measurement of tracking.
const TRACKED: usize = 60;

fn main() {
    divan::main();
}

#[divan::bench(sample_size = 4096)]
fn standard_normal(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

fn anchors() -> Vec<(String, Vector3<f64>)> {
    [
        [0.0, 0.0],
        [21.0, 1.0],
        [19.0, 16.0],
        [-1.0, 14.0],
        [9.0, 20.0],
        [26.0, 7.0],
    ]
    .into_iter()
    .enumerate()
    .map(|(number, [x, y])| (format!("a{number}"), Vector3::new(x, y, 0.0)))
    .collect()
}

fn tracker(bits: u32) -> RangeTracker {
    let travel = if bits == 32 { Travel::Full } else { Travel::Bits(bits) };
    RangeTracker::new(anchors(), travel, RangeSettings::default()).unwrap()
}

/// Times, numbers of anchors and ranges of a walk.
fn walk() -> Vec<(f64, usize, f64)> {
    let (anchors, mut rng) = (anchors(), Stream::new(2).rng());
    (0..SETTLED + TRACKED)
        .map(|k| {
            let time = 0.2 * k as f64;
            let place = Vector3::new(11.0 + 6.0 * (0.15 * time).sin(), 9.0 + 5.0 * (0.11 * time).cos(), 0.0);
            let number = k % anchors.len();
            let noise: f64 = 0.1 * rng.sample::<f64, _>(StandardNormal);
            (time, number, 1.03 * (place - anchors[number].1).norm() + 0.4 + noise)
        })
        .collect()
}

fn push(tracker: &mut RangeTracker, anchors: &[(String, Vector3<f64>)], range: &(f64, usize, f64)) -> bool {
    let (time, number, range) = range;
    tracker.push(*time, &anchors[*number].0, *range).unwrap().is_some()
}

/// The ranges up to the first place, that one included.
#[divan::bench(args = [32, 1, 2])]
fn searching(bencher: Bencher, bits: u32) {
    let (anchors, walk) = (anchors(), walk());
    let needed = tracker(bits).needed();
    bencher
        .counter(ItemsCount::new(needed))
        .with_inputs(|| tracker(bits))
        .bench_local_values(|mut tracker| {
            let found = walk[..needed]
                .iter()
                .filter(|range| push(&mut tracker, &anchors, range));
            assert_eq!(found.count(), 1);
            tracker
        });
}

#[divan::bench(args = [32, 1, 2])]
fn tracking(bencher: Bencher, bits: u32) {
    let (anchors, walk) = (anchors(), walk());
    let mut settled = tracker(bits);
    walk[..SETTLED].iter().for_each(|range| {
        push(&mut settled, &anchors, range);
    });
    bencher
        .counter(ItemsCount::new(TRACKED))
        .with_inputs(|| settled.clone())
        .bench_local_values(|mut tracker| {
            let found = walk[SETTLED..]
                .iter()
                .filter(|range| push(&mut tracker, &anchors, range));
            assert_eq!(found.count(), TRACKED);
            tracker
        });
}
