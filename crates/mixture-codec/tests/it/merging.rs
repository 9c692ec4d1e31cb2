//! Merging against its definitions: every pair priced anew by closed forms.

use crate::common::random_mixture;
use fewbits_core::Belief;
use fewbits_densities::{Component, Mixture};
use fewbits_mixture_codec::merge::{MergeCost, merge};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::TAU;

type Part = (f64, Vector2<f64>, Matrix2<f64>);

fn joined(a: &Part, b: &Part) -> Part {
    let weight = a.0 + b.0;
    let mean = (a.1 * a.0 + b.1 * b.0) / weight;
    let second = |p: &Part| (p.2 + p.1 * p.1.transpose()) * p.0;
    (weight, mean, (second(a) + second(b)) / weight - mean * mean.transpose())
}

/// `int f g`.
fn overlap(f: &[Part], g: &[Part]) -> f64 {
    let normal = |gap: Vector2<f64>, c: Matrix2<f64>| {
        (-0.5 * gap.dot(&(c.try_inverse().unwrap() * gap))).exp() / (TAU * c.determinant().sqrt())
    };
    let pairs = f.iter().flat_map(|a| g.iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| a.0 * b.0 * normal(a.1 - b.1, a.2 + b.2)).sum()
}

fn squared_error(f: &[Part], g: &[Part]) -> f64 {
    overlap(f, f) - 2.0 * overlap(f, g) + overlap(g, g)
}

/// Merges the cheapest pair until `left` are left; the prices paid.
fn plainly(mut parts: Vec<Part>, left: usize, price: impl Fn(&[Part], usize, usize) -> f64) -> (Vec<Part>, Vec<f64>) {
    let mut paid = Vec::new();
    while parts.len() > left {
        let pairs = (0..parts.len()).flat_map(|i| (i + 1..parts.len()).map(move |j| (i, j)));
        let priced = pairs.map(|(i, j)| (price(&parts, i, j), i, j));
        let (cost, i, j) = priced.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        paid.push(cost);
        parts[i] = joined(&parts[i], &parts[j]);
        parts.remove(j);
    }
    (parts, paid)
}

fn parts(mixture: &Mixture<2>) -> Vec<Part> {
    let components = mixture.components().iter();
    components.map(|c| (c.weight(), *c.mean(), *c.covariance())).collect()
}

#[test]
fn the_cheapest_pair_is_merged_at_the_price_of_the_definition() {
    for seed in 0..12 {
        let unit = [1e-4, 1.0, 1e4][seed as usize % 3];
        let mixture = random_mixture::<2, _>(&mut Stream::new(60 + seed).rng(), 7, unit);
        let (original, whole) = (parts(&mixture), mixture.covariance().try_inverse().unwrap());
        for left in [2, 4, 6] {
            let check = |cost: MergeCost, (slow, paid): (Vec<Part>, f64), slack: f64| {
                let fast = merge(&mixture, left, cost).unwrap();
                assert!((fast.cost - paid).abs() < slack, "{cost:?} {left}: {} {paid}", fast.cost);
                assert_eq!(fast.mixture.len(), left);
                for (a, b) in parts(&fast.mixture).iter().zip(&slow) {
                    assert!((a.0 - b.0).abs() < 1e-12 && (a.1 - b.1).amax() < 1e-10 * unit, "{cost:?} {left}");
                    assert!((a.2 - b.2).amax() < 1e-9 * unit * unit, "{cost:?} {left}");
                }
            };
            let (slow, paid) = plainly(original.clone(), left, |p, i, j| {
                let log_det = |p: &Part| 0.5 * p.0 * p.2.determinant().ln();
                log_det(&joined(&p[i], &p[j])) - log_det(&p[i]) - log_det(&p[j])
            });
            check(MergeCost::Runnalls, (slow, paid.iter().sum()), 1e-9);
            let (slow, paid) = plainly(original.clone(), left, |p, i, j| {
                let gap = p[i].1 - p[j].1;
                p[i].0 * p[j].0 / (p[i].0 + p[j].0) * gap.dot(&(whole * gap))
            });
            check(MergeCost::Salmond, (slow, paid.iter().sum()), 1e-10);
            let (slow, _) = plainly(original.clone(), left, |p, i, j| {
                let mut after = p.to_vec();
                after[i] = joined(&p[i], &p[j]);
                after.remove(j);
                squared_error(&original, &after)
            });
            let error = squared_error(&original, &slow);
            check(MergeCost::Williams, (slow, error), 1e-10 * overlap(&original, &original));
        }
    }
}

/// Defect: components whose joint covariance overflows stayed apart, and there were more than was asked for.
#[test]
fn components_that_cannot_be_joined_are_refused() {
    let at = |x: f64| Component::new(0.5, Vector2::new(x, 0.0), Matrix2::identity()).unwrap();
    let mixture = Mixture::new(vec![at(-1e200), at(1e200)]).unwrap();
    assert_eq!(merge(&mixture, 2, MergeCost::Runnalls).unwrap().mixture.len(), 2);
    assert!(merge(&mixture, 1, MergeCost::Runnalls).is_err());
}
