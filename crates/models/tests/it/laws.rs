//! The laws of `core`, run on every dynamics and every sensing of this crate.

use fewbits_core::{Dynamics, GaussianDynamics, LinearDynamics, ScaledNoise, Sensing, laws};
use fewbits_models::{
    Ar1, ContinuousLinear, LinearGaussian, LinearSensor, ReceivedPower, constant_velocity_1d, constant_velocity_2d,
};
use nalgebra::{Matrix2, Matrix2x4, SVector, Vector2, Vector4};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const DRAWS: usize = 20_000;

/// Every law of linear dynamics, at every scale.
fn linear<const D: usize>(dynamics: &impl LinearDynamics<D>, states: &[SVector<f64, D>]) {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    laws::dynamics::is_linear(dynamics, states).unwrap();
    for state in states {
        laws::dynamics::jacobian_is_the_derivative(dynamics, state).unwrap();
        laws::dynamics::draws_have_the_law(dynamics, &mut rng, state, DRAWS).unwrap();
        // Process noise of another scale, in columns and one by one; a scale of a scale is their product.
        let scaled = ScaledNoise::new(dynamics, 2.5).times(2.5);
        laws::dynamics::draws_have_the_law(&scaled, &mut Pcg64Mcg::seed_from_u64(8), state, DRAWS).unwrap();
        assert!((scaled.noise_covariance_at(state) - dynamics.noise_covariance() * 6.25).amax() == 0.0);
    }
}

#[test]
fn dynamics() {
    for scale in [1e-4, 1.0, 1e4] {
        linear(&Ar1::new(0.8, 0.5 * scale * scale).unwrap(), &[[3.0 * scale].into(), [-0.2 * scale].into()]);
        linear(&Ar1::new_unstable(-1.3, 0.0).unwrap(), &[[2.0 * scale].into()]);
        let line = constant_velocity_1d(0.7, 2.0 * scale * scale).unwrap();
        linear(&line, &[Vector2::new(1.0, -2.0) * scale]);
        let plane = constant_velocity_2d(1.5, 0.3 * scale * scale).unwrap();
        linear(&plane, &[Vector4::new(1.0, 0.5, -3.0, 2.0) * scale]);
        let noise = Matrix2::new(2.0, 0.9, 0.9, 1.0) * (scale * scale);
        let coloured = LinearGaussian::with_covariance(Matrix2::new(0.9, 0.3, -0.2, 0.7), noise).unwrap();
        linear(&coloured, &[Vector2::new(4.0, -1.0) * scale]);
    }
    linear(&LinearGaussian::from(Ar1::new(0.8, 0.5).unwrap()), &[[3.0].into()]);
}

/// Each part moves as it does alone, and neither knows of the other.
#[test]
fn models_side_by_side_move_as_alone() {
    let (place, level) = (
        ContinuousLinear::nearly_constant_velocity(0.3).unwrap(),
        ContinuousLinear::ornstein_uhlenbeck(20.0, 60.0, 4.0).unwrap(),
    );
    let both = ContinuousLinear::<3>::beside(&place, &level)
        .unwrap()
        .over(2.5)
        .unwrap();
    let (place, level) = (place.over(2.5).unwrap(), level.over(2.5).unwrap());
    for (found, first, second) in [
        (both.transition(), place.transition(), level.transition()),
        (both.noise_covariance(), place.noise_covariance(), level.noise_covariance()),
    ] {
        assert!((found.fixed_view::<2, 2>(0, 0) - first).amax() < 1e-14);
        assert!((found[(2, 2)] - second[(0, 0)]).abs() < 1e-14);
        assert!(found.fixed_view::<2, 1>(0, 2).amax() == 0.0 && found.fixed_view::<1, 2>(2, 0).amax() == 0.0);
    }
    assert!((both.offset()[2] - level.offset()[0]).abs() < 1e-12 && both.offset()[0] == 0.0);
    let line = ContinuousLinear::nearly_constant_velocity(0.3).unwrap();
    assert!(ContinuousLinear::<4>::beside(&line, &line).is_ok());
    let refused = ContinuousLinear::<3>::beside(&line, &line).unwrap_err();
    assert_eq!(refused.argument().unwrap().name, "dimension");
}

#[test]
fn sensing() {
    let states: Vec<Vector4<f64>> = (0..70)
        .map(|i| f64::from(i) * 0.3)
        .map(|t| Vector4::new(t - 8.0, 1.0, 4.0 - 0.4 * t, t.sin()))
        .collect();
    let h = Matrix2x4::new(1.0, 0.0, 0.5, 0.0, 0.0, -2.0, 0.0, 1.0);
    let linear = LinearSensor::new(h, Matrix2::new(2.0, 0.9, 0.9, 1.0)).unwrap();
    laws::sensing::is_consistent(&linear, &states).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    laws::sensing::draws_have_the_law(&linear, &mut rng, &states[3], DRAWS).unwrap();
    for exponent in [1.0, 1.5, 2.0, 3.7] {
        let power = ReceivedPower::<4>::new(Vector2::new(1.0, -2.0), [0, 2], 50.0, 0.3, exponent, 1.7).unwrap();
        laws::sensing::is_consistent(&power, &states).unwrap();
        laws::sensing::draws_have_the_law(&power, &mut rng, &states[3], DRAWS).unwrap();
        // One normal number a component, to the last bit.
        let normal: f64 = rng.clone().sample(rand_distr::StandardNormal);
        let expected = power.mean(&states[3])[0] + 1.7_f64.sqrt() * normal;
        assert_eq!(power.sample(&mut rng, &states[3])[0], expected);
    }
}

#[test]
fn with_all_traits_in_scope_no_method_is_ambiguous() {
    let model = Ar1::new(0.9, 2.0).unwrap();
    assert_eq!((model.noise_covariance()[0], model.mean(&[2.0].into())[0]), (2.0, 1.8));
    assert_eq!(LinearSensor::direct(0.5).unwrap().mean(&[2.0].into())[0], 2.0);
}

#[test]
fn stored_models_come_back_equal_and_checked() {
    fn restored<T: serde::Serialize + serde::de::DeserializeOwned>(model: &T) -> T {
        serde_json::from_str(&serde_json::to_string(model).unwrap()).unwrap()
    }
    let ar1 = Ar1::new(0.9, 0.1).unwrap();
    assert_eq!(restored(&ar1), ar1);
    let line = constant_velocity_1d(0.7, 2.0).unwrap();
    assert_eq!(restored(&line), line);
    let sensor = LinearSensor::direct(0.3).unwrap();
    assert_eq!(restored(&sensor), sensor);
    let power = ReceivedPower::<4>::new(Vector2::new(1.0, -2.0), [0, 2], 50.0, 0.3, 2.0, 1.7).unwrap();
    assert_eq!(restored(&power), power);
    for bad in [r#"{"coefficient":0.9,"noise_variance":-1.0}"#, r#"{"coefficient":0.9}"#] {
        assert!(serde_json::from_str::<Ar1>(bad).is_err());
    }
    assert!(serde_json::from_str::<LinearSensor<1, 1>>(r#"{"matrix":[1.0],"noise_covariance":[0.0]}"#).is_err());
    assert!(serde_json::from_str::<LinearSensor<1, 1>>(r#"{"matrix":[1.0],"noise_covariance":[2.0]}"#).is_ok());
}

/// The same stream gives the same noise, whatever the type that holds the numbers: runs with common random numbers rely on it.
#[test]
fn noise_is_the_draw_times_its_deviation() {
    let rng = || Pcg64Mcg::seed_from_u64(17);
    let model = Ar1::new(-0.7, 2.9).unwrap();
    let vector = LinearGaussian::from(model);
    for state in [1.3, -0.4] {
        let (one, other) =
            (model.propagate(&mut rng(), &[state].into()), vector.propagate(&mut rng(), &[state].into()));
        assert!((one - other).amax() < 1e-15);
    }
    let (mut one, mut other) = ([1.3, -0.4, 2.2], [1.3, -0.4, 2.2]);
    model.propagate_columns(&mut rng(), [&mut one]);
    vector.propagate_columns(&mut rng(), [&mut other]);
    assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-15), "{one:?} {other:?}");
    let power = ReceivedPower::<4>::new(Vector2::new(1.0, -2.0), [0, 2], 50.0, 0.3, 2.0, 1.7).unwrap();
    let state = Vector4::new(0.3, 1.0, -0.8, 2.0);
    let noise = LinearSensor::direct(1.7).unwrap().sample(&mut rng(), &[0.0].into());
    assert!((power.sample(&mut rng(), &state) - power.mean(&state) - noise).amax() < 1e-14);
}
