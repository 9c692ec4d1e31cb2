//! Costs of one slot, in multiples of one standard normal draw; the allocation columns must stay empty.

#![allow(clippy::unwrap_used)]

use divan::{AllocProfiler, Bencher, black_box};
use fewbits_baselines::dymbo::SignFilter;
use fewbits_core::factor::{Factor, Levels};
use fewbits_core::{Cell, Gaussian, Link, Observation, Sign};
use fewbits_dymbo::{CellIndex, CountFusion, DymboFilter, MultibitFilter, ParallelFilter, ScalarFilter, ScalarPlant};
use fewbits_models::{ScalarSensor, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix4, Vector4};
use rand::RngExt;
use rand_distr::StandardNormal;

#[global_allocator]
static ALLOC: AllocProfiler = AllocProfiler::system();

fn main() {
    // Fixed samples: calibration of nanosecond functions is at the mercy of whatever else runs.
    divan::Divan::from_args().sample_size(2048).main();
}

/// A scalar filter and a belief to step.
fn scalar() -> (DymboFilter, Gaussian<1>) {
    (DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0).unwrap()), Gaussian::scalar(0.3, 0.8).unwrap())
}

#[divan::bench]
fn standard_normal(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

#[divan::bench]
fn sensor_half(bencher: Bencher) {
    bencher.bench(|| Sign::of(black_box(0.4), black_box(0.3)));
}

#[divan::bench]
fn predict_and_bit(bencher: Bencher) {
    let (filter, belief) = scalar();
    bencher.bench(|| filter.step(black_box(&belief), &Observation::Received(black_box(Sign::Above))));
}

#[divan::bench]
fn predict_and_word_of_3(bencher: Bencher) {
    let filter = MultibitFilter::new(*ScalarFilter::plant(&scalar().0), 3).unwrap();
    let belief = scalar().1;
    bencher.bench(|| filter.step(black_box(&belief), &Observation::Received(black_box(CellIndex(5)))));
}

/// Threshold at the prior mean, one deviation off, and eight.
#[divan::bench(args = [0.3, 1.6, 11.0])]
fn bit_update_any_threshold(bencher: Bencher, threshold: f64) {
    let prior = scalar().1;
    let factor = || Levels::sign(Sign::Above, black_box(threshold), 1.0, &Link::PERFECT).unwrap();
    bencher.bench(|| factor().tilted(black_box(&prior)));
}

#[divan::bench]
fn bit_update_noisy_link(bencher: Bencher) {
    let prior = scalar().1;
    let link = Link::flipping(0.1).unwrap();
    bencher.bench(|| {
        Levels::sign(Sign::Above, black_box(1.6), 1.0, &link)
            .unwrap()
            .tilted(black_box(&prior))
    });
}

/// A wide cell around the mean, by closed form, and a far one, by quadrature.
#[divan::bench(args = [-0.2, 9.0])]
fn cell_update_unit_cell(bencher: Bencher, lower: f64) {
    let prior = scalar().1;
    let cell = Cell::new(lower, lower + 1.0).unwrap();
    bencher.bench(|| {
        Levels::certain(*black_box(&cell), 1.0)
            .unwrap()
            .tilted(black_box(&prior))
    });
}

/// A target in the plane and a sensor of its position along one axis.
fn plane() -> (Gaussian<4>, ScalarSensor<4>) {
    let covariance = Matrix4::new(2.0, 0.5, 0.1, 0.0, 0.5, 1.0, 0.0, 0.1, 0.1, 0.0, 2.0, 0.5, 0.0, 0.1, 0.5, 1.0);
    let belief = Gaussian::new(Vector4::new(1.0, 0.5, -2.0, 0.1), covariance).unwrap();
    (belief, ScalarSensor::scalar(Vector4::new(1.0, 0.0, 0.3, 0.0), 1.0).unwrap())
}

#[divan::bench]
fn vector_bit_4d(bencher: Bencher) {
    let (belief, sensor) = plane();
    let filter = SignFilter::new(constant_velocity_2d(1.0, 0.1).unwrap(), [sensor]);
    bencher.bench(|| filter.update(black_box(&belief), 0, &Observation::Received(black_box(Sign::Above))));
}

#[divan::bench]
fn vector_predict_and_bit_4d(bencher: Bencher) {
    let (belief, sensor) = plane();
    let filter = SignFilter::new(constant_velocity_2d(1.0, 0.1).unwrap(), [sensor]);
    bencher.bench(|| {
        filter.update(&filter.predict(black_box(&belief)), 0, &Observation::Received(black_box(Sign::Above)))
    });
}

#[divan::bench]
fn vector_three_bits_at_once_4d(bencher: Bencher) {
    let (belief, sensor) = plane();
    let across = ScalarSensor::scalar(Vector4::new(0.0, 0.0, 1.0, 0.0), 1.0).unwrap();
    let oblique = ScalarSensor::scalar(Vector4::new(0.7, 0.0, 0.7, 0.0), 1.0).unwrap();
    let filter = SignFilter::new(constant_velocity_2d(1.0, 0.1).unwrap(), [sensor, across, oblique]);
    bencher.bench(|| filter.update_parallel(black_box(&belief), black_box(&[Observation::Received(Sign::Above); 3])));
}

/// Sensors that answer at once, a wide prior: the exact posterior by quadrature.
#[divan::bench(args = [10, 1000], sample_size = 16)]
fn exact_fusion_at_once(bencher: Bencher, sensors: usize) {
    let filter = ParallelFilter::new(*ScalarFilter::plant(&scalar().0), sensors, CountFusion::Exact).unwrap();
    let belief = Gaussian::scalar(0.3, 1e4).unwrap();
    let bits: Vec<_> = (0..sensors)
        .map(|i| Observation::Received(if i % 2 == 0 { Sign::Above } else { Sign::Below }))
        .collect();
    bencher.bench_local(|| filter.step(black_box(&belief), black_box(&bits)));
}
