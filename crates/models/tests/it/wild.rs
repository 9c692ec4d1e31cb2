//! Wild arguments: every constructor and step of this crate returns numbers or an error.

use fewbits_core::{Dynamics, GaussianDynamics, Sensing};
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, ReceivedPower, constant_velocity_1d, constant_velocity_2d};
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
