//! Costs of one Kalman step, in multiples of one standard normal draw; the allocation columns must stay empty.

#![allow(clippy::unwrap_used)]

use divan::{AllocProfiler, Bencher, black_box};
use fewbits_core::Gaussian;
use fewbits_filters::{PointMass, TransitionKernel, UniformGrid, kalman};
use fewbits_models::{Ar1, LinearSensor, ScalarSensor, constant_velocity_1d, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector1, Vector2, Vector4};
use rand::RngExt;
use rand_distr::StandardNormal;

#[global_allocator]
static ALLOC: AllocProfiler = AllocProfiler::system();

fn main() {
    // Fixed samples: calibration of nanosecond functions is at the mercy of whatever else runs.
    divan::Divan::from_args().sample_size(1024).main();
}

#[divan::bench]
fn standard_normal(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

#[divan::bench]
fn constant_velocity_line(bencher: Bencher) {
    let dynamics = constant_velocity_1d(1.0, 0.1).unwrap();
    let sensing = ScalarSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::identity()).unwrap();
    bencher.bench(|| kalman::step(&dynamics, &sensing, black_box(&belief), black_box(&Vector1::new(0.4))));
}

#[divan::bench]
fn constant_velocity_plane(bencher: Bencher) {
    let dynamics = constant_velocity_2d(1.0, 0.1).unwrap();
    let matrix = Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let sensing = LinearSensor::new(matrix, Matrix2::identity()).unwrap();
    let belief = Gaussian::new(Vector4::zeros(), Matrix4::identity()).unwrap();
    bencher.bench(|| kalman::step(&dynamics, &sensing, black_box(&belief), black_box(&Vector2::new(0.4, -0.1))));
}

/// Prediction and update on a hundred nodes.
#[divan::bench(sample_size = 16)]
fn point_mass_100_nodes(bencher: Bencher) {
    let filter =
        TransitionKernel::new(&Ar1::new(0.9, 0.5).unwrap(), UniformGrid::symmetric(14.0, 0.28).unwrap()).unwrap();
    let belief = PointMass::normal(*filter.grid(), 0.0, 1.0).unwrap();
    let likelihood: Vec<f64> = filter.grid().nodes().map(|x| (-0.5 * x * x).exp()).collect();
    bencher.bench_local(|| {
        let mut next = filter.predict(black_box(&belief)).unwrap();
        next.reweight(&likelihood)
    });
}
