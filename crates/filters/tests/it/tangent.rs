//! The extended Kalman filter and the Cramer-Rao recursions.

use fewbits_core::factor::Value;
use fewbits_core::{Gaussian, Observed, Sensing};
use fewbits_filters::{assumed_density, cramer_rao, kalman};
use fewbits_models::{LinearGaussian, LinearSensor, ReceivedPower, constant_velocity_1d, constant_velocity_2d};
use nalgebra::{Matrix2, Matrix4, Vector1, Vector2, Vector4};

#[test]
fn a_tight_belief_makes_the_tangent_exact() {
    let dynamics = constant_velocity_2d(0.5, 0.1).unwrap();
    let sensor = ReceivedPower::<4>::new(Vector2::new(-10.0, -10.0), [0, 2], 1000.0, 1.0, 2.0, 1.0).unwrap();
    let prior = Gaussian::new(Vector4::new(-8.0, 2.0, -8.0, 2.0), Matrix4::identity() * 1e-6).unwrap();
    let predicted = assumed_density::predict(&dynamics, &prior);
    assert_eq!(*predicted.mean(), Vector4::new(-7.0, 2.0, -7.0, 2.0));
    let observed = Observed::new(sensor, Value::scalar(9.0, 1.0).unwrap());
    let (posterior, info) = assumed_density::update_through(&predicted, &observed).unwrap();
    let slope = sensor.jacobian(predicted.mean());
    let s = (slope * predicted.covariance() * slope.transpose())[0] + 1.0;
    let innovation = Gaussian::scalar(sensor.mean(predicted.mean())[0], s).unwrap();
    assert!((info.log_likelihood - innovation.log_pdf(&Vector1::new(9.0)).unwrap()).abs() < 1e-12);
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
        // The recursion of the inverse, `D22 - D21 (J + D11)^-1 D12`, by the general inverse of a matrix.
        let (d11, d12) = (f.transpose() * inverse * f, -f.transpose() * inverse);
        inverse_bound = inverse + information - d12.transpose() * (inverse_bound + d11).try_inverse().unwrap() * d12;
        assert!((bound * inverse_bound - Matrix2::identity()).amax() < 1e-9);
    }
}

#[test]
fn bad_information_is_refused() {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let bad = Matrix2::new(1.0, 0.0, 0.0, -1.0);
    assert!(cramer_rao::covariance_step(&dynamics, &Matrix2::identity(), &bad).is_err());
    assert!(cramer_rao::covariance_step(&dynamics, &bad, &Matrix2::identity()).is_err());
}
