//! Grids on a line against closed forms of normals.

use fewbits_core::{Density, Gaussian, Likelihood};
use fewbits_densities::{Error, PointMass, UniformGrid};
use nalgebra::{SVector, Vector1};
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
    let impossible = |result: Result<f64, Error>| matches!(result, Err(Error::Impossible));
    let grid = UniformGrid::new(0.0, 2.0, 0.5).unwrap();
    let mut belief = PointMass::new(grid, |x| -x).unwrap();
    let before = belief.clone();
    let no_number = |result: Result<f64, Error>| matches!(result, Err(Error::NotANumber { .. }));
    assert!(impossible(belief.update_with(|_| f64::NEG_INFINITY)) && no_number(belief.update_with(|_| f64::NAN)));
    assert!(impossible(belief.reweight(&[0.0; 5])) && no_number(belief.reweight(&[f64::INFINITY; 5])));
    assert!(belief.reweight(&[1.0; 4]).is_err());
    assert_eq!(belief, before);
    // Where the belief is zero a likelihood may be what it will.
    let mut sided = PointMass::new(grid, |x| if x < 0.6 { 0.0 } else { f64::NEG_INFINITY }).unwrap();
    let evidence = sided.update_with(|x| if x < 0.6 { -2000.0 } else { 500.0 });
    assert!((evidence.unwrap() + 2000.0).abs() < 1e-9 && (sided.density()[0] - 1.0).abs() < 1e-15);
    let belief = PointMass::from_density(grid, vec![0.0, 1.0, 2.0, 1.0, 0.0]).unwrap();
    assert_eq!(belief.density(), [0.0, 0.5, 1.0, 0.5, 0.0]);
    assert_eq!((belief.mean(), belief.variance()), (1.0, 0.125));
    for bad in [
        vec![0.0; 5],
        vec![f64::INFINITY; 5],
        vec![-1.0, 1.0, 1.0, 1.0, 1.0],
        vec![1.0; 4],
    ] {
        assert!(PointMass::from_density(grid, bad).is_err());
    }
}

/// Defect: the density at a distance whose quotient by the spacing overflows was NaN.
#[test]
fn density_at_the_largest_number_is_zero() {
    let line = PointMass::normal(UniformGrid::symmetric(6.0, 0.25).unwrap(), 0.0, 1.0).unwrap();
    for x in [f64::MAX, f64::MIN] {
        assert_eq!(line.log_density(&Vector1::new(x)), f64::NEG_INFINITY);
    }
    assert!(line.log_density(&Vector1::new(f64::NAN)).is_nan());
}
