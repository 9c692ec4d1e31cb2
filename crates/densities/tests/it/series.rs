//! Polynomial Gaussians against closed forms.

use fewbits_core::Columns;
use fewbits_densities::{CellOptions, CellTarget, Cells, Component, Lpg};
use nalgebra::{Matrix2, Vector2};

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
