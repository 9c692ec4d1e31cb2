//! The filter on a lattice against Kalman's and the scalar filter.

use fewbits_filters::{Error, Lattice, LatticeKernel, PointMass, TransitionKernel, UniformGrid};
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::TAU;

/// Logarithms of a normal density at the nodes.
fn measured(at: impl Iterator<Item = f64>, value: f64, deviation: f64) -> Vec<f64> {
    let log = |x: f64| -0.5 * ((value - x) / deviation).powi(2) - (deviation * TAU.sqrt()).ln();
    at.map(log).collect()
}

/// Place and speed with noise on both, of which the sum is measured, in any unit.
#[test]
fn a_linear_model_is_kalmans() {
    for unit in [1e-4, 1.0, 1e4] {
        let axes = vec![UniformGrid::new(-9.0 * unit, 9.0 * unit, 0.2 * unit).unwrap(); 2];
        let mut belief = Lattice::normal(axes, &[unit, -0.5 * unit], &[unit, 0.5 * unit]).unwrap();
        let (x, y) = (belief.positions(0), belief.positions(1));
        let means = [
            x.iter().zip(&y).map(|(x, y)| 0.8 * x + 0.5 * y).collect(),
            y.iter().map(|y| 0.9 * y).collect(),
        ];
        let deviations = [vec![0.4 * unit; x.len()], vec![0.3 * unit; x.len()]];
        let filter = LatticeKernel::new(means, deviations, &belief).unwrap();
        let (transition, noise) = (Matrix2::new(0.8, 0.5, 0.0, 0.9), Matrix2::new(0.16, 0.0, 0.0, 0.09));
        let (mut mean, mut covariance) = (Vector2::new(1.0, -0.5), Matrix2::new(1.0, 0.0, 0.0, 0.25));
        for z in [0.7, -0.2, 1.1, 0.4] {
            belief = filter.predict(&belief).unwrap();
            let sums = x.iter().zip(&y).map(|(x, y)| x + y);
            let evidence = belief.update(&measured(sums, z * unit, 0.6 * unit)).unwrap();
            (mean, covariance) = (transition * mean, transition * covariance * transition.transpose() + noise);
            let (row, gap) = (Vector2::new(1.0, 1.0), z - mean.sum());
            let total = (row.transpose() * covariance * row)[0] + 0.36;
            let gain = covariance * row / total;
            (mean, covariance) = (mean + gain * gap, covariance - gain * row.transpose() * covariance);
            let expected = -0.5 * (gap * gap / total + (TAU * total).ln()) - unit.ln();
            assert!((evidence - expected).abs() < 1e-9, "{unit}: {evidence} {expected}");
            for (i, (m, variance)) in belief.moments().into_iter().enumerate() {
                assert!((m / unit - mean[i]).abs() < 1e-9, "{unit}: {m} {mean}");
                assert!((variance / unit / unit - covariance[(i, i)]).abs() < 1e-9, "{unit}: {variance} {covariance}");
            }
        }
    }
}

/// A mean and a deviation that depend on the state, and a likelihood of two peaks.
#[test]
fn one_axis_is_the_scalar_filter() {
    let grid = UniformGrid::new(-6.0, 6.0, 0.1).unwrap();
    let moved: Vec<(f64, f64)> = grid.nodes().map(|x| (x.sin(), 0.3 + 0.1 * x.cos())).collect();
    let line = TransitionKernel::from_transitions(grid, &moved).unwrap();
    let (mut a, mut b) =
        (PointMass::normal(grid, 0.5, 1.0).unwrap(), Lattice::normal(vec![grid], &[0.5], &[1.0]).unwrap());
    let (means, deviations) = moved.into_iter().unzip();
    let filter = LatticeKernel::new([means], [deviations], &b).unwrap();
    for z in [0.4, 0.9] {
        let logs = measured(grid.nodes().map(f64::abs), z, 0.2);
        (a, b) = (line.predict(&a).unwrap(), filter.predict(&b).unwrap());
        let weights: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
        let (first, second) = (a.reweight(&weights).unwrap().ln(), b.update(&logs).unwrap());
        assert!((first - second).abs() < 1e-12, "{first} {second}");
        for (p, q) in a.density().iter().zip(b.density()) {
            assert!((p - q).abs() < 1e-12, "{p} {q}");
        }
    }
}

/// A density of independent numbers keeps its factors.
#[test]
fn three_independent_axes_are_three_lines() {
    let grids = [0.3, 0.4, 0.5].map(|spacing| UniformGrid::new(-4.0, 5.0, spacing).unwrap());
    let start = Lattice::normal(grids.to_vec(), &[0.0, 0.5, 1.0], &[0.8, 0.9, 1.0]).unwrap();
    let positions: Vec<Vec<f64>> = (0..3).map(|axis| start.positions(axis)).collect();
    let deviations: Vec<Vec<f64>> = grids
        .iter()
        .map(|grid| vec![1.2 * grid.spacing(); start.density().len()])
        .collect();
    let next = LatticeKernel::new(positions, deviations, &start)
        .unwrap()
        .predict(&start)
        .unwrap();
    assert!(
        (next.density().iter().sum::<f64>() * next.axes().iter().map(UniformGrid::spacing).product::<f64>() - 1.0)
            .abs()
            < 1e-12
    );
    for (axis, grid) in grids.into_iter().enumerate() {
        let (mean, deviation) = ([0.0, 0.5, 1.0][axis], [0.8, 0.9, 1.0][axis]);
        let line = PointMass::normal(grid, mean, deviation * deviation).unwrap();
        let moved: Vec<(f64, f64)> = grid.nodes().map(|x| (x, 1.2 * grid.spacing())).collect();
        let line = TransitionKernel::from_transitions(grid, &moved)
            .unwrap()
            .predict(&line)
            .unwrap();
        for (p, q) in next.marginal(axis).iter().zip(line.density()) {
            assert!((p - q).abs() < 1e-12, "{axis}: {p} {q}");
        }
    }
}

#[test]
fn what_does_not_fit_is_refused_and_changes_nothing() {
    let axes = vec![UniformGrid::new(0.0, 1.0, 0.25).unwrap(); 2];
    let mut belief = Lattice::normal(axes.clone(), &[0.5; 2], &[0.5; 2]).unwrap();
    let (before, nodes) = (belief.clone(), belief.density().len());
    let name = |error: Error| match error {
        Error::Argument(argument) => argument.name,
        other => panic!("{other}"),
    };
    let of = |mean: f64, deviation: f64| {
        LatticeKernel::new([vec![mean; nodes], vec![mean; nodes]], vec![vec![deviation; nodes]; 2], &before)
    };
    assert_eq!(name(of(f64::NAN, 1.0).unwrap_err()), "means");
    assert_eq!(name(of(0.5, 0.2).unwrap_err()), "deviations");
    assert_eq!(name(of(0.5, f64::INFINITY).unwrap_err()), "deviations");
    assert_eq!(name(LatticeKernel::new([vec![0.0; nodes]], [vec![1.0; nodes]], &before).unwrap_err()), "means");
    assert_eq!(of(1e6, 1.0).unwrap().predict(&before), Err(Error::Impossible));
    assert_eq!(belief.update(&vec![f64::NEG_INFINITY; nodes]), Err(Error::Impossible));
    assert!(matches!(belief.update(&vec![f64::NAN; nodes]), Err(Error::NotANumber { .. })));
    assert_eq!(name(belief.update(&[0.0]).unwrap_err()), "log_likelihoods");
    assert_eq!(belief, before);
    assert_eq!(name(Lattice::uniform(Vec::new()).unwrap_err()), "axes");
    assert_eq!(name(Lattice::uniform(vec![axes[0]; 10]).unwrap_err()), "axes");
    assert_eq!(name(Lattice::normal(axes, &[0.5; 2], &[0.5, 0.0]).unwrap_err()), "deviation");
    assert!(before.with_density(vec![-1.0; nodes]).is_err() && before.positions(2).is_empty());
}
