//! Gaussians from a peak against closed forms, in every unit.

use fewbits_baselines::diffusive::{Peak, cumulant_laplace, tierney_kadane};
use fewbits_diffusive::Error;
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
/// Erratum `diffusive-7`.
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

/// Two independent gamma variables of shapes 9 and 16 under a linear map: `E = A (9, 16)`, covariance `A diag(9, 16) A'`.
#[test]
fn of_mixed_skewed_coordinates_the_cumulants_keep_the_correlation() {
    for unit in [1e-4, 1.0, 1e4] {
        let mix = Matrix2::new(1.0, 0.7, -0.6, 1.1) * unit;
        let inverse = mix.try_inverse().unwrap();
        let log_density = |x: &Vector2<f64>| {
            let g = inverse * x;
            let log = |x: f64, shape: f64| {
                if x > 0.0 {
                    (shape - 1.0) * x.ln() - x
                } else {
                    f64::NEG_INFINITY
                }
            };
            log(g.x, 9.0) + log(g.y, 16.0)
        };
        let (start, scale) = (mix * Vector2::new(7.0, 17.0), Vector2::repeat(3.0 * unit));
        let exact = mix * Matrix2::new(9.0, 0.0, 0.0, 16.0) * mix.transpose();
        let found = cumulant_laplace(&log_density, &start, &scale).unwrap();
        assert!((found.mean() - mix * Vector2::new(9.0, 16.0)).amax() < 0.02 * unit, "{found:?}");
        assert!((found.covariance() - exact).amax() < 0.15 * unit * unit, "{found:?} {exact}");
        let peak = Peak::climb(&log_density, &start, &scale).unwrap();
        assert!((peak.mode - mix * Vector2::new(8.0, 15.0)).amax() < 1e-5 * unit);
        let curvature = mix * Matrix2::new(8.0, 0.0, 0.0, 15.0) * mix.transpose();
        assert!((peak.covariance - curvature).amax() < 1e-4 * unit * unit);
        let gap = (peak.gaussian().covariance() - peak.covariance).amax();
        assert!(*peak.gaussian().mean() == peak.mode && gap < 1e-12 * unit * unit);
    }
}

/// Differences of fourth order are exact on polynomials of fourth degree.
#[test]
fn a_quartic_peak_is_found_exactly_and_cheaply() {
    let hessian = Matrix2::new(2.0, 0.7, 0.7, 1.5);
    let calls = std::cell::Cell::new(0);
    let log_density = |x: &Vector2<f64>| {
        calls.set(calls.get() + 1);
        let (a, b) = (x.x, x.y);
        let quartic = 0.1 * a.powi(4) + 0.05 * a * a * b * b + 0.2 * b.powi(4);
        -0.5 * x.dot(&(hessian * x)) + 0.1 * a.powi(3) - 0.15 * a * a * b - quartic
    };
    let peak = Peak::climb(&log_density, &Vector2::new(0.4, -0.3), &Vector2::new(0.6, 0.8)).unwrap();
    assert!(peak.mode.amax() < 1e-6 && peak.height.abs() < 1e-12, "{peak:?}");
    assert!((peak.covariance - hessian.try_inverse().unwrap()).amax() < 1e-5, "{peak:?}");
    // A Newton step costs 16 values for the derivatives and one for the step.
    assert!(calls.get() < 130, "{}", calls.get());
}

/// Beside a low narrow peak lies a high wide one, a thousand widths away. Where the curvature vanishes, on the flank of the near one,
/// Newton's step would lead there.
#[test]
fn the_climb_ends_on_the_peak_where_it_starts() {
    let log_density = |x: &Vector1<f64>| {
        let far = (x[0] + 1000.0) / 100.0;
        (1.0 / (1.0 + x[0] * x[0]) + 5.0 * (-0.5 * far * far).exp()).ln()
    };
    let peak = Peak::climb(&log_density, &Vector1::new(1.001), &Vector1::new(0.5)).unwrap();
    assert!(peak.mode[0].abs() < 1e-3, "{peak:?}");
}

#[test]
fn plateaus_edges_and_nothing_are_no_peaks() {
    let scale = Vector1::new(1.0);
    let no_peak = |f: &dyn Fn(f64) -> f64, start: f64| {
        Peak::climb(&|x: &Vector1<f64>| f(x[0]), &Vector1::new(start), &scale).unwrap_err()
    };
    assert!(matches!(no_peak(&|_| 1.7, 0.3), Error::NoPeak { .. }));
    let edge = |x: f64| if x < 0.0 { f64::NEG_INFINITY } else { -x };
    assert!(matches!(no_peak(&edge, 1e-3), Error::NoPeak { reason } if reason.contains("finite")));
    assert!(matches!(no_peak(&edge, -1.0), Error::Impossible));
    // It rises for ever.
    assert!(matches!(no_peak(&|x| 0.3 * x, 0.0), Error::NoPeak { .. }));
    let log_density = |x: &Vector1<f64>| -0.5 * x[0] * x[0];
    assert!(tierney_kadane(&log_density, &|_| -1.0, &Vector1::new(0.3), &scale).is_err());
    assert!(tierney_kadane(&log_density, &|_| 0.0, &Vector1::new(0.3), &scale).is_err());
}
