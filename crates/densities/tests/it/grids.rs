//! Grids on a line and over the plane against closed forms of normals.

use fewbits_core::{Belief, Density, Error as CoreError, Gaussian, Likelihood};
use fewbits_densities::{Error, PlaneMass, PointMass, UniformGrid};
use nalgebra::{Matrix2, SVector, Vector1, Vector2};
use std::f64::consts::TAU;

/// A linear measurement with normal noise.
struct Measured<const D: usize> {
    row: SVector<f64, D>,
    value: f64,
    variance: f64,
}

impl<const D: usize> Likelihood<D> for Measured<D> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        let gap = self.value - self.row.dot(state);
        -0.5 * (gap * gap / self.variance + (TAU * self.variance).ln())
    }
}

impl<const D: usize> Measured<D> {
    /// Kalman's update, and the log evidence.
    fn posterior(&self, mean: &SVector<f64, D>, covariance: &nalgebra::SMatrix<f64, D, D>) -> (Gaussian<D>, f64) {
        let cross = covariance * self.row;
        let total = self.row.dot(&cross) + self.variance;
        let gap = self.value - self.row.dot(mean);
        let updated = covariance - cross * cross.transpose() / total;
        let updated = (updated + updated.transpose()) * 0.5;
        let log = -0.5 * (gap * gap / total + (TAU * total).ln());
        (Gaussian::new(mean + cross * (gap / total), updated).unwrap(), log)
    }
}

#[test]
fn nodes_are_where_they_are_said_to_be() {
    let grid = UniformGrid::new(-1.3, 2.0, 0.7).unwrap();
    assert_eq!((grid.points(), grid.spacing()), (6, 0.7));
    assert!((grid.node(5) - 2.2).abs() < 1e-15 && grid.nodes().eq((0..6).map(|i| grid.node(i))));
    assert_eq!(UniformGrid::new(0.0, 3.0, 0.75).unwrap().points(), 5);
    for (half, spacing, points) in [(1.0, 0.3, 9), (1.2, 0.4, 7), (0.1, 0.3, 3), (3e4, 1e4, 7)] {
        let grid = UniformGrid::symmetric(half, spacing).unwrap();
        assert_eq!(grid.points(), points);
        for i in 0..points {
            assert!((grid.node(i) + grid.node(points - 1 - i)).abs() < 1e-12 * half);
        }
        assert!(grid.node(points - 1) >= half * (1.0 - 1e-12));
    }
    for (lower, upper) in [
        (-0.9, 1.1),
        (-5.0, 9.0),
        (-1.3, -1.3),
        (0.11, 0.12),
        (2.3, 9.0),
        (-9.0, -2.0),
        (1.0, -1.0),
    ] {
        let within: Vec<usize> = grid.indices_within(lower, upper).collect();
        let exact: Vec<usize> = (0..6).filter(|i| (lower..=upper).contains(&grid.node(*i))).collect();
        assert_eq!(within, exact, "{lower} {upper}");
    }
    let refused = [
        (0.0, 0.0, 1.0),
        (1.0, 0.0, 1.0),
        (0.0, 1.0, 0.0),
        (0.0, 1.0, 9e-7),
        (f64::NAN, 1.0, 0.1),
        (0.0, f64::INFINITY, 0.1),
    ];
    assert!(
        refused
            .iter()
            .all(|(lower, upper, spacing)| UniformGrid::new(*lower, *upper, *spacing).is_err())
    );
    assert!(
        UniformGrid::new(0.0, 1.0, 1.1e-6).is_ok()
            && UniformGrid::symmetric(0.0, 1.0).is_err()
            && UniformGrid::symmetric(1.0, -1.0).is_err()
    );
    // Stored ones are checked alike: bounds must be numbers, not their products.
    let stored = |text: &str| serde_json::from_str::<UniformGrid>(text);
    assert_eq!(stored(r#"{"lower":1e200,"spacing":1e150,"points":3}"#).unwrap().node(0), 1e200);
    assert!(stored(r#"{"lower":1.7e308,"spacing":1e307,"points":3}"#).is_err());
    assert!(stored(r#"{"lower":0.0,"spacing":1e308,"points":3}"#).is_err());
    assert!(stored(r#"{"lower":0.0,"spacing":1.0,"points":1000001}"#).is_err());
}

#[test]
fn on_a_line_bayes_rule_is_kalmans() {
    for unit in [1e-4, 1.0, 1e4] {
        let measured = Measured {
            row: Vector1::new(1.7),
            value: 2.9 * unit,
            variance: 0.8 * unit * unit,
        };
        let prior =
            PointMass::normal(UniformGrid::symmetric(12.0 * unit, 0.2 * unit).unwrap(), 0.3 * unit, 1.6 * unit * unit)
                .unwrap();
        let (exact, log) = measured.posterior(&Vector1::new(0.3 * unit), &nalgebra::Matrix1::new(1.6 * unit * unit));
        let mut belief = prior.clone();
        assert!((belief.update(&measured).unwrap() - log).abs() < 1e-9);
        assert!((belief.mean() - exact.mean()[0]).abs() < 1e-9 * unit);
        assert!((belief.variance() - exact.covariance()[0]).abs() < 1e-9 * unit * unit);
        let cube = belief.expectation(|x| x * x * x);
        let (m, v) = (exact.mean()[0], exact.covariance()[0]);
        assert!((cube - m * m * m - 3.0 * m * v).abs() < 1e-8 * unit.powi(3));
        let mut other = prior.clone();
        let log = |x: f64| measured.log_likelihood(&Vector1::new(x));
        let evidence = other.update_with(log).unwrap();
        assert!(other == belief);
        // The same from a table, up to a factor.
        let table: Vec<f64> = prior.grid().nodes().map(|x| 3.0 * log(x).exp()).collect();
        let mut third = prior.clone();
        assert!((third.reweight(&table).unwrap().ln() - 3.0_f64.ln() - evidence).abs() < 1e-9);
        assert!(
            third
                .density()
                .iter()
                .zip(belief.density())
                .all(|(a, b)| (a - b).abs() < 1e-12 / unit)
        );
        // Linear between the nodes.
        let (a, b) = (belief.grid().node(66), belief.grid().node(67));
        let p = |x: f64| belief.log_density(&Vector1::new(x)).exp();
        assert!((p(a + 0.3 * (b - a)) - 0.7 * p(a) - 0.3 * p(b)).abs() < 1e-12 / unit);
        assert!((p(a) - belief.density()[66]).abs() < 1e-12 / unit);
        assert_eq!((p(-12.3 * unit), p(12.3 * unit)), (0.0, 0.0));
        let last = belief.density().len() - 1;
        assert!((p(12.1 * unit) - 0.5 * belief.density()[last]).abs() < 1e-12 / unit);
    }
}

#[test]
fn what_is_impossible_leaves_a_density_behind() {
    let impossible = |result: Result<f64, Error>| matches!(result, Err(Error::Core(CoreError::Impossible)));
    let grid = UniformGrid::new(0.0, 2.0, 0.5).unwrap();
    let mut belief = PointMass::new(grid, |x| -x).unwrap();
    let before = belief.clone();
    let no_number = |result: Result<f64, Error>| matches!(result, Err(Error::Core(CoreError::NotANumber { .. })));
    assert!(impossible(belief.update_with(|_| f64::NEG_INFINITY)) && no_number(belief.update_with(|_| f64::NAN)));
    assert!(impossible(belief.reweight(&[0.0; 5])) && no_number(belief.reweight(&[f64::INFINITY; 5])));
    assert!(belief.reweight(&[1.0; 4]).is_err());
    assert_eq!(belief, before);
    // Where the belief is zero a likelihood may be what it will.
    let mut sided = PointMass::new(grid, |x| if x < 0.6 { 0.0 } else { f64::NEG_INFINITY }).unwrap();
    let evidence = sided.update_with(|x| if x < 0.6 { -2000.0 } else { 500.0 });
    assert!((evidence.unwrap() + 2000.0).abs() < 1e-9 && (sided.density()[0] - 1.0).abs() < 1e-15);
    belief
        .refill(|density| density.copy_from_slice(&[0.0, 1.0, 2.0, 1.0, 0.0]))
        .unwrap();
    assert_eq!(belief.density(), [0.0, 0.5, 1.0, 0.5, 0.0]);
    assert_eq!((belief.mean(), belief.variance()), (1.0, 0.125));
    assert!(belief.refill(|density| density.fill(0.0)).is_err());
    assert_eq!(belief.density(), [0.4; 5]);
    assert!(belief.refill(|density| density.fill(f64::INFINITY)).is_err());
    assert_eq!(belief.density(), [0.4; 5]);
    let mut plane =
        PlaneMass::normal(&Matrix2::identity(), &Gaussian::new(Vector2::zeros(), Matrix2::identity() * 4.0).unwrap())
            .unwrap();
    let before = plane.clone();
    assert!(impossible(plane.update_with(|_| f64::NEG_INFINITY)));
    assert_eq!(plane, before);
}

#[test]
fn over_the_plane_bayes_rule_is_kalmans() {
    for unit in [1e-4, 1.0, 1e4] {
        let (mean, covariance) = (Vector2::new(2.0, -1.3) * unit, Matrix2::new(2.0, 0.6, 0.6, 1.1) * (unit * unit));
        let measured = Measured {
            row: Vector2::new(0.8, -0.5),
            value: 0.9 * unit,
            variance: 0.7 * unit * unit,
        };
        let basis = Matrix2::new(0.35, -0.05, 0.1, 0.3) * unit;
        let prior = PlaneMass::normal(&basis, &Gaussian::new(mean, covariance).unwrap()).unwrap();
        assert_eq!((prior.basis(), prior.area()), (&basis, basis.determinant().abs()));
        let (exact, log) = measured.posterior(&mean, &covariance);
        let mut belief = prior.clone();
        assert!((belief.update(&measured).unwrap() - log).abs() < 1e-9);
        assert!((Belief::mean(&belief) - exact.mean()).amax() < 1e-8 * unit);
        assert!((Belief::covariance(&belief) - exact.covariance()).amax() < 1e-8 * unit * unit);
        let mut other = prior.clone();
        let evidence = other.update_with(|x| measured.log_likelihood(x)).unwrap();
        assert!((evidence - log).abs() < 1e-9 && other == belief);

        // Nodes in storage order cover seven deviations and no more.
        let (first, size) = (prior.first(), prior.size());
        let nodes: Vec<Vector2<f64>> = prior.nodes().collect();
        assert_eq!((nodes.len(), prior.density().len()), (size[0] * size[1], size[0] * size[1]));
        assert_eq!(nodes[0], Vector2::new(first[0] as f64, first[1] as f64));
        assert_eq!(nodes[size[1] + 2], nodes[0] + Vector2::new(1.0, 2.0));
        let inverse = basis.try_inverse().unwrap();
        let (centre, spread) = (inverse * mean, inverse * covariance * inverse.transpose());
        for axis in 0..2 {
            let reach = 7.0 * spread[(axis, axis)].sqrt();
            let (low, high) = (nodes[0][axis], nodes[nodes.len() - 1][axis]);
            assert!(low <= centre[axis] - reach && low > centre[axis] - reach - 1.0);
            assert!(high >= centre[axis] + reach && high < centre[axis] + reach + 1.0);
        }
        // At a node, between four, and off the lattice.
        let index = size[0] / 2 * size[1] + size[1] / 2;
        let p = |n: Vector2<f64>| prior.log_density(&(basis * n)).exp();
        let normal = Gaussian::new(mean, covariance).unwrap().factored().unwrap();
        let (at, own) = (nodes[index], |n: Vector2<f64>| normal.log_pdf(&(basis * n)).exp());
        for n in [at, at + Vector2::new(3.0, -2.0)] {
            assert!((p(n) / own(n) - 1.0).abs() < 1e-7);
        }
        let (x, y) = (Vector2::x(), Vector2::y());
        let between =
            0.7 * 0.4 * own(at) + 0.3 * 0.4 * own(at + x) + 0.7 * 0.6 * own(at + y) + 0.3 * 0.6 * own(at + x + y);
        assert!((p(at + x * 0.3 + y * 0.6) / between - 1.0).abs() < 1e-7);
        let last = nodes[nodes.len() - 1];
        for (inside, beyond) in [(nodes[0], -x), (nodes[0], -y), (last, x), (last, y)] {
            assert!(p(inside) > 0.0 && p(inside + beyond * 0.5) > 0.0 && p(inside + beyond * 1.1) == 0.0);
        }
    }
}

#[test]
fn lattices_that_cannot_be_are_refused_by_name() {
    let unit = Gaussian::new(Vector2::zeros(), Matrix2::identity()).unwrap();
    let refused =
        |basis: Matrix2<f64>, belief: &Gaussian<2>| PlaneMass::normal(&basis, belief).unwrap_err().to_string();
    assert!(refused(Matrix2::new(1.0, 2.0, 2.0, 4.0), &unit).contains("basis"));
    assert!(refused(Matrix2::identity() * 1e-3, &unit).contains("million"));
    let flat = Gaussian::new(Vector2::zeros(), Matrix2::new(1.0, 1.0, 1.0, 1.0)).unwrap();
    assert!(refused(Matrix2::identity() * 0.1, &flat).contains("covariance"));
    for far in [Vector2::new(1e17, 0.0), Vector2::new(0.0, -1e17)] {
        let belief = Gaussian::new(far, Matrix2::identity()).unwrap();
        assert!(refused(Matrix2::identity(), &belief).contains("impossible"));
    }
    let stored = |text: &str| serde_json::from_str::<PlaneMass>(text).unwrap_err().to_string();
    let density = r#""density":[0.5,0.5]"#;
    let huge = stored(&format!(r#"{{"basis":[1e200,0.0,0.0,1e200],"first":[0,0],"size":[2,1],{density}}}"#));
    assert!(huge.contains("basis"), "{huge}");
    let flat = stored(&format!(r#"{{"basis":[1.0,2.0,2.0,4.0],"first":[0,0],"size":[2,1],{density}}}"#));
    assert!(flat.contains("basis"), "{flat}");
    for (first, size) in [
        ("[0,0]", "[2,0]"),
        ("[0,0]", "[1001,1000]"),
        ("[2251799813685248,0]", "[2,1]"),
        ("[0,-2251799813685248]", "[2,1]"),
    ] {
        let error = stored(&format!(r#"{{"basis":[1.0,0.0,0.0,1.0],"first":{first},"size":{size},{density}}}"#));
        assert!(error.contains("million"), "{error}");
    }
    assert!(PlaneMass::covering(&Matrix2::identity(), &unit, |_, density| density.fill(0.0)).is_err());
    let flat = PlaneMass::covering(&(Matrix2::identity() * 0.5), &unit, |_, density| density.fill(3.0)).unwrap();
    // A uniform lattice of n nodes has variance (n^2 - 1)/12 steps squared.
    assert_eq!(flat.size(), [29, 29]);
    assert!((flat.moments().covariance()[(0, 0)] - 0.25 * 840.0 / 12.0).abs() < 1e-9);
    assert!((flat.density()[7] - 4.0 / 841.0).abs() < 1e-15);
}

/// Defect: the density at a distance whose quotient by the spacing overflows was NaN.
#[test]
fn density_at_the_largest_number_is_zero() {
    let line = PointMass::normal(UniformGrid::symmetric(6.0, 0.25).unwrap(), 0.0, 1.0).unwrap();
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::identity()).unwrap();
    let plane = PlaneMass::normal(&(Matrix2::identity() * 0.5), &belief).unwrap();
    for x in [f64::MAX, f64::MIN] {
        assert_eq!(line.log_density(&Vector1::new(x)), f64::NEG_INFINITY);
        assert_eq!(plane.log_density(&Vector2::new(0.1, x)), f64::NEG_INFINITY);
    }
    assert!(line.log_density(&Vector1::new(f64::NAN)).is_nan());
}

/// Defect: the moments of a lattice over a covariance near the largest number were infinite.
#[test]
fn beliefs_whose_squares_overflow_are_impossible() {
    let belief =
        Gaussian::new(Vector2::new(-1.6, 1e154), Matrix2::from_diagonal(&Vector2::new(1.8, f64::MAX))).unwrap();
    let basis = Matrix2::from_diagonal(&belief.standard_deviations());
    assert_eq!(PlaneMass::normal(&basis, &belief).unwrap_err(), Error::Core(CoreError::Impossible));
}
