//! Closed forms of the steady state: limits, monotony, and the loss against the Kalman filter.

use fewbits_baselines::dymbo::contours;
use fewbits_dymbo::{ScalarPlant, filtered_variance};
use std::f64::consts::{FRAC_2_PI, PI};

/// Of unit measurement noise.
fn plant(a: f64, gamma: f64) -> ScalarPlant {
    ScalarPlant::new(a, gamma, 1.0).unwrap()
}

/// Steady filtered variance of the Kalman filter.
fn kalman(a: f64, gamma: f64) -> f64 {
    plant(a, gamma).steady_state(1.0).unwrap().filtered_variance
}

/// Steady variance of the sign-bit filter over that of the Kalman filter.
fn loss(a: f64, gamma: f64) -> f64 {
    plant(a, gamma).loss().unwrap()
}

fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected} within {tolerance}");
}

/// A fast plant leaves one measurement, a slow one keeps its own variance `gamma/(1 - a^2)`.
#[test]
fn kalman_variance_has_its_limits() {
    for a in [0.5, 0.9, 0.99] {
        assert_near(kalman(a, 1e8), 1.0, 1e-7);
        let slack = 1.0 - a * a;
        assert_near(kalman(a, 1e-9) * slack / 1e-9, 1.0, 1e-4 / (slack * slack));
    }
}

/// At gamma = 2 the Kalman variance is no longer about half the measurement's (erratum dymbo-6).
#[test]
fn kalman_variance_at_twice_the_noise() {
    assert_near(kalman(0.9, 2.0), 0.721, 5e-4);
}

/// `n` ratios from `1e-3` to `10`, evenly spaced in the logarithm.
fn ratios(n: i32) -> impl Iterator<Item = f64> {
    (0..n).map(move |i| 10_f64.powf(-3.0 + 4.0 * f64::from(i) / f64::from(n - 1)))
}

#[test]
fn loss_is_even_and_rises_with_coefficient_and_ratio() {
    let line = |a: f64| ratios(400).map(|gamma| loss(a, gamma)).collect::<Vec<_>>();
    let plane: Vec<Vec<f64>> = (0..=200).map(|i| line(f64::from(i) / 200.0)).collect();
    for (i, losses) in (0..).zip(&plane) {
        assert_eq!(*losses, line(-f64::from(i) / 200.0), "even");
        assert!(losses.windows(2).all(|pair| pair[0] < pair[1]), "rises with gamma");
    }
    for pair in plane.windows(2) {
        assert!(pair[0].iter().zip(&pair[1]).all(|(below, above)| below < above), "rises with a");
    }
}

/// The paper's `below 2 whenever gamma < 1` holds for |a| <= 0.979, or gamma <= 0.926; at gamma = 1 the loss exceeds 2 beyond
/// |a| = 0.9793, the exact loss beyond 0.9711 (erratum dymbo-4).
#[test]
fn loss_exceeds_two_in_a_corner() {
    for i in 0..=200 {
        let a = f64::from(i) / 200.0;
        let low = ratios(400).filter(|gamma| a <= 0.979 && *gamma <= 1.0 || *gamma <= 0.926);
        assert!(low.map(|gamma| loss(a, gamma)).all(|loss| loss < 2.0), "a = {a}");
    }
    assert_near(contours::coefficient_at_loss(2.0, 1.0).unwrap().unwrap(), 0.979320618683, 1e-10);
    assert_near(contours::coefficient_at_true_loss(2.0, 1.0).unwrap().unwrap(), 0.971111, 1e-6);
    let corner = (PI / 4.0 * (1.0 + (1.0 + 8.0 / PI).sqrt()) - 1.0) / ((5.0_f64.sqrt() - 1.0) / 2.0);
    assert_near(loss(1.0, 1.0), corner, 1e-12);
}

#[test]
fn loss_has_its_slopes() {
    for a in [0.0_f64, 0.5, 0.9] {
        let slope = (loss(a, 1e-7) - 1.0) / 1e-7;
        assert_near(slope * (1.0 - a * a).powi(2) / (1.0 - FRAC_2_PI), 1.0, 1e-4);
    }
    for a in [0.0, 0.5, 1.0] {
        let expected = (1.0 - FRAC_2_PI) / (1.0 - a * a * (1.0 - FRAC_2_PI));
        assert_near(loss(a, 1e9) / 1e9 / expected, 1.0, 1e-6);
    }
}

/// At a = 1 the loss tends to sqrt(pi/2) as gamma falls, not to pi/2, which is the ratio for a constant parameter (erratum dymbo-5).
#[test]
fn slow_walks_are_no_constants() {
    assert_near(loss(1.0, 1e-20), (PI / 2.0).sqrt(), 1e-9);
    let after = |c: f64| (0..100_000).fold(1.0, |m, _| filtered_variance(m, 1.0, c));
    assert_near(after(FRAC_2_PI) / after(1.0), 1.570889, 1e-6);
}
