//! Speed of assigning bits to sensors. Ratios to the unit of the same run are what to compare.

#![allow(clippy::unwrap_used)]

use divan::Bencher;
use fewbits_baselines::sensor_assignment::all_errors;
use fewbits_binary_patterns::BinaryQuantizer;
use fewbits_sensor_assignment::{CodedSensors, CostMatrix, Estimator, pair_costs};

fn main() {
    divan::main();
}

/// The unit: one encoding of a measurement by four thresholds.
#[divan::bench]
fn encode(bencher: Bencher) {
    let quantizer = BinaryQuantizer::new(vec![-0.75, -0.25, 0.25, 0.75]).unwrap();
    bencher.bench(|| quantizer.encode(divan::black_box(0.3)));
}

fn table_6_1() -> CodedSensors {
    CodedSensors::with_variances(1.0, &[0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001]).unwrap()
}

/// The matrix of approximate costs of eight sensors.
#[divan::bench]
fn pair_costs_n8(bencher: Bencher) {
    let sensors = table_6_1();
    bencher.bench(|| pair_costs(&sensors));
}

/// Exact errors of all 40 320 assignments; target 1 s by the recursion.
#[divan::bench(args = [Estimator::CellCentre, Estimator::PosteriorMean], sample_count = 5)]
fn all_assignments_n8(bencher: Bencher, estimator: Estimator) {
    let sensors = table_6_1();
    bencher.bench(|| all_errors(&sensors, estimator));
}

fn random_costs(size: usize) -> Vec<f64> {
    let mut state = 1u64;
    (0..size * size)
        .map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64
        })
        .collect()
}

/// A thousand rows and columns.
#[divan::bench(sample_count = 20)]
fn assignment_1000(bencher: Bencher) {
    let costs = CostMatrix::new(1000, random_costs(1000)).unwrap();
    bencher.bench(|| costs.solve());
}

/// The proof of optimality, beyond the solution.
#[divan::bench(sample_count = 20)]
fn assignment_1000_certificate(bencher: Bencher) {
    let costs = CostMatrix::new(1000, random_costs(1000)).unwrap();
    let found = costs.solve();
    bencher.bench(|| costs.certificate(&found));
}
