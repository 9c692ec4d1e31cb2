//! Gaussians from a peak against closed forms, in every unit.

use fewbits_densities::Error;
use fewbits_densities::laplace::{Peak, cumulant_laplace, tierney_kadane};
use nalgebra::{Matrix2, Vector1, Vector2};
use std::f64::consts::TAU;

#[test]
fn of_a_gaussian_everything_is_exact() {
    for unit in [1e-4, 1.0, 1e4] {
        let (mean, covariance) = (Vector2::new(2.0, -1.0) * unit, Matrix2::new(2.0, 0.6, 0.6, 0.5) * (unit * unit));
        let precision = covariance.try_inverse().unwrap();
        let log_density = |x: &Vector2<f64>| -0.5 * ((x - mean).transpose() * precision * (x - mean))[0] - 3.0;
        let (start, scale) = (Vector2::new(0.5, 0.5) * unit, Vector2::repeat(unit));
        let peak = Peak::climb(&log_density, &start, &scale).unwrap();
        assert!((peak.mode - mean).amax() < 1e-6 * unit, "{peak:?}");
        assert!((peak.covariance - covariance).amax() < 1e-6 * unit * unit, "{peak:?}");
        let exact = TAU.ln() + 0.5 * covariance.determinant().ln() - 3.0;
        assert!((peak.log_evidence() - exact).abs() < 1e-6, "{} against {exact}", peak.log_evidence());
        let refined = cumulant_laplace(&log_density, &start, &scale).unwrap();
        assert!((refined.mean() - mean).amax() < 1e-6 * unit);
        assert!((refined.covariance() - covariance).amax() < 1e-6 * unit * unit);
        // E exp(x1 / unit) = exp(m + s^2 / 2), a Gaussian ratio too.
        let expected = tierney_kadane(&log_density, &|x| (x[0] / unit).exp(), &start, &scale).unwrap();
        assert!((expected / f64::exp(2.0 + 1.0) - 1.0).abs() < 1e-6, "{expected}");
    }
}

/// A gamma density of shape 9, `x^8 exp(-x)`: mode 8, mean 9, variance 9.
#[test]
fn of_a_skewed_density_the_cumulants_are_closer_than_the_peak() {
    let log_density = |x: &Vector1<f64>| {
        if x[0] > 0.0 {
            8.0 * x[0].ln() - x[0]
        } else {
            f64::NEG_INFINITY
        }
    };
    let (start, scale) = (Vector1::new(6.0), Vector1::new(2.0));
    let peak = Peak::climb(&log_density, &start, &scale).unwrap();
    assert!((peak.mode[0] - 8.0).abs() < 1e-6 && (peak.covariance[0] - 8.0).abs() < 1e-3);
    let refined = cumulant_laplace(&log_density, &start, &scale).unwrap();
    assert!((refined.mean()[0] - 9.0).abs() < 0.02 && (refined.covariance()[0] - 9.0).abs() < 0.2, "{refined:?}");
    let mean = tierney_kadane(&log_density, &|x| x[0], &start, &scale).unwrap();
    assert!((mean - 9.0).abs() < 0.02, "{mean}");
}

#[test]
fn what_has_no_peak_says_so() {
    let ring = |x: &Vector2<f64>| -(x.norm() - 3.0).powi(2);
    let (start, scale) = (Vector2::new(2.0, 0.1), Vector2::repeat(1.0));
    assert!(matches!(Peak::climb(&ring, &start, &scale), Err(Error::NoPeak { .. })));
    assert!(Peak::climb(&ring, &Vector2::new(f64::NAN, 0.0), &scale).is_err());
    assert!(Peak::climb(&ring, &start, &Vector2::zeros()).is_err());
}
