//! The metric against all assignments, its closed cases and the laws of a metric.

use fewbits_monte_carlo::Stream;
use fewbits_multi_target::{assign, gospa};
use nalgebra::{Vector1, Vector2};
use rand::RngExt;

/// The least cost over all assignments of estimates to targets, some left out.
fn brute(estimates: &[Vector2<f64>], truth: &[Vector2<f64>], cutoff: f64, order: f64, used: u32) -> f64 {
    let half = cutoff.powf(order) / 2.0;
    let Some((first, rest)) = estimates.split_first() else {
        return half * (truth.len() - used.count_ones() as usize) as f64;
    };
    let alone = half + brute(rest, truth, cutoff, order, used);
    let with = |j: usize| (first - truth[j]).norm().powf(order) + brute(rest, truth, cutoff, order, used | 1 << j);
    (0..truth.len())
        .filter(|j| used >> j & 1 == 0)
        .map(with)
        .fold(alone, f64::min)
}

fn draw(rng: &mut impl rand::Rng, count: usize) -> Vec<Vector2<f64>> {
    (0..count)
        .map(|_| Vector2::from_fn(|_, _| 4.0 * rng.random::<f64>()))
        .collect()
}

#[test]
fn it_is_the_least_over_all_assignments() {
    let mut rng = Stream::new(3).rng();
    for case in 0..100 {
        let (estimates, truth) = (draw(&mut rng, case % 5), draw(&mut rng, case / 5 % 5));
        for order in [1.0, 2.0] {
            let found = gospa(&estimates, &truth, 1.5, order).unwrap();
            let exact = brute(&estimates, &truth, 1.5, order, 0);
            assert!((found.value.powf(order) - exact).abs() < 1e-12);
            assert!((found.localisation + found.missed + found.false_targets - exact).abs() < 1e-12);
            let back = gospa(&truth, &estimates, 1.5, order).unwrap();
            assert!((back.value - found.value).abs() < 1e-12 && back.missed == found.false_targets);
        }
    }
}

#[test]
fn closed_cases() {
    let at = |x: f64| Vector1::new(x);
    let one = gospa(&[at(1.0)], &[at(4.0)], 20.0, 2.0).unwrap();
    assert_eq!((one.value, one.localisation, one.missed, one.false_targets), (3.0, 9.0, 0.0, 0.0));
    let far = gospa(&[at(0.0)], &[at(100.0)], 20.0, 2.0).unwrap();
    assert_eq!((far.value, far.missed, far.false_targets), (20.0, 200.0, 200.0));
    let missed = gospa(&[], &[at(1.0), at(2.0)], 20.0, 2.0).unwrap();
    assert_eq!((missed.value, missed.missed), (20.0, 400.0));
    assert_eq!(gospa::<1>(&[], &[], 20.0, 2.0).unwrap().value, 0.0);
    // The nearest of each is not the best of both.
    let both = gospa(&[at(0.0), at(1.0)], &[at(1.1), at(2.0)], 20.0, 1.0).unwrap();
    assert!((both.value - 2.1).abs() < 1e-12);
    assert!(gospa(&[at(f64::NAN)], &[], 20.0, 2.0).is_err() && gospa::<1>(&[], &[], 0.0, 2.0).is_err());
    assert!(gospa::<1>(&[], &[], 1.0, 0.5).is_err());
}

#[test]
fn the_triangle_inequality_holds_in_every_unit() {
    let mut rng = Stream::new(4).rng();
    for case in 0..200 {
        let sets = [case % 4, case / 4 % 4, case / 16 % 4].map(|count| draw(&mut rng, count));
        let between = |i: usize, j: usize| {
            let all = gospa(&sets[i], &sets[j], 1.5, 2.0).unwrap();
            let parts = all.localisation + all.missed + all.false_targets;
            assert!((parts - all.value * all.value).abs() < 1e-12 * parts.max(1.0), "{parts} of {}", all.value);
            all.value
        };
        assert!(between(0, 2) <= between(0, 1) + between(1, 2) + 1e-12);
        for unit in [1e-150, 1e150] {
            let [a, b] = [0, 1].map(|i| sets[i].iter().map(|x: &Vector2<f64>| x * unit).collect::<Vec<_>>());
            let scaled = gospa(&a, &b, 1.5 * unit, 2.0).unwrap().value;
            assert!((scaled / unit - between(0, 1)).abs() < 1e-12);
        }
    }
}

#[test]
fn assignments_are_the_cheapest() {
    fn least(costs: &[Vec<f64>], used: u32) -> f64 {
        let Some((row, rest)) = costs.split_first() else {
            return 0.0;
        };
        let of = |j: usize| row[j] + least(rest, used | 1 << j);
        (0..row.len())
            .filter(|j| used >> j & 1 == 0)
            .map(of)
            .fold(f64::INFINITY, f64::min)
    }
    let mut rng = Stream::new(5).rng();
    for case in 0..200 {
        let rows = case % 5;
        let columns = rows + case / 5 % 3;
        let costs: Vec<Vec<f64>> = (0..rows)
            .map(|_| (0..columns).map(|_| 10.0 * rng.random::<f64>() - 5.0).collect())
            .collect();
        let found = assign(&costs).unwrap();
        let total: f64 = found.iter().enumerate().map(|(i, j)| costs[i][*j]).sum();
        assert!((total - least(&costs, 0)).abs() < 1e-12);
        let mut seen = found.clone();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), rows);
    }
    assert!(assign(&[vec![1.0], vec![2.0]]).is_err() && assign(&[vec![f64::NAN]]).is_err());
}
