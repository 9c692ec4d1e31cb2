//! The Gaussian belief, square roots of singular covariances.

use fewbits_core::{Belief, Gaussian, laws};
use fewbits_monte_carlo::{Moments, Stream};
use fewbits_numerics::linalg::semidefinite_factor;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use proptest::prelude::*;

#[test]
fn beliefs_that_ran_out_of_range_are_told() {
    let sound = (Vector2::new(1.0, -2.0), Matrix2::new(1.0, 0.5, 0.5, 1.0));
    assert!(Gaussian::from_trusted_parts(sound.0, sound.1).is_finite());
    for k in 0..2 {
        let (mut mean, mut covariance) = sound;
        mean[k] = f64::NEG_INFINITY;
        covariance[(1, k)] = f64::NAN;
        assert!(!Gaussian::from_trusted_parts(mean, sound.1).is_finite());
        assert!(!Gaussian::from_trusted_parts(sound.0, covariance).is_finite());
    }
}

#[test]
fn bad_beliefs_are_refused_by_name() {
    let mean = Vector2::zeros();
    for (covariance, what) in [
        (Matrix2::new(1.0, 0.5, 0.4, 1.0), "symmetric"),
        (Matrix2::new(1.0, 2.0, 2.0, 1.0), "semidefinite"),
        (Matrix2::new(-1.0, 0.0, 0.0, 1.0), "semidefinite"),
        (Matrix2::new(f64::NAN, 0.0, 0.0, 1.0), "finite"),
    ] {
        let error = Gaussian::new(mean, covariance).unwrap_err();
        assert_eq!(error.name, "covariance");
        assert!(error.expected.contains(what), "{error}");
    }
    assert_eq!(
        Gaussian::new(Vector2::new(f64::INFINITY, 0.0), Matrix2::identity())
            .unwrap_err()
            .name,
        "mean"
    );
    assert_eq!(
        Gaussian::scalar(0.0, -1.0).unwrap_err().to_string(),
        "argument `variance` is -1: expected a finite number, 0 or above"
    );
}

#[test]
fn a_singular_belief_is_a_belief_without_density() {
    let rank_one = Vector2::new(0.5, 1.0) * Vector2::new(0.5, 1.0).transpose();
    let belief = Gaussian::new(Vector2::zeros(), rank_one).unwrap();
    assert!(belief.log_pdf(&Vector2::zeros()).is_err());
    let draw = belief.sample(&mut Stream::new(1).rng());
    assert!((draw[1] - 2.0 * draw[0]).abs() < 1e-12);
    assert!(Gaussian::known(Vector2::new(1.0, 2.0)).is_ok());
}

#[test]
fn densities_and_divergences_match_closed_forms() {
    let belief = Gaussian::new(Vector2::new(1.0, -1.0), Matrix2::new(2.0, 0.6, 0.6, 1.0)).unwrap();
    let other = Gaussian::new(Vector2::new(0.0, 0.5), Matrix2::new(1.0, -0.2, -0.2, 3.0)).unwrap();
    let x = Vector2::new(0.3, 0.2);
    let density = |g: &Gaussian<2>, x: &Vector2<f64>| {
        let p = g.covariance();
        let det = p[(0, 0)] * p[(1, 1)] - p[(0, 1)] * p[(1, 0)];
        let d = x - g.mean();
        let quadratic = (p[(1, 1)] * d[0] * d[0] - 2.0 * p[(0, 1)] * d[0] * d[1] + p[(0, 0)] * d[1] * d[1]) / det;
        -0.5 * quadratic - (std::f64::consts::TAU * det.sqrt()).ln()
    };
    assert!((belief.log_pdf(&x).unwrap() - density(&belief, &x)).abs() < 1e-14);
    // KL as an average of log density ratios over draws.
    let mut rng = Stream::new(5).rng();
    let ratios: Moments = (0..40_000)
        .map(|_| {
            let x = belief.sample(&mut rng);
            density(&belief, &x) - density(&other, &x)
        })
        .collect();
    assert!(ratios.estimate().z_score(belief.kl_divergence(&other).unwrap()).abs() < 4.0);
    assert!(belief.kl_divergence(&belief).unwrap().abs() < 1e-14);
}

proptest! {
    #[test]
    fn square_roots_of_any_rank_multiply_back(entries in prop::array::uniform9(-2.0..2.0_f64), rank in 0_usize..=3) {
        let mut g = Matrix3::from_row_slice(&entries);
        for column in rank..3 {
            g.column_mut(column).fill(0.0);
        }
        let p = g * g.transpose();
        let s = semidefinite_factor("p", &p).unwrap();
        prop_assert!((s * s.transpose() - p).amax() <= 1e-10 * (1.0 + p.amax()));
    }

    #[test]
    fn a_clearly_negative_eigenvalue_is_refused(angle in 0.0..3.1_f64, negative in 1e-6..5.0_f64) {
        let (s, c) = angle.sin_cos();
        let q = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let p = q * Matrix3::from_diagonal(&Vector3::new(2.0, -negative, 1.0)) * q.transpose();
        prop_assert!(semidefinite_factor("p", &p).is_err());
    }
}

#[test]
fn normalised_error_of_a_diagonal_belief() {
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::new(4.0, 0.0, 0.0, 1.0)).unwrap();
    assert!((belief.normalised_error_squared(&Vector2::new(2.0, 3.0)).unwrap() - 5.0).abs() < 1e-15);
}

#[test]
fn gaussians_obey_the_laws_of_beliefs() {
    let mut rng = Stream::new(4).rng();
    let belief = Gaussian::new(Vector2::new(1.0, -1e3), Matrix2::new(2.0, 0.6, 0.6, 1.0)).unwrap();
    laws::belief::samples_have_the_moments(&belief, &mut rng, 20_000).unwrap();
    let factored = belief.factored().unwrap();
    laws::belief::samples_have_the_moments(&factored, &mut rng, 20_000).unwrap();
    let wide = Gaussian::new(*belief.mean(), belief.covariance() * 1.5)
        .unwrap()
        .factored()
        .unwrap();
    laws::belief::density_integrates_to_one(&factored, &wide, &mut rng, 20_000).unwrap();
    let known = Gaussian::known(Vector2::new(3.0, 1.0)).unwrap();
    laws::belief::samples_have_the_moments(&known, &mut rng, 100).unwrap();
}
