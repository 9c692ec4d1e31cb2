//! Quadrature against closed forms.

use fewbits_baselines::mixture_codec::quadrature::{QuadratureGrid, integrated};
use fewbits_core::Belief;
use fewbits_densities::{Component, Mixture};
use nalgebra::{SMatrix, SVector};

fn normal<const D: usize>(mean: [f64; D], covariance: SMatrix<f64, D, D>) -> Mixture<D> {
    Mixture::new(vec![Component::new(1.0, SVector::from(mean), covariance).unwrap()]).unwrap()
}

/// `(tr(Q^-1 P) - D + d' Q^-1 d + ln det Q - ln det P)/2`.
fn exact<const D: usize>(p: &Mixture<D>, q: &Mixture<D>) -> f64 {
    let (s, t) = (p.covariance(), q.covariance());
    let precision = nalgebra::Cholesky::new(t).unwrap().inverse();
    let d = p.mean() - q.mean();
    let log_det = |m: &Mixture<D>| 2.0 * m.components()[0].factor().half_log_det;
    0.5 * ((precision * s).trace() - D as f64 + d.dot(&(precision * d)) + log_det(q) - log_det(p))
}

fn meets_the_closed_form<const D: usize>(p: &Mixture<D>, q: &Mixture<D>) {
    let (d, exact) = (integrated(p, q).unwrap(), exact(p, q));
    assert!((d.kl - exact).abs() < 1e-8, "{d:?} {exact}");
    assert!((d.mass_p - 1.0).abs() < 1e-9 && (d.mass_q - 1.0).abs() < 1e-9, "{d:?}");
}

#[test]
fn normals_in_one_to_three_dimensions_and_uneven_units() {
    let line = |m, s: f64| normal([m], SMatrix::from([[s * s]]));
    for unit in [1e-4, 1.0, 1e4] {
        meets_the_closed_form(&line(20.0 * unit, 3.0 * unit), &line(-10.0 * unit, 40.0 * unit));
        // Half the total difference of two normals of one width is `2 Phi(gap/(2 s)) - 1`.
        let l1 = integrated(&line(0.3 * unit, 0.5 * unit), &line(0.8 * unit, 0.5 * unit))
            .unwrap()
            .l1;
        assert!((l1 - 2.0 * 0.382_924_922_548_026).abs() < 3e-4, "{l1}");
    }
    meets_the_closed_form(
        &normal([300.0, -0.02], SMatrix::from([[900.0, 0.3], [0.3, 4e-4]])),
        &normal([280.0, 0.01], SMatrix::from([[1600.0, -0.2], [-0.2, 9e-4]])),
    );
    meets_the_closed_form(
        &normal([30.0, -0.02, 1.0], SMatrix::from([[9.0, 0.01, 0.6], [0.01, 4e-4, 0.0], [0.6, 0.0, 1.0]])),
        &normal([28.0, -0.01, 1.5], SMatrix::from([[16.0, 0.0, -0.5], [0.0, 6e-4, 0.002], [-0.5, 0.002, 2.0]])),
    );
}

/// The rule sums over all nodes alike, so of functions that do not die out it gives the mean over the box times
/// `prod (n + 1)/n` volumes.
#[test]
fn nodes_lie_where_the_steps_say() {
    // 1.5/0.31, 3/0.7 and 2/0.5 intervals, rounded up.
    let grid = QuadratureGrid::new([1.0, -2.0, 0.5], [2.5, 1.0, 2.5], [0.31, 0.7, 0.5]).unwrap();
    let linear = |x: [&[f64]; 3], out: &mut [f64]| {
        for (i, log) in out.iter_mut().enumerate() {
            *log = 0.3 * x[0][i] - 0.1 * x[1][i] * x[1][i] + x[2][i];
        }
    };
    let d = grid.integrate(|_, out| out.fill(0.0), linear);
    let mass = 1.5 * 6.0 / 5.0 * 3.0 * 6.0 / 5.0 * 2.0 * 5.0 / 4.0;
    // The nodes -2, -1.4 .. 1 have the mean square of a uniform lattice, (n^2 - 1)/12 steps squared, about -1/2.
    let square = 0.25 + 0.36 * 35.0 / 12.0;
    let mean = 0.3 * 1.75 - 0.1 * square + 1.5;
    assert!((d.mass_p - mass).abs() < 1e-12 && (d.kl + mass * mean).abs() < 1e-12, "{d:?}");
    let nodes = |n: usize, from: f64, to: f64| (0..=n).map(move |i| from + (to - from) * i as f64 / n as f64);
    let (mut q, mut l1) = (0.0, 0.0);
    for x in nodes(5, 1.0, 2.5) {
        for y in nodes(5, -2.0, 1.0) {
            for z in nodes(4, 0.5, 2.5) {
                let value = (0.3 * x - 0.1 * y * y + z).exp();
                q += value * 0.3 * 0.6 * 0.5;
                l1 += (value - 1.0).abs() * 0.3 * 0.6 * 0.5;
            }
        }
    }
    assert!((d.mass_q / q - 1.0).abs() < 1e-12 && (d.l1 / l1 - 1.0).abs() < 1e-12, "{d:?} {q} {l1}");
    let holes = grid.integrate(|_, out| out.fill(f64::NEG_INFINITY), linear);
    assert!(holes.kl == 0.0 && holes.mass_p == 0.0);
    // 5e7 nodes are the most; no memory is taken for them.
    assert!(QuadratureGrid::new([0.0; 3], [1.0; 3], [0.002_8; 3]).is_ok());
    assert!(QuadratureGrid::new([0.0; 3], [1.0; 3], [0.002_7; 3]).is_err());
    assert!(QuadratureGrid::new([0.0], [0.0], [0.1]).is_err() && QuadratureGrid::new([0.0], [1.0], [0.0]).is_err());
}
