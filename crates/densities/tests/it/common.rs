//! Densities that the tests of several crates share.
#![allow(dead_code, reason = "each crate uses some of them")]

use fewbits_densities::{Bandwidth, Component, KernelEstimate, Mixture, Particles};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Fixture D1 of the spec.
pub fn d1() -> KernelEstimate<2> {
    d1_scaled(1.0)
}

pub fn d1_scaled(unit: f64) -> KernelEstimate<2> {
    let at = |f: &dyn Fn(f64) -> f64| (0..16).map(|i| unit * f(f64::from(i))).collect::<Vec<_>>();
    let x = at(&|i| 2.0 * (1.3 * i).sin() + 0.05 * i);
    let y = at(&|i| 1.5 * (0.7 * i).cos() + 0.2 * (3.0 * i).sin());
    let logs: Vec<f64> = (0..16).map(|i| f64::from(1 + i % 3).ln()).collect();
    let kernel = Matrix2::new(0.09, 0.0, 0.0, 0.04) * (unit * unit);
    KernelEstimate::new(Particles::new([x, y], &logs).unwrap(), kernel).unwrap()
}

/// A crescent of weighted particles, as range measurements leave it.
pub fn crescent(seed: u64, n: usize, unit: f64) -> KernelEstimate<2> {
    let mut rng = Stream::new(seed).rng();
    let mut columns = [Vec::new(), Vec::new()];
    let mut logs = Vec::new();
    for _ in 0..n {
        let angle = 0.9 * rng.sample::<f64, _>(StandardNormal);
        let radius = 1.5 + 0.15 * rng.sample::<f64, _>(StandardNormal);
        columns[0].push(unit * radius * angle.cos());
        columns[1].push(unit * radius * angle.sin());
        logs.push(0.8 * rng.sample::<f64, _>(StandardNormal));
    }
    KernelEstimate::fit(Particles::new(columns, &logs).unwrap(), &Bandwidth::default()).unwrap()
}

/// A random mixture in `D` dimensions.
pub fn random_mixture<const D: usize, R: Rng>(rng: &mut R, components: usize, unit: f64) -> Mixture<D> {
    let parts = (0..components).map(|_| {
        let mean = SVector::<f64, D>::from_fn(|_, _| 1.5 * unit * rng.sample::<f64, _>(StandardNormal));
        let root = SMatrix::<f64, D, D>::from_fn(|_, _| 0.5 * rng.sample::<f64, _>(StandardNormal));
        let covariance = (root * root.transpose() + SMatrix::identity() * 0.05) * (unit * unit);
        Component::new(rng.random_range(0.05..1.0), mean, covariance).unwrap()
    });
    Mixture::new(parts.collect()).unwrap()
}

pub fn lobe(weight: f64, mean: [f64; 2], covariance: [f64; 3]) -> Component<2> {
    let [a, b, c] = covariance;
    Component::new(weight, Vector2::from(mean), Matrix2::new(a, b, b, c)).unwrap()
}
