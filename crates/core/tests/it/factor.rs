//! The laws of factors, on every one, and what was once wrong.

use fewbits_core::factor::{Constant, Factor, Feature, Levels, Product, Repeated, Scalar, Value, tilted_by_quadrature};
use fewbits_core::laws::{factor, likelihood};
use fewbits_core::{Cell, Error, Gaussian, Link, Noise, Observed, RangeNoise, Sensing, Sign};
use fewbits_numerics::normal;
use nalgebra::{Matrix1, SMatrix, SVector, Vector1, Vector2};
use proptest::prelude::*;
use rand::Rng;

fn silence(half_width: f64, noise: f64, loss: f64) -> Levels {
    Levels::silence(Cell::new(-half_width, half_width).unwrap(), noise, &Link::lossy(loss).unwrap()).unwrap()
}

/// One of each kind, at unit scale.
fn kinds() -> Vec<Scalar> {
    let link = Link::new(0.2, 0.1).unwrap();
    vec![
        Value::scalar(0.4, 0.7).unwrap().into(),
        Levels::sign(Sign::Above, 0.3, 0.5, &Link::PERFECT).unwrap().into(),
        Levels::sign(Sign::Below, 0.3, 0.5, &link).unwrap().into(),
        Levels::certain(Cell::new(-0.2, 0.9).unwrap(), 0.5).unwrap().into(),
        silence(0.8, 0.5, 0.25).into(),
        silence(0.8, 0.5, 0.0).into(),
        Levels::partition(&[-1.0, 0.3, 1.2], &[0.1, 0.7, 0.0, 0.7], 0.4)
            .unwrap()
            .into(),
        Constant::new(0.3).unwrap().into(),
    ]
}

fn points() -> Vec<Vector1<f64>> {
    [-1e200, -60.0, -3.0, -0.2, 0.0, 0.3, 1.0, 40.0, 1e9]
        .map(Vector1::new)
        .to_vec()
}

#[test]
fn every_factor_obeys_its_laws() {
    let prior = Gaussian::scalar(0.6, 0.9).unwrap();
    for scalar in kinds() {
        factor::is_a_number(&scalar, &points()).unwrap();
        factor::sweep_is_scalar(&scalar, &points()).unwrap();
        factor::tilted_is_quadrature(&scalar, &prior, 12.0, 20_001, 1e-10).unwrap();
        let twice = Repeated::new(scalar.clone(), 2).unwrap();
        factor::sweep_is_scalar(&twice, &points()).unwrap();
        factor::tilted_is_quadrature(&twice, &prior, 12.0, 20_001, 1e-10).unwrap();
        let product: Product = kinds().into_iter().chain([scalar]).collect();
        factor::sweep_is_scalar(&product, &points()).unwrap();
        factor::tilted_is_quadrature(&product, &prior, 12.0, 20_001, 1e-10).unwrap();
    }
}

#[test]
fn a_value_is_the_kalman_update_in_two_dimensions() {
    let prior = Gaussian::new(Vector2::new(1.0, -1.0), SMatrix::<f64, 2, 2>::new(2.0, 0.3, 0.3, 1.0)).unwrap();
    let noise = SMatrix::<f64, 2, 2>::new(0.7, -0.2, -0.2, 0.4);
    let z = Vector2::new(0.2, 0.1);
    let tilted = Value::new(z, noise).unwrap().tilted(&prior).unwrap();
    let total = Gaussian::new(*prior.mean(), prior.covariance() + noise).unwrap();
    let information = prior.covariance().try_inverse().unwrap() + noise.try_inverse().unwrap();
    let covariance = information.try_inverse().unwrap();
    assert!((tilted.log_evidence - total.log_pdf(&z).unwrap()).abs() < 1e-14);
    assert!((tilted.covariance - covariance).amax() < 1e-14);
}

/// Reference values by 50-digit quadrature of the integrand.
#[test]
fn fifteen_lossy_silences_far_from_the_prior() {
    let fifteen = Repeated::new(silence(1.414, 1.0, 0.3).into(), 15).unwrap();
    let tilted = fifteen.tilted(&Gaussian::scalar(4.0, 0.01).unwrap()).unwrap();
    assert!((tilted.mean[0] - 3.9949).abs() < 5e-5, "{tilted:?}");
    assert!((tilted.covariance[0] - 0.01013).abs() < 5e-6, "{tilted:?}");
    let nine = Repeated::new(silence(10.0, 30.0, 0.0).into(), 9).unwrap();
    let tilted = nine.tilted(&Gaussian::scalar(24.0, 0.1).unwrap()).unwrap();
    assert!((tilted.mean[0] - 23.54).abs() < 5e-3, "{tilted:?}");
    assert!((tilted.covariance[0] - 0.0973).abs() < 5e-5, "{tilted:?}");
}

#[test]
fn what_is_out_of_reach_of_the_numbers_is_impossible_and_not_nan() {
    let two = Repeated::new(silence(1.0, 1.0, 0.0).into(), 2).unwrap();
    assert_eq!(two.tilted(&Gaussian::scalar(1e200, 1.0).unwrap()), Err(Error::Impossible));
    let lossy = Repeated::new(silence(1.0, 1.0, 0.3).into(), 2).unwrap();
    let kept = lossy.tilted(&Gaussian::scalar(1e200, 1.0).unwrap()).unwrap();
    assert!((kept.log_evidence - 2.0 * 0.3_f64.ln()).abs() < 1e-12 && kept.mean[0] == 1e200);
    let nothing: Scalar = Constant::new(0.0).unwrap().into();
    assert_eq!(nothing.tilted(&Gaussian::scalar(0.0, 1.0).unwrap()), Err(Error::Impossible));
    let known = Gaussian::scalar(0.4, 0.0).unwrap();
    for scalar in kinds() {
        let twice = Repeated::new(scalar, 2).unwrap();
        let tilted = twice.tilted(&known).unwrap();
        assert!((tilted.log_evidence - twice.log_likelihood(&Vector1::new(0.4))).abs() < 1e-14);
        assert!((tilted.mean[0] - 0.4).abs() < 1e-15 && tilted.covariance[0] == 0.0);
    }
}

#[test]
fn bad_numbers_are_refused_by_name() {
    let cell = Cell::new(-1.0, 1.0).unwrap();
    assert_eq!(Levels::certain(cell, 0.0).unwrap_err().name, "noise_variance");
    assert_eq!(Levels::new(cell, 1.0, -0.1, 0.5).unwrap_err().name, "floor");
    assert_eq!(Levels::new(cell, 1.0, 0.6, 0.6).unwrap_err().name, "floor + weight");
    assert_eq!(Value::scalar(f64::NAN, 1.0).unwrap_err().name, "value");
    assert_eq!(Value::scalar(0.0, -1.0).unwrap_err().name, "noise_variance");
    assert!(Levels::partition(&[0.0, 0.0], &[1.0, 0.0, 0.0], 1.0).is_err());
    assert!(Levels::partition(&[0.0], &[1.0], 1.0).is_err());
    assert!(Levels::partition(&[], &[0.0], 1.0).is_err());
    assert!(Link::new(1.1, 0.0).is_err() && Link::new(0.0, 0.6).is_err() && Link::new(f64::NAN, 0.0).is_err());
    assert!(serde_json::from_str::<Link>(r#"{"loss":2,"crossover":0}"#).is_err());
    assert!(serde_json::from_str::<Link>(r#"{"loss":0.6,"erasure":0.6,"crossover":0}"#).is_err());
    let old = serde_json::from_str::<Link>(r#"{"loss":0.5,"crossover":0.25}"#).unwrap();
    assert_eq!(old, Link::new(0.5, 0.25).unwrap());
    let known = old.with_erasure(0.5).unwrap();
    assert_eq!(serde_json::from_str::<Link>(&serde_json::to_string(&known).unwrap()).unwrap(), known);
    assert!(old.with_erasure(-0.1).is_err() && old.with_erasure(f64::NAN).is_err());
    assert!(serde_json::from_str::<Cell>(r#"{"lower":3,"upper":1}"#).is_err());
    // One rule for infinities: as text. An end that is left out is infinite too.
    let above = Cell::new(0.5, f64::INFINITY).unwrap();
    assert_eq!(serde_json::to_string(&above).unwrap(), r#"{"lower":0.5,"upper":"inf"}"#);
    for text in [
        r#"{"lower":0.5,"upper":"inf"}"#,
        r#"{"lower":0.5,"upper":null}"#,
        r#"{"lower":0.5}"#,
    ] {
        assert_eq!(serde_json::from_str::<Cell>(text).unwrap(), above);
    }
    assert!(serde_json::from_str::<Gaussian<1>>(r#"{"mean":[0],"covariance":[-1]}"#).is_err());
}

#[test]
fn factors_are_stored_and_restored_equal() {
    for scalar in kinds() {
        let json = serde_json::to_string(&scalar).unwrap();
        assert_eq!(serde_json::from_str::<Scalar>(&json).unwrap(), scalar, "{json}");
    }
    let half_line = Cell::new(0.5, f64::INFINITY).unwrap();
    let json = serde_json::to_string(&half_line).unwrap();
    assert_eq!(serde_json::from_str::<Cell>(&json).unwrap(), half_line);
}

/// A line through the plane, seen as one number.
struct Line;

impl Sensing<2, 1> for Line {
    fn mean(&self, x: &Vector2<f64>) -> Vector1<f64> {
        Vector1::new(x[0] - 0.5 * x[1])
    }
    fn jacobian(&self, _: &Vector2<f64>) -> SMatrix<f64, 1, 2> {
        [[1.0], [-0.5]].into()
    }
    fn noise_covariance_at(&self, _: &Vector2<f64>) -> Matrix1<f64> {
        Matrix1::new(0.49)
    }
    fn sample(&self, _: &mut dyn Rng, x: &Vector2<f64>) -> Vector1<f64> {
        self.mean(x)
    }
}

#[test]
fn a_factor_seen_through_a_sensor_is_a_likelihood() {
    let states: Vec<SVector<f64, 2>> = (0..600)
        .map(|i| Vector2::new(0.1 * f64::from(i) - 30.0, (f64::from(i) * 0.7).sin()))
        .collect();
    for scalar in kinds() {
        likelihood::sweep_is_scalar(&vec![Observed::new(Line, scalar.clone()), Observed::new(Line, scalar)], &states)
            .unwrap();
        // By reference, too.
        let first = kinds().swap_remove(0);
        let observed = Observed::new(Line, &first);
        likelihood::sweep_is_scalar(&&observed, &states).unwrap();
    }
}

/// A value of two components in correlated noise, over more than one block.
#[test]
fn a_sweep_of_vectors_is_the_scalar() {
    let value = Value::new(Vector2::new(0.2, 0.1), SMatrix::<f64, 2, 2>::new(0.7, -0.2, -0.2, 0.4)).unwrap();
    let measurements: Vec<_> = (0..203)
        .map(|i| Vector2::new(0.1 * f64::from(i) - 10.0, (f64::from(i) * 0.7).sin()))
        .collect();
    factor::sweep_is_scalar(&value, &measurements).unwrap();
    factor::sweep_is_scalar(&&value, &measurements).unwrap();
}

/// Cells on both sides of what counts as wide, over more than one block.
#[test]
fn sweeps_over_wide_and_narrow_cells_are_the_scalar() {
    let means: Vec<_> = (0..301).map(|i| Vector1::new(0.3 * f64::from(i) - 45.0)).collect();
    for (width, floor) in [(0.4, 0.0), (0.4, 0.1), (1.0, 0.0), (1.5, 0.0), (1.5, 0.1)] {
        let cell = Cell::new(0.2, 0.2 + width).unwrap();
        factor::sweep_is_scalar(&Levels::new(cell, 1.0, floor, 0.8).unwrap(), &means).unwrap();
    }
}

proptest! {
    /// Scaled input gives scaled output, for one observation in closed form and for several by quadrature.
    #[test]
    fn nothing_depends_on_the_unit(
        mean in -8.0..8.0_f64, ln_variance in -8.0..5.0_f64, half in 0.1..3.0_f64, loss in 0.0..0.9_f64,
        count in 1_usize..40, scale in prop::sample::select(vec![1e-4, 1e4]),
    ) {
        let variance = ln_variance.exp();
        let tilt = |s: f64| {
            let cell = Cell::new(-half * s, half * s).unwrap();
            let factor = Levels::silence(cell, s * s, &Link::lossy(loss).unwrap()).unwrap();
            Repeated::new(factor.into(), count).unwrap().tilted(&Gaussian::scalar(mean * s, variance * s * s).unwrap()).unwrap()
        };
        let (one, other) = (tilt(1.0), tilt(scale));
        let deviation = one.covariance[0].sqrt();
        prop_assert!((one.log_evidence - other.log_evidence).abs() < 1e-10 * (1.0 + one.log_evidence.abs()));
        prop_assert!((one.mean[0] - other.mean[0] / scale).abs() < 1e-9 * deviation);
        prop_assert!((other.covariance[0] / (scale * scale) / one.covariance[0] - 1.0).abs() < 1e-9);
        prop_assert!(one.covariance[0] > 0.0);
    }

    /// Quadrature agrees with the closed form that one observation has, wherever the posterior lies.
    #[test]
    fn quadrature_finds_the_posterior_anywhere(
        mean in -300.0..300.0_f64, ln_variance in -12.0..12.0_f64, threshold in -30.0..30.0_f64, ln_noise in -6.0..6.0_f64,
    ) {
        let prior = Gaussian::scalar(mean, ln_variance.exp()).unwrap();
        let bit = Levels::sign(Sign::Above, threshold, ln_noise.exp(), &Link::PERFECT).unwrap();
        let closed = bit.tilted(&prior).unwrap();
        // A constant beside it forces quadrature.
        let product: Product = [bit.into(), Constant::new(1.0).unwrap().into()].into_iter().collect();
        let numeric = product.tilted(&prior).unwrap();
        let deviation = closed.covariance[0].sqrt();
        prop_assert!((numeric.log_evidence - closed.log_evidence).abs() < 1e-9 * (1.0 + closed.log_evidence.abs()));
        prop_assert!((numeric.mean[0] - closed.mean[0]).abs() < 1e-8 * deviation, "{numeric:?} {closed:?}");
        prop_assert!((numeric.covariance[0] / closed.covariance[0] - 1.0).abs() < 1e-7, "{numeric:?} {closed:?}");
    }
}

/// A kink that no feature announces: panels are split until they have found it.
#[test]
fn quadrature_finds_what_nobody_told_it() {
    let (slope, at) = (40.0_f64, 0.377_f64);
    let prior = Gaussian::scalar(0.0, 1.0).unwrap();
    let elsewhere = Feature {
        location: 2.0,
        width: 0.01,
    };
    let tilted = tilted_by_quadrature(&prior, [elsewhere], |m, logs| {
        logs.iter_mut()
            .zip(m)
            .for_each(|(log, m)| *log -= slope * (m - at).abs());
    })
    .unwrap();
    // Two halves of a Laplace kernel under a normal density.
    let half = |sign: f64| 0.5 * slope * slope - sign * slope * at + normal::log_cdf(sign * at - slope);
    let (below, above) = (half(1.0), half(-1.0));
    let exact = below.max(above) + (-(below - above).abs()).exp().ln_1p();
    assert!((tilted.log_evidence - exact).abs() < 1e-10, "{} against {exact}", tilted.log_evidence);
}

#[test]
fn what_goes_into_a_factor_comes_out() {
    let cells = Levels::partition(&[-1.0, 0.3], &[0.1, 0.7, 0.2], 0.4).unwrap();
    let cell = |lower, upper| Cell::new(lower, upper).unwrap();
    let (below, above) = (cell(f64::NEG_INFINITY, -1.0), cell(0.3, f64::INFINITY));
    assert_eq!(cells.pieces(), [(below, 0.1), (cell(-1.0, 0.3), 0.7), (above, 0.2)]);
    assert_eq!(cells.noise(), &Noise::Variance(0.4));
    let inside = Levels::new(cell(-0.2, 0.9), 0.5, 0.1, 0.7).unwrap();
    let (below, above) = (cell(f64::NEG_INFINITY, -0.2), cell(0.9, f64::INFINITY));
    assert_eq!(inside.pieces(), [(below, 0.1), (cell(-0.2, 0.9), 0.1 + 0.7), (above, 0.1)]);
    let twice = Repeated::new(inside.clone().into(), 2).unwrap();
    assert_eq!((twice.factor(), twice.count()), (&Scalar::from(inside), 2));
}

/// A cell that no number can reach is blamed on the floor, where there is one.
#[test]
fn a_cell_out_of_reach_is_blamed_on_the_floor() {
    let far = Gaussian::scalar(1e200, 1.7).unwrap();
    let kept = silence(1.0, 0.5, 0.3).tilted(&far).unwrap();
    assert!((kept.log_evidence - 0.3_f64.ln()).abs() < 1e-15);
    assert_eq!((kept.mean[0], kept.covariance[0]), (1e200, 1.7));
    assert_eq!(silence(1.0, 0.5, 0.0).tilted(&far), Err(Error::Impossible));
}

/// Where every cell that matters is far away the logarithm still is that of the nearest one.
#[test]
fn a_partition_far_away_is_its_nearest_cell() {
    let cells = Levels::partition(&[-1.0, 0.3, 1.2], &[0.1, 0.7, 0.0, 0.0], 0.4).unwrap();
    for m in [20.0, 45.0, 300.0] {
        let want = 0.7_f64.ln() + normal::log_interval((-1.0 - m) / 0.4_f64.sqrt(), (0.3 - m) / 0.4_f64.sqrt());
        assert!((cells.log_probability(m) - want).abs() < 1e-14 * want.abs(), "{m}");
    }
    for m in [-2.3, 0.1, 0.9, 2.2] {
        let p = |lower: f64, upper: f64| normal::interval((lower - m) / 0.4_f64.sqrt(), (upper - m) / 0.4_f64.sqrt());
        let want = 0.1 * p(f64::NEG_INFINITY, -1.0) + 0.7 * p(-1.0, 0.3);
        assert!((cells.log_probability(m) - want.ln()).abs() < 1e-14, "{m}");
    }
    let sure = Levels::partition(&[-1.0, 0.3], &[1.0, 0.99, 1.0], 0.4).unwrap();
    assert_eq!(sure.log_probability(60.0), 0.0);
}

/// Defect: a NaN particle had the likelihood 1 under a partition, alone and in a sweep.
#[test]
fn a_nan_particle_never_gains_weight() {
    let partition = Levels::partition(&[-1.0, 1.0], &[0.2, 0.0, 0.7], 0.5).unwrap();
    assert!(partition.log_probability(f64::NAN).is_nan());
    let mut logs = [0.0; 3];
    partition.add_log_likelihoods(&[&[0.0, f64::NAN, 50.0]], &mut logs);
    assert!(logs[0] < 0.0 && logs[1].is_nan() && (logs[2] - 0.7_f64.ln()).abs() < 1e-12);
    let everywhere = Levels::partition(&[0.0], &[0.5, 0.5], 1.0).unwrap();
    factor::is_a_number(&everywhere, &points()).unwrap();
    factor::sweep_is_scalar(&everywhere, &points()).unwrap();
}

/// Defect: a likelihood of NaN was evidence of NaN at a known prior, and "impossible" at any other.
#[test]
fn a_nan_likelihood_is_blamed_on_the_likelihood() {
    for variance in [0.0, 1.0, 1e-300, 1e300] {
        let prior = Gaussian::scalar(0.4, variance).unwrap();
        for nothing in [f64::NAN, f64::INFINITY] {
            let tilted = tilted_by_quadrature(&prior, [], |_, logs| logs.fill(nothing));
            assert!(matches!(tilted, Err(Error::NotANumber { .. })), "{variance}: {tilted:?}");
        }
        let tilted = tilted_by_quadrature(&prior, [], |_, logs| logs.fill(f64::NEG_INFINITY));
        assert_eq!(tilted, Err(Error::Impossible));
    }
}

/// Defect: a width that underflows made the search for the posterior's edge endless.
#[test]
fn feature_without_width_is_integrated() {
    let prior = Gaussian::scalar(0.0, 1.0).unwrap();
    let step = Feature {
        location: 7.0,
        width: 0.0,
    };
    let half_line = |at: &[f64], logs: &mut [f64]| {
        for (x, log) in at.iter().zip(logs) {
            *log += if *x >= 7.0 { 0.0 } else { f64::NEG_INFINITY };
        }
    };
    let tilted = tilted_by_quadrature(&prior, [step], half_line).unwrap();
    assert!((tilted.log_evidence - normal::log_cdf(-7.0)).abs() < 1e-6, "{tilted:?}");
}

/// Cells, floors and constants in noise of one variance and in noise that grows with the measurement.
fn levels(noise: Noise) -> Vec<Levels> {
    let cell = |lower, upper| Cell::new(lower, upper).unwrap();
    let (above, inside) = (cell(4.0, f64::INFINITY), cell(3.0, 5.5));
    vec![
        Levels::certain(inside, noise).unwrap(),
        Levels::certain(above, noise).unwrap(),
        Levels::new(cell(f64::NEG_INFINITY, 4.0), noise, 0.0, 0.4).unwrap(),
        Levels::new(inside, noise, 0.2, 0.7).unwrap(),
        Levels::certain(inside, noise).unwrap().times_exp(1.7).unwrap(),
        Levels::new(above, noise, 0.2, 0.7).unwrap().times_exp(-0.3).unwrap(),
        Levels::outside(&inside, noise, 0.9).unwrap(),
        Levels::partition(&[2.0, 4.0, 7.0], &[0.1, 0.6, 0.0, 0.3], noise)
            .unwrap()
            .times_exp(0.4)
            .unwrap(),
        Levels::new(inside, noise, 0.3, 0.0).unwrap(),
    ]
}

#[test]
fn levels_obey_the_laws_in_every_noise() {
    let noises = [
        Noise::Variance(0.4),
        RangeNoise::constant(0.6).unwrap().into(),
        RangeNoise::from_snr_db(20.0).unwrap().into(),
        RangeNoise::new(0.2, 0.05).unwrap().into(),
    ];
    for noise in noises {
        for own in levels(noise) {
            let at = [-1e9, -1.0, 0.0, 1e-9, 0.1, 2.0, 5.2, 40.0, 1e9].map(Vector1::new);
            factor::is_a_number(&own, &at).unwrap();
            factor::sweep_is_scalar(&own, &at[1..8]).unwrap();
            let prior = Gaussian::scalar(5.0, 0.4).unwrap();
            factor::tilted_is_quadrature(&own, &prior, 4.9, 60_001, 1e-8).unwrap();
            let json = serde_json::to_string(&own).unwrap();
            assert_eq!(serde_json::from_str::<Levels>(&json).unwrap(), own, "{json}");
            // The pieces are the likelihood without noise.
            let exact: f64 = own
                .pieces()
                .iter()
                .map(|(cell, p)| p * cell.log_probability(4.4, noise.variance(4.4).sqrt()).exp())
                .sum();
            assert!((own.log_probability(4.4) - exact.ln()).abs() < 1e-13, "{own:?}");
        }
    }
}

#[test]
fn stored_levels_are_checked() {
    let good = Levels::partition(&[2.0, 4.0], &[0.1, 0.6, 0.0], 0.5).unwrap();
    let json = serde_json::to_string(&good).unwrap();
    assert!(serde_json::from_str::<Levels>(&json).is_ok());
    for (from, to) in [("0.6", "0.1"), ("0.6", "1.6"), ("0.5", "-0.5"), ("2.0", "3.0")] {
        let changed = json.replacen(from, to, 1);
        assert_ne!(changed, json);
        assert!(serde_json::from_str::<Levels>(&changed).is_err(), "{changed}");
    }
}
