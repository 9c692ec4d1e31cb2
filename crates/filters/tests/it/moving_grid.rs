//! The filter on a grid that goes with the belief, against the Kalman filter, a fixed fine grid and particles.

use fewbits_core::factor::{Levels, Value};
use fewbits_core::{Belief, Cell, Gaussian, Likelihood, Observed};
use fewbits_filters::{
    BootstrapFilter, Error, MomentFilter, PointMassFilter, ResamplingRule, StateFilter, UniformGrid,
};
use fewbits_models::{Ar1, ContinuousLinear, LinearSensor};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn step<F: StateFilter<1>>(
    filter: &mut F,
    rng: &mut Pcg64Mcg,
    world: &ContinuousLinear<1>,
    belief: &mut F::Belief,
    seen: (f64, &dyn Likelihood<1>),
) -> f64 {
    filter.predict(rng, &world.over(seen.0).unwrap(), belief).unwrap();
    filter.update(rng, belief, &[seen.1]).unwrap().log_likelihood
}

/// With values it is the Kalman filter: sharp and blunt ones, far ones, at all distances in time, in every unit.
#[test]
fn with_values_it_is_the_kalman_filter() {
    for unit in [1e-6, 1.0, 1e6] {
        let world = ContinuousLinear::random_walk(0.04 * unit * unit).unwrap();
        let returning = ContinuousLinear::ornstein_uhlenbeck(20.0 * unit, 30.0, 4.0 * unit * unit).unwrap();
        for world in [world, returning] {
            let mut rng = Pcg64Mcg::seed_from_u64(1);
            let prior = Gaussian::scalar(20.0 * unit, 25.0 * unit * unit).unwrap();
            let (mut grid, mut exact) = (PointMassFilter::following(), MomentFilter);
            let (mut one, mut other) = (grid.start(&mut rng, &prior).unwrap(), prior);
            for k in 0..200 {
                let value = 20.0 + 2.0 * (f64::from(k) * 0.1).sin();
                let deviation = [0.003, 0.3, 3.0][k as usize % 3];
                let seconds = [0.01, 1.0, 400.0][(k as usize / 3) % 3];
                let value = Value::scalar(value * unit, (deviation * unit).powi(2)).unwrap();
                let seen = Observed::new(LinearSensor::direct((deviation * unit).powi(2)).unwrap(), value);
                let logs = [
                    step(&mut grid, &mut rng, &world, &mut one, (seconds, &seen)),
                    step(&mut exact, &mut rng, &world, &mut other, (seconds, &seen)),
                ];
                let (variance, known) = (one.variance(), other.covariance()[0]);
                assert!((one.mean() - other.mean()[0]).abs() < 0.03 * known.sqrt(), "{k} {unit}");
                assert!((variance / known - 1.0).abs() < 0.05, "{k} {unit}: {variance} {known}");
                assert!((logs[0] - logs[1]).abs() < 0.05, "{k} {unit}: {logs:?}");
            }
        }
    }
}

/// Silence within a cell, again and again: the belief is that on a fixed fine grid and that of 400 000 particles, whose variance that of
/// Gaussian moments is far below.
#[test]
fn silence_leaves_the_exact_belief() {
    let world = ContinuousLinear::random_walk(0.0025).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let prior = Gaussian::scalar(0.0, 0.0025).unwrap();
    let (mut grid, mut moments) = (PointMassFilter::following(), MomentFilter);
    let mut cloud = BootstrapFilter::new(ResamplingRule::default(), 400_000).unwrap();
    let mut one = grid.start(&mut rng, &prior).unwrap();
    let mut other = cloud.start(&mut rng, &prior).unwrap();
    let mut fixed = PointMassFilter::new(UniformGrid::symmetric(3.0, 0.02).unwrap());
    let (mut fine, mut logs) = (fixed.start(&mut rng, &prior).unwrap(), [0.0; 2]);
    let mut gaussian = prior;
    let cell = Levels::certain(Cell::new(-0.5, 0.5).unwrap(), 0.0025).unwrap();
    let seen = Observed::new(LinearSensor::direct(0.0025).unwrap(), cell);
    for _ in 0..150 {
        logs[0] += step(&mut grid, &mut rng, &world, &mut one, (1.0, &seen));
        logs[1] += step(&mut fixed, &mut rng, &world, &mut fine, (1.0, &seen));
        step(&mut cloud, &mut rng, &world, &mut other, (1.0, &seen));
        step(&mut moments, &mut rng, &world, &mut gaussian, (1.0, &seen));
    }
    let (own, drawn) = (one.variance(), other.covariance()[0]);
    assert!((own / drawn - 1.0).abs() < 0.02 && one.mean().abs() < 1e-9, "{own} {drawn}");
    assert!((own / fine.variance() - 1.0).abs() < 0.01, "{own} {}", fine.variance());
    assert!((logs[0] - logs[1]).abs() < 0.05, "{logs:?}");
    assert!(gaussian.covariance()[0] < 0.9 * own, "{gaussian:?} {own}");
    // Draws have the moments.
    let mut states = vec![0.0; 100_000];
    one.sample_columns(&mut rng, [&mut states]);
    let square = states.iter().map(|state| state * state).sum::<f64>() / 1e5;
    assert!((square / own - 1.0).abs() < 0.02, "{square} {own}");
}

/// Defect: the posterior of a value far out was a spike at the end of the grid.
#[test]
fn a_value_far_out_has_the_posterior_of_the_kalman_filter() {
    for unit in [1e-9, 1.0, 1e9] {
        let world = ContinuousLinear::random_walk(0.04 * unit * unit).unwrap();
        for (noise, far) in [(1.0, -8.0), (0.1, 6.5), (0.1, 20.0), (0.3, -36.0), (3.0, 1e3)] {
            let mut rng = Pcg64Mcg::seed_from_u64(1);
            let prior = Gaussian::scalar(5.0 * unit, unit * unit).unwrap();
            let (mut grid, mut exact) = (PointMassFilter::following(), MomentFilter);
            let (mut one, mut other) = (grid.start(&mut rng, &prior).unwrap(), prior);
            let (value, variance) = (5.0 + far, (noise * unit).powi(2));
            let seen =
                Observed::new(LinearSensor::direct(variance).unwrap(), Value::scalar(value * unit, variance).unwrap());
            let logs = [
                step(&mut grid, &mut rng, &world, &mut one, (1.0, &seen)),
                step(&mut exact, &mut rng, &world, &mut other, (1.0, &seen)),
            ];
            let deviation = other.covariance()[0].sqrt();
            assert!((one.mean() - other.mean()[0]).abs() < 0.05 * deviation, "{unit} {noise} {far}");
            assert!((one.variance().sqrt() / deviation - 1.0).abs() < 0.05, "{unit} {noise} {far}");
            assert!((logs[0] - logs[1]).abs() < 1e-3 * logs[1].abs(), "{unit} {noise} {far}: {logs:?}");
        }
    }
}

#[test]
fn what_cannot_be_leaves_the_belief_as_it_was() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut grid = PointMassFilter::following();
    let mut belief = grid.start(&mut rng, &Gaussian::scalar(0.0, 1.0).unwrap()).unwrap();
    let before = belief.clone();
    let far = Levels::certain(Cell::new(1e9, 2e9).unwrap(), 1.0).unwrap();
    let seen = Observed::new(LinearSensor::direct(1.0).unwrap(), far);
    if let Err(error) = grid.update(&mut rng, &mut belief, &[&seen]) {
        assert!(matches!(error, Error::Impossible), "{error}");
        assert_eq!(belief, before);
    }
    assert!(belief.mean().is_finite());
}

/// Issue: the grid filters refused noise-free dynamics.
#[test]
fn narrow_noise_and_none_are_followed() {
    for (a, q) in [
        (0.9, 0.0),
        (-0.8, 0.0),
        (1.0, 0.0),
        (1.1, 1e-3),
        (0.7, 0.01),
        (0.0, 0.0),
        (0.3, 0.005),
    ] {
        let (dynamics, mut rng) = (Ar1::new_unstable(a, q).unwrap(), Pcg64Mcg::seed_from_u64(1));
        let (mut grid, mut exact) = (PointMassFilter::following(), MomentFilter);
        let mut other = Gaussian::scalar(0.4, 2.0).unwrap();
        let mut one = grid.start(&mut rng, &other).unwrap();
        for z in [1.0, -0.5] {
            let value = Value::scalar(z, 4.0).unwrap();
            let seen: &dyn Likelihood<1> = &Observed::new(LinearSensor::direct(4.0).unwrap(), value);
            grid.predict(&mut rng, &dynamics, &mut one).unwrap();
            exact.predict(&mut rng, &dynamics, &mut other).unwrap();
            let evidence = grid.update(&mut rng, &mut one, &[seen]).unwrap().log_likelihood;
            let known = exact.update(&mut rng, &mut other, &[seen]).unwrap().log_likelihood;
            assert!((evidence - known).abs() < 2e-6, "{a} {q}");
            assert!((one.mean() - other.mean()[0]).abs() < 2e-6, "{a} {q}");
            assert!((one.variance() - other.covariance()[0]).abs() < 2e-5, "{a} {q}");
        }
    }
}
