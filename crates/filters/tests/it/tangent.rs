//! The extended Kalman filter and the Cramer-Rao recursions.

use fewbits_core::{Gaussian, Sensing};
use fewbits_filters::{cramer_rao, extended_kalman, kalman};
use fewbits_models::{LinearGaussian, LinearSensor, ReceivedPower, constant_velocity_1d, constant_velocity_2d};
use nalgebra::{Matrix1x2, Matrix2, Matrix4, Vector1, Vector2, Vector4};

#[test]
fn on_linear_models_it_is_the_kalman_filter() {
    let dynamics = constant_velocity_1d(0.5, 2.0).unwrap();
    let sensor = LinearSensor::new(Matrix1x2::new(1.0, 0.3), nalgebra::Matrix1::new(1.5)).unwrap();
    let mut exact = Gaussian::new(Vector2::new(1.0, 2.0), Matrix2::new(2.0, 0.1, 0.1, 1.0)).unwrap();
    let mut ours = exact;
    for z in [0.3, 4.0, -2.0, 7.5] {
        exact = kalman::step(&dynamics, &sensor, &exact, &Vector1::new(z)).unwrap().0;
        ours = extended_kalman::step(&dynamics, &sensor, &ours, &Vector1::new(z))
            .unwrap()
            .0;
        assert!((exact.mean() - ours.mean()).amax() < 1e-12);
        assert!((exact.covariance() - ours.covariance()).amax() < 1e-12);
    }
}

#[test]
fn a_tight_belief_makes_the_tangent_exact() {
    let dynamics = constant_velocity_2d(0.5, 0.1).unwrap();
    let sensor = ReceivedPower::<4>::new(Vector2::new(-10.0, -10.0), [0, 2], 1000.0, 1.0, 2.0, 1.0).unwrap();
    let prior = Gaussian::new(Vector4::new(-8.0, 2.0, -8.0, 2.0), Matrix4::identity() * 1e-6).unwrap();
    let predicted = extended_kalman::predict(&dynamics, &prior);
    assert_eq!(*predicted.mean(), Vector4::new(-7.0, 2.0, -7.0, 2.0));
    let (posterior, info) = extended_kalman::update(&sensor, &predicted, &Vector1::new(9.0)).unwrap();
    let amplitude = sensor.mean(predicted.mean())[0];
    assert!((info.innovation[0] - (9.0 - amplitude)).abs() < 1e-12);
    let slope = sensor.jacobian(predicted.mean());
    let s = (slope * predicted.covariance() * slope.transpose())[0] + 1.0;
    assert!((info.innovation_covariance[(0, 0)] - s).abs() < 1e-12);
    let shrunk =
        predicted.covariance() - predicted.covariance() * slope.transpose() * slope * predicted.covariance() / s;
    assert!((posterior.covariance() - shrunk).amax() < 1e-14);
}

#[test]
fn for_linear_gaussian_models_the_bound_is_the_kalman_covariance() {
    let singular = constant_velocity_1d(1.0, 4.0).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 2.0).unwrap();
    let information = Matrix2::new(0.5, 0.0, 0.0, 0.0);
    let mut belief = Gaussian::known(Vector2::zeros()).unwrap();
    let mut bound = Matrix2::zeros();
    for _ in 0..15 {
        belief = kalman::step(&singular, &sensor, &belief, &Vector1::new(0.0)).unwrap().0;
        bound = cramer_rao::covariance_step(&singular, &bound, &information).unwrap();
        assert!((bound - belief.covariance()).amax() < 1e-10);
    }

    let q = Matrix2::new(0.5, 0.1, 0.1, 0.4);
    let f = Matrix2::new(0.9, 0.2, -0.1, 0.8);
    let regular = LinearGaussian::with_covariance(f, q).unwrap();
    let inverse = q.try_inverse().unwrap();
    let mut bound = Matrix2::identity();
    let mut inverse_bound = Matrix2::identity();
    for _ in 0..15 {
        bound = cramer_rao::covariance_step(&regular, &bound, &information).unwrap();
        inverse_bound = cramer_rao::information_step(
            &inverse_bound,
            &(f.transpose() * inverse * f),
            &(-f.transpose() * inverse),
            &(inverse + information),
        )
        .unwrap();
        assert!((bound * inverse_bound - Matrix2::identity()).amax() < 1e-9);
    }
}

#[test]
fn bad_information_is_refused() {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let bad = Matrix2::new(1.0, 0.0, 0.0, -1.0);
    assert!(cramer_rao::covariance_step(&dynamics, &Matrix2::identity(), &bad).is_err());
    assert!(cramer_rao::covariance_step(&dynamics, &bad, &Matrix2::identity()).is_err());
    let zero = Matrix2::zeros();
    assert!(cramer_rao::information_step(&zero, &zero, &zero, &zero).is_err());
}
