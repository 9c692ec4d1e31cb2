//! Filters that work with points, against closed forms, the Kalman filter and each other.

use fewbits_core::factor::{Levels, Scalar, Value};
use fewbits_core::{Belief, Cell, Dynamics, Gaussian, Likelihood, Link, Observed, Sensing, Sign, laws};
use fewbits_filters::{
    EnsembleFilter, Error, MomentFilter, Particles, RootGaussian, SigmaPointFilter, StateFilter, kalman,
};
use fewbits_models::{AutoDynamics, AutoSensing, Differentiable, LinearSensor, Number, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1, Matrix2, SMatrix, SVector, Vector1, Vector2};

fn rules<const D: usize>() -> Vec<SigmaPointFilter<D>> {
    let unscented = [0.5, 3.0].map(|kappa| SigmaPointFilter::unscented(kappa).unwrap());
    [SigmaPointFilter::cubature().unwrap()]
        .into_iter()
        .chain(unscented)
        .collect()
}

/// Positions of a target at nearly constant velocity.
fn positions(unit: f64) -> Vec<f64> {
    let (dynamics, mut rng) = (constant_velocity_1d(1.0, 0.1).unwrap(), Stream::new(8).rng());
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.5).unwrap();
    let mut state = Vector2::new(0.3, 1.0);
    (0..40)
        .map(|_| {
            state = dynamics.propagate(&mut rng, &state);
            sensor.sample(&mut rng, &state)[0] * unit
        })
        .collect()
}

fn close<const D: usize>(found: &impl Belief<D>, expected: &Gaussian<D>, tolerance: f64) {
    let deviations = expected.standard_deviations();
    let off = found.mean() - expected.mean();
    for i in 0..D {
        assert!(off[i].abs() <= tolerance * deviations[i], "mean {i}: {off}");
        for j in 0..D {
            let off = found.covariance()[(i, j)] - expected.covariance()[(i, j)];
            assert!(off.abs() <= tolerance * deviations[i] * deviations[j], "covariance {i} {j}: {off}");
        }
    }
}

/// Values and linear models: the Kalman filter, in every unit.
#[test]
fn with_values_they_are_the_kalman_filter() {
    for unit in [1e-4, 1.0, 1e4] {
        let dynamics = constant_velocity_1d(1.0, 0.1 * unit * unit).unwrap();
        let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.5 * unit * unit).unwrap();
        let prior = Gaussian::new(Vector2::zeros(), Matrix2::new(4.0, 0.5, 0.5, 1.0) * unit * unit).unwrap();
        for mut filter in rules::<2>() {
            let mut rng = Stream::new(1).rng();
            let (mut exact, mut belief) = (prior, filter.start(&mut rng, &prior).unwrap());
            for z in positions(unit) {
                let value = Observed::new(sensor, Value::scalar(z, 0.5 * unit * unit).unwrap());
                let (next, info) = kalman::step(&dynamics, &sensor, &exact, &Vector1::new(z)).unwrap();
                exact = next;
                let (next, found) = filter.step(&mut rng, &dynamics, &belief, &[&value]).unwrap();
                belief = next;
                close(&belief, &exact, 1e-12);
                assert!((found.log_likelihood - info.log_likelihood).abs() < 1e-12);
            }
        }
    }
}

/// Whatever the report, a linear sensor needs no points: the moments are those of the assumed-density filter.
#[test]
fn with_few_bits_and_linear_models_they_are_the_moment_filter() {
    let dynamics = constant_velocity_1d(1.0, 0.1).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.5).unwrap();
    let prior = Gaussian::new(Vector2::zeros(), Matrix2::new(4.0, 0.5, 0.5, 1.0)).unwrap();
    let link = Link::flipping(0.05).unwrap();
    for mut filter in rules::<2>() {
        let mut rng = Stream::new(1).rng();
        let (mut exact, mut belief) = (prior, filter.start(&mut rng, &prior).unwrap());
        for (k, z) in positions(1.0).into_iter().enumerate() {
            let threshold = exact.mean()[0];
            let bit = Scalar::from(Levels::sign(Sign::of(z, threshold).unwrap(), threshold, 0.5, &link).unwrap());
            let cell = Scalar::from(Levels::certain(Cell::new(z.floor(), z.floor() + 1.0).unwrap(), 0.5).unwrap());
            let report = Observed::new(sensor, if k % 2 == 0 { bit } else { cell });
            let (next, info) = MomentFilter.step(&mut rng, &dynamics, &exact, &[&report]).unwrap();
            exact = next;
            let (next, found) = filter.step(&mut rng, &dynamics, &belief, &[&report]).unwrap();
            belief = next;
            close(&belief, &exact, 1e-10);
            assert!((found.log_likelihood - info.log_likelihood).abs() < 1e-10);
        }
    }
}

/// The square of a coordinate.
#[derive(Clone, Copy)]
struct Square;

impl Differentiable<1, 1> for Square {
    fn at<N: Number>(&self, x: &[N; 1]) -> [N; 1] {
        [x[0] * x[0]]
    }
}

/// `x^2` of `N(m, v)` has mean `m^2 + v`, variance `2 v^2 + 4 m^2 v` and covariance `2 m v` with `x`: `kappa = 2` meets them, and with
/// them the update that is linear in the measurement. About a mean of zero the linearised filter learns nothing of a square.
#[test]
fn a_square_has_its_moments() {
    let (mean, variance, noise, z) = (0.7, 0.4, 0.3, 1.9);
    let sensing = AutoSensing::new(Square, Matrix1::new(noise)).unwrap();
    let report = Observed::new(sensing, Value::scalar(z, noise).unwrap());
    let mut filter = SigmaPointFilter::<1>::unscented(2.0).unwrap();
    let mut rng = Stream::new(1).rng();
    let prior = Gaussian::scalar(mean, variance).unwrap();
    let mut belief = filter.start(&mut rng, &prior).unwrap();
    filter.update(&mut rng, &mut belief, &[&report]).unwrap();
    let spread = 2.0 * variance * variance + 4.0 * mean * mean * variance + noise;
    let gain = 2.0 * mean * variance / spread;
    assert!((belief.mean()[0] - mean - gain * (z - mean * mean - variance)).abs() < 1e-13);
    assert!((belief.covariance()[0] - variance + gain * gain * spread).abs() < 1e-13);
    // Prediction through the square.
    let dynamics = AutoDynamics::new(Square, Matrix1::new(0.1)).unwrap();
    let mut next = filter.start(&mut rng, &prior).unwrap();
    filter.predict(&mut rng, &dynamics, &mut next).unwrap();
    assert!((next.mean()[0] - mean * mean - variance).abs() < 1e-13);
    assert!((next.covariance()[0] - (spread - noise + 0.1)).abs() < 1e-13);
}

/// Two nearly parallel measurements of small noise. The information matrix and its determinant are known without cancellation.
#[test]
fn the_root_keeps_digits_that_the_covariance_loses() {
    let e = 1e-9_f64;
    let r = e * e;
    let determinant = r * r + r * (3.0 + (1.0 + e) * (1.0 + e)) + r;
    let exact = r * (r + 1.0 + (1.0 + e) * (1.0 + e)) / determinant;
    let rows = [1.0, 1.0 + e].map(|second| LinearSensor::scalar(Vector2::new(1.0, second), r).unwrap());
    let reports = rows.map(|sensor| Observed::new(sensor, Value::scalar(0.0, r).unwrap()));
    let observed: Vec<&dyn Likelihood<2>> = reports.iter().map(|one| one as _).collect();
    let prior = Gaussian::new(Vector2::zeros(), Matrix2::identity()).unwrap();
    let mut rng = Stream::new(1).rng();
    let mut filter = SigmaPointFilter::<2>::cubature().unwrap();
    let mut belief = filter.start(&mut rng, &prior).unwrap();
    filter.update(&mut rng, &mut belief, &observed).unwrap();
    let off = belief.covariance()[(0, 0)] / exact - 1.0;
    assert!(off.abs() < 1e-5, "{off}");
    let mut plain = prior;
    MomentFilter.update(&mut rng, &mut plain, &observed).unwrap();
    assert!((plain.covariance()[(0, 0)] / exact - 1.0).abs() > 1e-3, "the covariance form would do");
}

/// The ensemble's moments after an update are those of the Kalman filter that starts from its moments before.
#[test]
fn an_ensemble_has_the_kalman_filters_moments() {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.4), 0.5).unwrap();
    let prior = Gaussian::new(Vector2::new(1.0, -2.0), Matrix2::new(4.0, 0.5, 0.5, 1.0)).unwrap();
    for count in [2, 3, 50] {
        let (mut rng, mut filter) = (Stream::new(4).rng(), EnsembleFilter::new(count).unwrap());
        let mut belief: Particles<2> = filter.start(&mut rng, &prior).unwrap();
        for z in [0.3, -1.0, 4.0] {
            let own = Gaussian::from_trusted_parts(belief.mean(), belief.covariance());
            let (exact, info) = kalman::update(&sensor, &own, &Vector1::new(z)).unwrap();
            let report = Observed::new(sensor, Value::scalar(z, 0.5).unwrap());
            let found = filter.update(&mut rng, &mut belief, &[&report]).unwrap();
            close(&belief, &exact, 1e-12);
            assert!((found.log_likelihood - info.log_likelihood).abs() < 1e-12);
        }
    }
}

/// A large ensemble follows the Kalman filter through time, inflated or not.
#[test]
fn a_large_ensemble_tracks_as_the_kalman_filter() {
    let dynamics = constant_velocity_1d(1.0, 0.1).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.5).unwrap();
    let prior = Gaussian::new(Vector2::zeros(), Matrix2::new(4.0, 0.5, 0.5, 1.0)).unwrap();
    let mut rng = Stream::new(5).fast_rng();
    let mut filter = EnsembleFilter::new(20_000).unwrap().with_inflation(1.000_025).unwrap();
    let (mut exact, mut belief): (_, Particles<2>) = (prior, filter.start(&mut rng, &prior).unwrap());
    for z in positions(1.0) {
        let report = Observed::new(sensor, Value::scalar(z, 0.5).unwrap());
        exact = kalman::step(&dynamics, &sensor, &exact, &Vector1::new(z)).unwrap().0;
        belief = filter.step(&mut rng, &dynamics, &belief, &[&report]).unwrap().0;
    }
    // Four standard errors of a mean and of a variance of 20,000 members, forgotten over a few steps.
    close(&belief, &exact, 0.06);
}

#[test]
fn moved_points_obey_the_law() {
    let sensor = LinearSensor::new(Matrix2::new(1.0, 0.3, -0.5, 2.0), Matrix2::new(1.0, 0.2, 0.2, 0.5)).unwrap();
    let pair = Observed::new(sensor, Value::new(Vector2::new(0.4, -2.0), Matrix2::new(1.0, 0.2, 0.2, 0.5)).unwrap());
    let single = LinearSensor::scalar(Vector2::new(1.0, -0.7), 0.25).unwrap();
    let bit = Observed::new(single, Levels::sign(Sign::Above, 0.8, 0.25, &Link::flipping(0.1).unwrap()).unwrap());
    for scale in [1e-3, 1.0] {
        let columns = [[0.1, 0.9, -0.7, 2.0, 0.3], [1.0, -0.4, 0.2, 0.6, -1.1]].map(|c| c.map(|x| x * scale).to_vec());
        laws::likelihood::points_have_the_moments(&pair, &columns).unwrap();
        laws::likelihood::points_have_the_moments(&bit, &columns).unwrap();
        laws::likelihood::points_have_the_moments(&vec![bit.clone(); 3], &columns).unwrap();
    }
    // All points in one place: the measurement is known, and nothing moves.
    laws::likelihood::points_have_the_moments(&pair, &[vec![1.0; 4], vec![2.0; 4]]).unwrap();
}

#[test]
fn a_failed_step_leaves_the_belief() {
    let mut rng = Stream::new(1).rng();
    let sensor = LinearSensor::direct(0.5).unwrap();
    let never = Observed::new(sensor, Scalar::from(fewbits_core::factor::Constant::new(0.0).unwrap()));
    let fine = Observed::new(sensor, Scalar::from(Value::scalar(1.0, 0.5).unwrap()));
    let prior = Gaussian::scalar(1.0, 2.0).unwrap();
    let mut filter = SigmaPointFilter::<1>::cubature().unwrap();
    let mut belief = filter.start(&mut rng, &prior).unwrap();
    let before = belief;
    assert_eq!(filter.update(&mut rng, &mut belief, &[&fine, &never]), Err(Error::Impossible));
    assert_eq!(belief, before);
    let overflow = AutoDynamics::new(Square, Matrix1::new(0.1)).unwrap();
    let mut wide = RootGaussian::new(Vector1::new(1e200), Matrix1::new(1.0)).unwrap();
    assert!(matches!(filter.predict(&mut rng, &overflow, &mut wide), Err(Error::NotANumber { .. })));
    assert_eq!(wide.mean()[0], 1e200);
    let mut ensemble = EnsembleFilter::new(5).unwrap();
    let mut members: Particles<1> = ensemble.start(&mut rng, &prior).unwrap();
    let before = members.clone();
    assert_eq!(ensemble.update(&mut rng, &mut members, &[&fine, &never]), Err(Error::Impossible));
    assert_eq!(members, before);
    assert!(SigmaPointFilter::<2>::unscented(-0.5).is_err() && EnsembleFilter::new(0).is_err());
    assert!(EnsembleFilter::new(3).unwrap().with_inflation(0.9).is_err());
    assert!(RootGaussian::new(Vector2::zeros(), Matrix2::new(1.0, 1.0, 0.0, 1.0)).is_err());
}

/// A root is stored and comes back to the bit; columns that are added sum to the covariance.
#[test]
fn roots_sum_squares_and_store_themselves() {
    let columns = SMatrix::<f64, 3, 5>::from_fn(|i, j| ((i * 5 + j) as f64 * 1.7).sin());
    let mut root = RootGaussian::new(SVector::from([1.0, 2.0, 3.0]), SMatrix::zeros()).unwrap();
    columns.column_iter().for_each(|c| root.add(c.into()));
    assert!((root.covariance() - columns * columns.transpose()).amax() < 1e-14);
    let text = serde_json::to_string(&root).unwrap();
    assert_eq!(serde_json::from_str::<RootGaussian<3>>(&text).unwrap(), root);
}
