//! Wild arguments: every constructor and step of this crate returns numbers or an error.

use fewbits_core::{Dynamics, GaussianDynamics, LinearSensing, Sensing};
use fewbits_models::{
    Ar1, Bearing, LinearGaussian, LinearSensor, LogDistance, ReceivedPower, constant_velocity_1d, constant_velocity_2d,
};
use nalgebra::{Matrix2, Vector1, Vector2, Vector4};
use proptest::prelude::*;
use rand::SeedableRng;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(fewbits_core::laws::wild::number)
}

fn numbers(values: &[f64]) -> bool {
    values.iter().all(|x| !x.is_nan())
}

proptest! {
    #[test]
    fn sensing_of_wild_numbers_is_refused_or_numbers(x in prop::array::uniform8(wild()), axis in 0..6_usize) {
        let near = Vector4::new(0.3, -1.0, 2.0, 0.1);
        if let Ok(sensor) = ReceivedPower::<4>::new(Vector2::new(x[0], x[1]), [0, axis], x[2], x[3], x[4], x[5]) {
            for state in [near, Vector4::new(x[6], 0.0, x[7], 1.0)] {
                if state.iter().all(|v| v.is_finite()) {
                    prop_assert!(numbers(sensor.mean(&state).as_slice()), "{:?} {:?}", sensor, state);
                    prop_assert!(numbers(sensor.jacobian(&state).as_slice()), "{:?} {:?}", sensor, state);
                }
            }
            let (mut one, mut two) = ([0.0; 2], [0.0; 3]);
            let column = [near[0]; 2];
            sensor.mean_columns(&[&column, &column, &column, &column], [&mut one]);
            sensor.mean_columns(&[&column, &column, &column, &column], [&mut two]);
            prop_assert!(numbers(&one) && two.iter().all(|v| v.is_nan()));
        }
        if let Ok(sensor) = LinearSensor::<2, 2>::new(Matrix2::new(x[0], x[1], x[2], x[3]), Matrix2::new(x[4], x[5], x[5], x[6])) {
            prop_assert_eq!(sensor.noise_covariance(), &sensor.noise_covariance().transpose());
        }
        if let Ok(sensor) = LinearSensor::<2, 1>::scalar(Vector2::new(x[0], x[1]), x[2]) {
            let _ = sensor.sample(&mut rand_pcg::Pcg64Mcg::seed_from_u64(1), &Vector2::new(x[3], x[4]));
        }
    }

    #[test]
    fn dynamics_of_wild_numbers_are_refused_or_numbers(x in prop::array::uniform8(wild())) {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        if let Ok(ar) = Ar1::new(x[0], x[1]) {
            let state = Vector1::new(0.7);
            prop_assert!(numbers(ar.mean(&state).as_slice()) && numbers(ar.propagate(&mut rng, &state).as_slice()));
            if let Ok(variance) = ar.stationary_variance() {
                prop_assert!(!variance.is_nan() && variance >= 0.0, "{:?}: {}", ar, variance);
            }
        }
        if let Ok(line) = constant_velocity_1d(x[0], x[1]) {
            prop_assert!(numbers(line.noise_covariance_at(&Vector2::zeros()).as_slice()));
        }
        if let Ok(plane) = constant_velocity_2d(x[0], x[1]) {
            let (mut a, mut b) = ([0.0; 3], [1.0; 2]);
            plane.propagate_columns(&mut rng, [&mut a, &mut b, &mut [0.0; 3], &mut [0.0; 3]]);
            prop_assert!(a.iter().chain(&b).all(|v| v.is_nan()));
        }
        let transition = Matrix2::new(x[0], x[1], x[2], x[3]);
        if let Ok(linear) = LinearGaussian::with_covariance(transition, Matrix2::new(x[4], x[5], x[5], x[6])) {
            prop_assert!(numbers(linear.noise_covariance_at(&Vector2::zeros()).as_slice()));
            if let Ok(stationary) = linear.stationary_covariance() {
                prop_assert!(numbers(stationary.as_slice()), "{:?}: {}", linear, stationary);
            }
        }
    }
}

/// Defects: the level heard from 1e300 away was minus infinity, and the slope of a bearing there, or 1e-200 away, was zero.
#[test]
fn places_whose_squares_are_no_numbers_are_sensed() {
    let beacon = LogDistance::new(Vector2::new(0.0, -1e300), -50.0, 2.0, 4.0).unwrap();
    let far = Vector2::new(0.0, 1e300);
    assert!((beacon.mean(&far)[0] - (-50.0 - 20.0 * 2e300_f64.log10())).abs() < 1e-9);
    // Slope: -10 exponent / ln 10 / distance.
    let slope = -20.0 / std::f64::consts::LN_10 / 2e300;
    assert!((beacon.jacobian(&far)[1] / slope - 1.0).abs() < 1e-12);
    let sensor = Bearing::new(Vector2::zeros(), 0.01).unwrap();
    for scale in [1e-200, 1e200, 1e300] {
        let at = Vector2::new(3.0 * scale, 4.0 * scale);
        assert!((sensor.mean(&at)[0] - 4_f64.atan2(3.0)).abs() < 1e-15);
        let slopes = sensor.jacobian(&at) * scale;
        assert!((slopes[0] + 4.0 / 25.0).abs() < 1e-12 && (slopes[1] - 3.0 / 25.0).abs() < 1e-12, "{slopes}");
    }
}
