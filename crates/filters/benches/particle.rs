//! One bootstrap step against the normal draws it cannot do without.
//!
//! Read the medians: `step_ar1 / (10_000 draws)` is at most 4, `step_plane / (40_000 draws)` at most 2.5, for 10 000
//! particles with systematic resampling at every step. The allocation columns of the steps are zero.

#![allow(clippy::unwrap_used)]

use divan::{AllocProfiler, Bencher, black_box};
use fewbits_core::factor::{Levels, Scalar, Value};
use fewbits_core::{Cell, Dynamics, Gaussian, Likelihood, LinearDynamics, Link, Observed, Sign};
use fewbits_densities::Particles;
use fewbits_filters::{BootstrapFilter, Resampling, ResamplingRule, Schedule};
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4};
use rand::RngExt;
use rand_distr::StandardNormal;

#[global_allocator]
static ALLOCATOR: AllocProfiler = AllocProfiler::system();

const PARTICLES: usize = 10_000;

fn main() {
    divan::main();
}

/// The unit of account: `DRAWS` standard normals a particle, summed.
#[divan::bench(consts = [1, 2, 4])]
fn normals_unit<const DRAWS: usize>(bencher: Bencher<'_, '_>) {
    let mut rng = Stream::new(1).fast_rng();
    bencher.bench_local(|| {
        let mut sum = 0.0;
        for _ in 0..PARTICLES * DRAWS {
            sum += rng.sample::<f64, _>(StandardNormal);
        }
        black_box(sum)
    });
}

fn bench_steps<const D: usize>(
    bencher: Bencher<'_, '_>,
    dynamics: &impl Dynamics<D>,
    observed: &impl Likelihood<D>,
    prior: Gaussian<D>,
) {
    let mut rng = Stream::new(2).fast_rng();
    let start = Particles::from_belief(&mut rng, &prior, PARTICLES).unwrap();
    let rule = ResamplingRule {
        resampling: Resampling::Systematic,
        schedule: Schedule::Always,
    };
    let mut filter = BootstrapFilter::new(rule, PARTICLES).unwrap();
    let mut belief = start;
    filter
        .step_in_place(&mut rng, dynamics, &mut belief, &[observed])
        .unwrap();
    bencher.bench_local(|| {
        filter
            .step_in_place(&mut rng, dynamics, &mut belief, &[observed])
            .unwrap()
    });
}

/// Scalar autoregression, one draw a particle, what is observed: a value, a sign bit, one through a link that inverts one in
/// twenty, one of four cells.
#[divan::bench(args = ["value", "sign", "noisy sign", "cell"])]
fn step_ar1(bencher: Bencher<'_, '_>, observed: &str) {
    let dynamics = Ar1::new(0.95, 1.0).unwrap();
    let sign = |link| Levels::sign(Sign::Above, 0.4, 1.0, &link).unwrap();
    let factor: Scalar = match observed {
        "value" => Value::scalar(0.4, 1.0).unwrap().into(),
        "sign" => sign(Link::PERFECT).into(),
        "noisy sign" => sign(Link::flipping(0.05).unwrap()).into(),
        _ => Levels::certain(Cell::new(0.0, 1.3).unwrap(), 1.0).unwrap().into(),
    };
    let observed = Observed::new(LinearSensor::direct(1.0).unwrap(), factor);
    bench_steps(bencher, &dynamics, &observed, Gaussian::scalar(0.0, 4.0).unwrap());
}

/// Constant velocity in the plane with a process noise of full rank, four draws a particle, one value.
#[divan::bench]
fn step_plane(bencher: Bencher<'_, '_>) {
    let walk = constant_velocity_2d(0.5, 0.1).unwrap();
    let noise = walk.noise_covariance() + Matrix4::identity() * 0.01;
    let damped = LinearGaussian::with_covariance(walk.transition() * 0.97, noise).unwrap();
    let sensor = LinearSensor::scalar(Vector4::new(1.0, 0.0, 1.0, 0.0), 1.0).unwrap();
    let observed = Observed::new(sensor, Value::scalar(0.4, 1.0).unwrap());
    bench_steps(bencher, &damped, &observed, standard());
}

/// The same with one acceleration an axis, two draws a particle.
#[divan::bench]
fn step_plane_rank_2(bencher: Bencher<'_, '_>) {
    let sensor = LinearSensor::scalar(Vector4::new(1.0, 0.0, 1.0, 0.0), 1.0).unwrap();
    let observed = Observed::new(sensor, Value::scalar(0.4, 1.0).unwrap());
    bench_steps(bencher, &damped(), &observed, standard());
}

/// The same with two values: both coordinates of the position.
#[divan::bench]
fn step_plane_rank_2_two_values(bencher: Bencher<'_, '_>) {
    let matrix = Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let sensor = LinearSensor::new(matrix, Matrix2::identity()).unwrap();
    let observed = Observed::new(sensor, Value::new(Vector2::new(0.4, -0.3), Matrix2::identity()).unwrap());
    bench_steps(bencher, &damped(), &observed, standard());
}

fn standard() -> Gaussian<4> {
    Gaussian::new(Vector4::zeros(), Matrix4::identity()).unwrap()
}

/// A stationary belief for the whole bench: velocity decays, so that weights stay ordinary.
fn damped() -> LinearGaussian<4, 2> {
    let walk = constant_velocity_2d(0.5, 0.1).unwrap();
    LinearGaussian::new(walk.transition() * 0.97, *walk.gain(), *walk.noise_variances()).unwrap()
}

/// Each resampling law alone.
#[divan::bench(args = [Resampling::Systematic, Resampling::Stratified, Resampling::Residual, Resampling::Multinomial])]
fn resample(bencher: Bencher<'_, '_>, law: &Resampling) {
    let mut rng = Stream::new(3).fast_rng();
    let weights: Vec<f64> = (0..PARTICLES).map(|_| rng.random()).collect();
    let mut ancestors = vec![0; PARTICLES];
    bencher.bench_local(|| law.ancestors(&mut rng, &weights, &mut ancestors).unwrap());
}
