//! Polynomial Gaussians against closed forms.

use fewbits_baselines::diffusive::Lpg;
use fewbits_baselines::diffusive::polynomials::{
    gaussian_moment, hermite, hermite_terms, multi_indices, series_moments,
};
use fewbits_core::{Belief, Columns, Density};
use fewbits_densities::{Component, Mixture};
use fewbits_diffusive::density::{CellOptions, CellTarget, Cells};
use fewbits_monte_carlo::Stream;
use nalgebra::{Complex, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use rand::RngExt;
use std::f64::consts::TAU;

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
    let about = [Component::new(1.0, Vector2::zeros(), Matrix2::identity() * 2.5).unwrap()];
    for degree in [0, 2, 5] {
        let fit = Lpg::fit(&cells, &about, degree).unwrap();
        // A Gaussian has five numbers, a polynomial one for each monomial, and one is the norm's.
        assert_eq!(fit.belief.scalars(), 4 + (degree + 1) * (degree + 2) / 2);
    }
}

/// The first orthonormal Hermite polynomials as the tables have them.
fn he(n: usize, x: f64) -> f64 {
    match n {
        0 => 1.0,
        1 => x,
        2 => (x * x - 1.0) / 2.0_f64.sqrt(),
        3 => (x * x * x - 3.0 * x) / 6.0_f64.sqrt(),
        _ => unreachable!(),
    }
}

/// Every basis function at `x`: `sqrt(N(x; m, S))` times a product of Hermite polynomials of the whitened coordinates, Gaussian
/// by Gaussian.
fn basis<const D: usize>(about: &[Component<D>], degree: usize, x: &SVector<f64, D>) -> Vec<f64> {
    let mut all = Vec::new();
    for c in about {
        let u = c.factor().lower.solve_lower_triangular(&(x - c.mean())).unwrap();
        let root = (0.5 * c.log_pdf(x)).exp();
        for nu in multi_indices::<D>(degree).unwrap() {
            all.push(root * (0..D).map(|d| he(nu[d], u[d])).product::<f64>());
        }
    }
    all
}

fn coefficients<const D: usize>(belief: &Lpg<D>) -> Vec<f64> {
    belief.coefficients().flatten().copied().collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A fit `s` of a root `r` is a multiple of its projection: `int basis r = affinity int basis s` for every basis function, and
/// `int s r` is the affinity. `root` are points with their `r` times volume.
fn is_the_projection<const D: usize>(
    fit: &fewbits_baselines::diffusive::LpgFit<D>,
    about: &[Component<D>],
    root: &[(SVector<f64, D>, f64)],
    (half, step): (i32, f64),
) {
    let (degree, c) = (fit.belief.degree(), coefficients(&fit.belief));
    let mut onto = vec![0.0; c.len()];
    for (x, r) in root {
        onto.iter_mut()
            .zip(basis(about, degree, x))
            .for_each(|(sum, b)| *sum += b * r);
    }
    let mut own = vec![0.0; c.len()];
    let side = (2 * half + 1) as usize;
    for i in 0..side.pow(D as u32) {
        let x = SVector::<f64, D>::from_fn(|d, _| f64::from((i / side.pow(d as u32) % side) as i32 - half) * step);
        let b = basis(about, degree, &x);
        let s = dot(&b, &c) * step.powi(D as i32);
        own.iter_mut().zip(&b).for_each(|(sum, b)| *sum += b * s);
    }
    for (a, b) in onto.iter().zip(&own) {
        assert!((a - fit.affinity * b).abs() < 1e-9, "{a} {}", fit.affinity * b);
    }
    assert!((dot(&onto, &c) - fit.affinity).abs() < 1e-9 && (dot(&own, &c) - 1.0).abs() < 1e-9);
    for (x, _) in root.iter().step_by(root.len() / 50) {
        let log = 2.0 * dot(&basis(about, degree, x), &c).abs().ln();
        assert!((fit.belief.log_density(x) - log).abs() < 1e-6 * log.abs().max(1.0));
        let (column, mut added) = (x.map(|x| [x]), [0.7]);
        let columns: [&[f64]; D] = std::array::from_fn(|d| &column[d][..]);
        fit.belief.add_log_densities(&columns, &mut added);
        assert_eq!(added[0], 0.7 + fit.belief.log_density(x));
    }
}

#[test]
fn a_fit_is_the_projection_onto_its_basis() {
    let lobe = |weight, mean, covariance| Component::new(weight, mean, covariance).unwrap();
    let target = Lobes(
        Mixture::new(vec![
            lobe(0.35, Vector2::new(-1.0, 0.3), Matrix2::new(0.9, 0.2, 0.2, 1.8)),
            lobe(0.65, Vector2::new(1.5, -1.0), Matrix2::new(1.5, -0.3, -0.3, 0.6)),
        ])
        .unwrap(),
    );
    let mut options = CellOptions::default();
    options.keep = 30.0;
    let cells = Cells::cover(&target, [-8.0; 2], [8.0; 2], 30, &options).unwrap();
    let about = [
        lobe(0.4, Vector2::new(-1.2, 0.1), Matrix2::new(0.7, 0.1, 0.1, 1.3)),
        lobe(0.6, Vector2::new(1.4, -0.8), Matrix2::new(1.1, -0.5, -0.5, 0.9)),
    ];
    let fit = Lpg::fit(&cells, &about, 3).unwrap();
    let [x, y] = cells.columns();
    let root: Vec<_> = (0..cells.len())
        .map(|i| (Vector2::new(x[i], y[i]), cells.weights()[i].sqrt() * cells.width()))
        .collect();
    is_the_projection(&fit, &about, &root, (36, 0.25));
    assert_eq!((fit.belief.degree(), fit.belief.scalars()), (3, 29));
    assert!(fit.belief.gaussians().eq(&about));
    // The same belief from its parts, whatever their scale.
    for scale in [1e-3, 250.0] {
        let lists: Vec<Vec<f64>> = fit
            .belief
            .coefficients()
            .map(|c| c.iter().map(|c| c * scale).collect())
            .collect();
        let same = Lpg::new(&about, 3, &lists).unwrap();
        assert!(
            coefficients(&same)
                .iter()
                .zip(coefficients(&fit.belief))
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
        assert!((same.mean() - fit.belief.mean()).amax() < 1e-12);
        assert!(Lpg::new(&about, 3, &lists[1..]).is_err() && Lpg::new(&about, 2, &lists).is_err());
    }
    for bad in [0.0, f64::NAN, f64::INFINITY, 1e200] {
        assert!(Lpg::new(&about[..1], 1, &[vec![bad; 3]]).is_err(), "{bad}");
    }
    assert!(Lpg::new(&about, 21, &[vec![], vec![]]).is_err() && Lpg::<2>::new(&[], 1, &[]).is_err());
    assert!(Lpg::fit(&cells, &[about[0], about[0]], 2).is_err());
}

/// Over cells of the plane with a normal of the third coordinate in each.
#[test]
fn a_lifted_fit_is_the_projection_onto_its_basis() {
    let cells = Cells::cover(&Standard, [-6.0; 2], [6.0; 2], 10, &CellOptions::default()).unwrap();
    let [x, y] = cells.columns();
    let means: Vec<f64> = x
        .iter()
        .zip(y)
        .map(|(x, y)| 0.4 + 0.3 * x - 0.2 * y + 0.05 * x * x)
        .collect();
    let mut variances: Vec<f64> = x.iter().zip(y).map(|(x, y)| 0.6 + 0.2 * (x + 2.0 * y).sin()).collect();
    // What has no width has no overlap.
    let heaviest = (0..cells.len())
        .max_by(|a, b| cells.weights()[*a].total_cmp(&cells.weights()[*b]))
        .unwrap();
    for (off, bad) in [(0, 0.0), (1, f64::NAN), (2, -0.3)] {
        variances[heaviest + off] = bad;
    }
    let about = [
        Component::new(
            0.5,
            Vector3::new(0.3, -0.4, 0.5),
            Matrix3::new(1.3, 0.2, 0.3, 0.2, 0.9, -0.25, 0.3, -0.25, 0.8),
        )
        .unwrap(),
        Component::new(0.5, Vector3::new(-0.7, 0.6, 0.2), Matrix3::new(0.9, -0.1, 0.2, -0.1, 1.2, 0.1, 0.2, 0.1, 0.7))
            .unwrap(),
    ];
    let fit = Lpg::fit_lifted(&cells, &means, &variances, &about, 2).unwrap();
    let mut root = Vec::new();
    let step = 0.2;
    for i in (0..cells.len()).filter(|i| variances[*i] > 0.0) {
        for k in -45..=45 {
            let t = means[i] + f64::from(k) * step;
            let square = (t - means[i]).powi(2) / variances[i];
            let r = (cells.weights()[i] / (TAU * variances[i]).sqrt()).sqrt() * (-0.25 * square).exp();
            root.push((Vector3::new(x[i], y[i], t), r * cells.width() * step));
        }
    }
    is_the_projection(&fit, &about, &root, (22, 0.4));
    assert!(Lpg::fit_lifted(&cells, &means, &variances[1..], &about, 2).is_err());
}

/// The bound of a cell: exact where the cell is a point, and between the most within the cell and the most within one of three
/// times the width where the polynomial is one.
#[test]
fn bounds_of_cells_are_bounds_and_tight() {
    let about = [
        Component::new(0.4, Vector2::new(-1.2, 0.1), Matrix2::new(0.7, 0.1, 0.1, 1.3)).unwrap(),
        Component::new(0.6, Vector2::new(1.4, -0.8), Matrix2::new(1.1, -0.5, -0.5, 0.9)).unwrap(),
    ];
    let lists: Vec<Vec<f64>> = [0.3, -1.1]
        .map(|a| (0..6).map(|i| (a + f64::from(i)).cos()).collect())
        .to_vec();
    let belief = Lpg::new(&about, 2, &lists).unwrap();
    let (c, mut scratch) = (coefficients(&belief), Vec::new());
    let mut rng = Stream::new(17).rng();
    for _ in 0..100 {
        let x = Vector2::from_fn(|_, _| rng.random_range(-4.0..4.0));
        let absolute: f64 = basis(&about, 2, &x).iter().zip(&c).map(|(b, c)| (b * c).abs()).sum();
        let (log, bound) = belief.log_density_and_bound(&x, 1e-13, &mut scratch);
        assert!((bound - 2.0 * absolute.ln()).abs() < 1e-9, "{bound} {}", 2.0 * absolute.ln());
        assert!((log - belief.log_density(&x)).abs() < 1e-9 * log.abs().max(1.0));
    }
    let plain = Lpg::new(&about[..1], 0, &[vec![2.7]]).unwrap();
    for half in [0.01, 0.1, 0.7] {
        for _ in 0..100 {
            let x = Vector2::from_fn(|_, _| rng.random_range(-4.0..4.0));
            let most = |reach: f64| {
                let steps = (-10..=10).flat_map(|i| (-10..=10).map(move |j| Vector2::new(f64::from(i), f64::from(j))));
                steps
                    .map(|g| about[0].log_pdf(&(x + g * (0.1 * reach))))
                    .fold(f64::NEG_INFINITY, f64::max)
            };
            let (_, bound) = plain.log_density_and_bound(&x, half, &mut scratch);
            assert!(
                bound >= most(half) - 1e-12 && bound <= most(3.0 * half).max(about[0].log_pdf(&x) + 3.0 * half) + 1e-12
            );
        }
    }
    // Steep along the diagonal of the cell, in any unit.
    for unit in [1e-3, 1.0, 1e3] {
        let ridge =
            Component::new(1.0, Vector2::zeros(), Matrix2::new(1.0, -0.98, -0.98, 1.0) * (unit * unit)).unwrap();
        let belief = Lpg::new(&[ridge], 0, &[vec![1.0]]).unwrap();
        let at = |x: f64| ridge.log_pdf(&(Vector2::new(x, x) * unit));
        let (_, bound) = belief.log_density_and_bound(&(Vector2::new(1.0, 1.0) * unit), 0.2 * unit, &mut scratch);
        assert!(bound >= at(0.8) - 1e-9 && bound < at(0.6), "{unit}: {bound} {}", at(0.8));
    }
    // A polynomial that vanishes at the centre: in a coarse cell it counts as one, in a fine one as nothing.
    let odd = Lpg::new(&about[..1], 1, &[vec![0.0, -3.0, 0.0]]).unwrap();
    let (log, coarse) = odd.log_density_and_bound(about[0].mean(), 0.6, &mut scratch);
    assert!(log == f64::NEG_INFINITY && (coarse - about[0].log_pdf(about[0].mean())).abs() < 1e-12);
    assert_eq!(odd.log_density_and_bound(about[0].mean(), 1e-3, &mut scratch).1, f64::NEG_INFINITY);
}

/// `nu!` times the coefficient of `t^nu` in `exp(t'z - t'Wt/2)`, by Cauchy's integral over two unit circles.
fn from_the_generating_function(nu: [usize; 2], z: &Vector2<f64>, w: &Matrix2<f64>) -> f64 {
    const NODES: usize = 48;
    let circle = |k: usize| Complex::from_polar(1.0, TAU * k as f64 / NODES as f64);
    let mut sum = 0.0;
    for a in 0..NODES {
        for b in 0..NODES {
            let (s, t) = (circle(a), circle(b));
            let square = s * s * w[(0, 0)] + s * t * (2.0 * w[(0, 1)]) + t * t * w[(1, 1)];
            let value = (s * z.x + t * z.y - square * 0.5).exp();
            sum += (value / (s.powi(nu[0] as i32) * t.powi(nu[1] as i32))).re;
        }
    }
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    sum / (NODES * NODES) as f64 * factorial(nu[0]) * factorial(nu[1])
}

#[test]
fn hermite_polynomials_come_from_their_generating_function() {
    let (z, w) = (Vector2::new(0.7, -1.3), Matrix2::new(1.4, 0.45, 0.45, 0.8));
    for nu in multi_indices::<2>(6).unwrap() {
        let exact = from_the_generating_function(nu, &z, &w);
        let found = hermite(nu, &z, &w).unwrap();
        assert!((found - exact).abs() < 1e-11 * exact.abs().max(1.0), "{nu:?} {found} {exact}");
        let terms = hermite_terms(nu, &w).unwrap();
        let summed: f64 = terms
            .iter()
            .map(|(p, c)| c * z.x.powi(p[0] as i32) * z.y.powi(p[1] as i32))
            .sum();
        assert!((summed - found).abs() < 1e-12 * found.abs().max(1.0));
    }
    let near = |found: Vec<([usize; 2], f64)>, exact: &[([usize; 2], f64)]| {
        assert_eq!(found.iter().map(|t| t.0).collect::<Vec<_>>(), exact.iter().map(|t| t.0).collect::<Vec<_>>());
        assert!(found.iter().zip(exact).all(|(a, b)| (a.1 - b.1).abs() < 1e-14), "{found:?}");
    };
    let (a, b, c) = (w[(0, 0)], w[(0, 1)], w[(1, 1)]);
    let he_22 = [
        ([2, 2], 1.0),
        ([2, 0], -c),
        ([1, 1], -4.0 * b),
        ([0, 2], -a),
        ([0, 0], a * c + 2.0 * b * b),
    ];
    near(hermite_terms([2, 2], &w).unwrap(), &he_22);
    near(hermite_terms([4, 0], &w).unwrap(), &[([4, 0], 1.0), ([2, 0], -6.0 * a), ([0, 0], 3.0 * a * a)]);
    // Terms without a coefficient are left out.
    near(hermite_terms([1, 1], &Matrix2::identity()).unwrap(), &[([1, 1], 1.0)]);
    assert!(hermite([10, 10], &z, &w).is_ok() && hermite([11, 10], &z, &w).is_err());
    assert!(hermite_terms([20, 1], &w).is_err() && multi_indices::<2>(21).is_err());
    assert_eq!(multi_indices::<2>(20).unwrap().len(), 231);
    assert_eq!(
        multi_indices::<3>(2).unwrap()[4..],
        [[2, 0, 0], [1, 1, 0], [1, 0, 1], [0, 2, 0], [0, 1, 1], [0, 0, 2]]
    );
}

/// Against a sum over a lattice.
#[test]
fn series_have_the_moments_of_their_density() {
    let (mean, covariance) = (Vector2::new(0.6, -1.7), Matrix2::new(1.2, 0.4, 0.4, 0.7));
    let w = covariance.try_inverse().unwrap();
    let terms = [
        ([0, 0], 0.8),
        ([1, 0], 0.3),
        ([0, 1], -0.2),
        ([2, 0], 0.1),
        ([1, 1], 0.15),
        ([2, 1], 0.05),
        ([0, 3], -0.04),
    ];
    let gaussian = Component::new(1.0, mean, covariance).unwrap();
    let step = 0.2;
    let (mut mass, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for i in -50..=50 {
        for j in -50..=50 {
            let x = mean + Vector2::new(f64::from(i), f64::from(j)) * step;
            let z = w * (x - mean);
            let series: f64 = terms.iter().map(|(nu, c)| c * hermite(*nu, &z, &w).unwrap()).sum();
            let p = gaussian.log_pdf(&x).exp() * series * step * step;
            (mass, first, second) = (mass + p, first + x * p, second + x * x.transpose() * p);
        }
    }
    let found = series_moments(&mean, &covariance, &terms).unwrap();
    let (first, second): (Vector2<f64>, SMatrix<f64, 2, 2>) = (first / mass, second / mass);
    assert!((found.mass - 0.8).abs() < 1e-14 && (mass - 0.8).abs() < 1e-10, "{found:?}");
    assert!(
        (found.mean - first).amax() < 1e-10 && (found.covariance - second + first * first.transpose()).amax() < 1e-9
    );
    assert!(series_moments(&mean, &covariance, &terms[1..]).is_err());
    assert!(series_moments(&mean, &covariance, &[([0, 0], -0.5)]).is_err());
    assert!(series_moments(&mean, &Matrix2::new(1.0, 2.0, 2.0, 1.0), &terms).is_err());
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

    let (step, mut mass, mut on_the_left) = (0.1, 0.0, 0.0);
    let (mut first, mut second) = (Vector2::zeros(), Matrix2::zeros());
    for i in -100..=100 {
        for j in -100..=100 {
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

    const DRAWS: usize = 15_000;
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
    assert!(gaussian_moment([20, 20], &mean, &covariance).is_ok());
    assert!(gaussian_moment([21, 20], &mean, &covariance).is_err());
}
