//! Polynomial Gaussians against closed forms.

use fewbits_core::{Belief, Columns, Density};
use fewbits_densities::hermite::gaussian_moment;
use fewbits_densities::{CellOptions, CellTarget, Cells, Component, Lpg, Mixture};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Vector2};
use rand::RngExt;

/// A standard normal density in the plane.
struct Standard;

impl CellTarget<2> for Standard {
    fn evaluate(&self, centres: &Columns<'_, 2>, half: f64, logs: &mut [f64], scores: &mut [f64]) {
        for i in 0..logs.len() {
            let square = centres[0][i] * centres[0][i] + centres[1][i] * centres[1][i];
            (logs[i], scores[i]) = (-0.5 * square, -0.5 * square / (1.0 + half * half));
        }
    }
}

/// The square of the affinity of the root of a standard normal with polynomials of at most this degree about a Gaussian of
/// variance `v` in both coordinates, by Mehler's expansion: the share of degree `2m` of one coordinate is
/// `2 sqrt(v)/(1 + v) binomial(2m, m) (t/2)^2m` with `t = (v - 1)/(v + 1)`.
fn exact_square(v: f64, degree: usize) -> f64 {
    let t = (v - 1.0) / (v + 1.0);
    let mut shares = vec![2.0 * v.sqrt() / (1.0 + v)];
    for m in 1..=degree / 2 {
        let before = shares[m - 1];
        shares.push(before * t * t * (2 * m - 1) as f64 / (2 * m) as f64);
    }
    let pairs = (0..shares.len()).flat_map(|a| (0..shares.len() - a).map(move |b| (a, b)));
    pairs.map(|(a, b)| shares[a] * shares[b]).sum()
}

#[test]
fn affinity_is_that_of_mehlers_expansion() {
    let mut options = CellOptions::default();
    options.keep = 40.0;
    let cells = Cells::cover(&Standard, [-9.0; 2], [10.0; 2], 40, &options).unwrap();
    for v in [0.6, 1.3, 2.5] {
        for degree in [0, 1, 2, 4, 5] {
            let about = Component::new(1.0, Vector2::zeros(), Matrix2::identity() * v).unwrap();
            let fit = Lpg::fit(&cells, &[about], degree).unwrap();
            let exact = exact_square(v, degree).sqrt();
            assert!((fit.affinity - exact).abs() < 1e-5, "{v} {degree}: {} {exact}", fit.affinity);
        }
    }
}

/// Two unequal lobes.
struct Lobes(Mixture<2>);

impl CellTarget<2> for Lobes {
    fn evaluate(&self, centres: &Columns<'_, 2>, half: f64, logs: &mut [f64], scores: &mut [f64]) {
        logs.fill(0.0);
        self.0.add_log_densities(centres, logs);
        for (score, log) in scores.iter_mut().zip(logs) {
            *score = *log / (1.0 + half * half);
        }
    }
}

/// Norm, mean and covariance by summing over a lattice, and draws against these; the bound of a cell against its points.
#[test]
fn a_series_about_two_gaussians_is_one_density() {
    let lobe = |weight, mean, covariance| Component::new(weight, mean, covariance).unwrap();
    let (left, right) = (Vector2::new(-2.0, 0.3), Vector2::new(2.5, -1.0));
    let target = Lobes(
        Mixture::new(vec![
            lobe(0.35, left, Matrix2::new(0.5, 0.2, 0.2, 0.8)),
            lobe(0.65, right, Matrix2::new(1.5, -0.3, -0.3, 0.6)),
        ])
        .unwrap(),
    );
    let mut options = CellOptions::default();
    options.keep = 40.0;
    let cells = Cells::cover(&target, [-9.0; 2], [9.0; 2], 40, &options).unwrap();
    let about = [
        lobe(0.5, left, Matrix2::identity() * 0.6),
        lobe(0.5, right, Matrix2::identity()),
    ];
    let fit = Lpg::fit(&cells, &about, 3).unwrap();
    assert!(fit.affinity > 0.98 && fit.affinity < 1.0, "{}", fit.affinity);
    let belief = fit.belief;

    let (step, mut mass, mut on_the_left) = (0.05, 0.0, 0.0);
    let (mut first, mut second) = (Vector2::zeros(), Matrix2::zeros());
    for i in -200..=200 {
        for j in -200..=200 {
            let x = Vector2::new(f64::from(i), f64::from(j)) * step;
            let p = belief.log_density(&x).exp() * step * step;
            mass += p;
            on_the_left += if x[0] < 0.0 { p } else { 0.0 };
            first += x * p;
            second += x * x.transpose() * p;
        }
    }
    assert!((mass - 1.0).abs() < 1e-9, "{mass}");
    let covariance = second - first * first.transpose();
    assert!((belief.mean() - first).amax() < 1e-8 && (belief.covariance() - covariance).amax() < 1e-8);

    const DRAWS: usize = 40_000;
    let mut rng = Stream::new(11).rng();
    let (mut x, mut y) = (vec![0.0; DRAWS], vec![0.0; DRAWS]);
    belief.sample_columns(&mut rng, [&mut x, &mut y]);
    let share = x.iter().filter(|x| **x < 0.0).count() as f64 / DRAWS as f64;
    assert!((share - on_the_left).abs() < 4.0 * (0.25 / DRAWS as f64).sqrt(), "{share} {on_the_left}");
    for (column, d) in [(&x, 0), (&y, 1)] {
        let mean = column.iter().sum::<f64>() / DRAWS as f64;
        let squares: Vec<f64> = column.iter().map(|x| (x - first[d]).powi(2)).collect();
        let variance = squares.iter().sum::<f64>() / DRAWS as f64;
        let spread = squares.iter().map(|s| (s - variance).powi(2)).sum::<f64>() / DRAWS as f64;
        assert!((mean - first[d]).abs() < 4.0 * (variance / DRAWS as f64).sqrt(), "{mean} {}", first[d]);
        assert!((variance - covariance[(d, d)]).abs() < 4.0 * (spread / DRAWS as f64).sqrt(), "{variance}");
    }

    let mut scratch = Vec::new();
    for half in [1e-3, 0.1, 1.0] {
        for _ in 0..200 {
            let centre = Vector2::from_fn(|_, _| rng.random_range(-5.0..5.0));
            let (density, bound) = belief.log_density_and_bound(&centre, half, &mut scratch);
            assert!((density - belief.log_density(&centre)).abs() < 1e-9 * density.abs().max(1.0));
            assert!(density <= bound + 1e-9, "{density} {bound}");
        }
    }
}

/// Moments of a pair of normal variables by their textbook formulas.
#[test]
fn gaussian_moments_are_the_textbooks() {
    let (m, n, s, t, c) = (0.7, -1.3, 2.0, 0.5, 0.4);
    let (mean, covariance) = (Vector2::new(m, n), Matrix2::new(s, c, c, t));
    let moment = |i, j| gaussian_moment([i, j], &mean, &covariance).unwrap();
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{a} against {b}");
    near(moment(4, 0), m.powi(4) + 6.0 * m * m * s + 3.0 * s * s);
    near(moment(0, 3), n.powi(3) + 3.0 * n * t);
    near(moment(1, 1), m * n + c);
    near(moment(2, 2), m * m * n * n + m * m * t + n * n * s + 4.0 * m * n * c + s * t + 2.0 * c * c);
    assert!(gaussian_moment([21, 20], &mean, &covariance).is_err());
}
