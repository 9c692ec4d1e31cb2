//! The Gaussian belief, square roots of singular covariances, and likelihoods.

use fewbits_core::likelihood::{Heard, ScalarLikelihood};
use fewbits_core::message::{Cell, Sign};
use fewbits_core::{Gaussian, Likelihood};
use fewbits_monte_carlo::{Moments, Stream};
use fewbits_numerics::linalg::semidefinite_factor;
use nalgebra::{Matrix2, Matrix3, SVector, Vector2, Vector3};
use proptest::prelude::*;

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
    let draw = belief.sample(&mut Stream::new(1).rng()).unwrap();
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
            let x = belief.sample(&mut rng).unwrap();
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

    #[test]
    fn batch_and_single_log_likelihoods_agree(x in prop::array::uniform4(-40.0..40.0_f64), which in 0_usize..5) {
        let heard = [
            Heard::Value(0.4),
            Heard::Bit { sign: Sign::Below, threshold: 0.2, crossover: 0.1 },
            Heard::Cell(Cell::new(-0.5, 0.25).unwrap()),
            Heard::Silence { cell: Cell::new(-1.0, 1.0).unwrap(), loss: 0.2 },
            Heard::Lost,
        ][which];
        let likelihood = ScalarLikelihood::new(SVector::from([1.0, -0.5]), 0.7, heard).unwrap();
        let mut sums = [0.25, -0.5];
        likelihood.add_log_likelihoods([&x[..2], &x[2..]], &mut sums);
        for i in 0..2 {
            let alone = likelihood.log_likelihood(&SVector::from([x[i], x[2 + i]]));
            prop_assert!(!alone.is_nan());
            prop_assert!((sums[i] - [0.25, -0.5][i] - alone).abs() <= 1e-12 * (1.0 + alone.abs()));
        }
    }
}

#[test]
fn what_can_be_heard_has_probability_one() {
    // Both bits, all cells of a partition, speaking or silent: probabilities of exhaustive messages add up to 1.
    let given = |heard| {
        ScalarLikelihood::new(SVector::from([1.0]), 0.7, heard)
            .unwrap()
            .given_mean(0.3)
            .exp()
    };
    let bit = |sign| {
        given(Heard::Bit {
            sign,
            threshold: -0.2,
            crossover: 0.15,
        })
    };
    assert!((bit(Sign::Above) + bit(Sign::Below) - 1.0).abs() < 1e-15);
    let edges = [f64::NEG_INFINITY, -1.0, 0.1, 2.0, f64::INFINITY];
    let cells: f64 = edges
        .windows(2)
        .map(|e| given(Heard::Cell(Cell::new(e[0], e[1]).unwrap())))
        .sum();
    assert!((cells - 1.0).abs() < 1e-15);
    let cell = Cell::new(-0.4, 0.9).unwrap();
    let silent = given(Heard::Silence { cell, loss: 0.3 });
    assert!((silent - (0.3 + 0.7 * given(Heard::Cell(cell)))).abs() < 1e-15);
    for (sd, heard) in [
        (0.0, Heard::Lost),
        (1.0, Heard::Value(f64::NAN)),
        (1.0, Heard::Silence { cell, loss: 1.0 }),
    ] {
        assert!(ScalarLikelihood::new(SVector::from([1.0]), sd, heard).is_err());
    }
}

#[test]
fn normalised_error_of_a_diagonal_belief() {
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::new(4.0, 0.0, 0.0, 1.0)).unwrap();
    assert!((belief.normalised_error_squared(&Vector2::new(2.0, 3.0)).unwrap() - 5.0).abs() < 1e-15);
}
