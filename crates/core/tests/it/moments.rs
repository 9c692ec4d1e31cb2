//! Moments by quadrature: what they cost and how good they are, where the posterior is plain and where it is not.

use fewbits_core::factor::{Factor, Feature, Levels, Scalar, Value, tilted_by_quadrature};
use fewbits_core::{Cell, Error, Gaussian, Link, Sign};
use std::cell::Cell as Counter;

/// Several observations of one measurement, each so many times.
type Observed = Vec<(Scalar, f64)>;

fn log_likelihoods(observed: &Observed, at: &[f64], logs: &mut [f64]) {
    let mut own = vec![0.0; at.len()];
    for (factor, count) in observed {
        own.fill(0.0);
        factor.add_log_likelihoods(&[at], &mut own);
        logs.iter_mut().zip(&own).for_each(|(log, own)| *log += count * own);
    }
}

/// `ln` of the evidence, mean and variance by the trapezoid rule with a quarter of a million nodes between two ends.
fn brute_force(mean: f64, variance: f64, observed: &Observed, (low, high): (f64, f64)) -> [f64; 3] {
    let count = 250_000;
    let step = (high - low) / f64::from(count);
    let at: Vec<f64> = (0..=count).map(|i| low + step * f64::from(i)).collect();
    let mut logs: Vec<f64> = at.iter().map(|m| -0.5 * (m - mean) * (m - mean) / variance).collect();
    log_likelihoods(observed, &at, &mut logs);
    let peak = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(logs[0] < peak - 40.0 && logs[at.len() - 1] < peak - 40.0, "the ends hold mass");
    let mass: Vec<f64> = logs.iter().map(|log| (log - peak).exp()).collect();
    let all: f64 = mass.iter().sum();
    let first = mass.iter().zip(&at).map(|(p, m)| p * (m - mean)).sum::<f64>() / all;
    let second = mass
        .iter()
        .zip(&at)
        .map(|(p, m)| p * (m - mean - first).powi(2))
        .sum::<f64>()
        / all;
    let scale = (std::f64::consts::TAU * variance).sqrt();
    [peak + (all * step / scale).ln(), mean + first, second]
}

fn bit(sign: Sign, threshold: f64, noise: f64) -> Scalar {
    Levels::sign(sign, threshold, noise * noise, &Link::PERFECT)
        .unwrap()
        .into()
}

fn cell(lower: f64, upper: f64, noise: f64, loss: f64) -> Scalar {
    Levels::silence(Cell::new(lower, upper).unwrap(), noise * noise, &Link::lossy(loss).unwrap())
        .unwrap()
        .into()
}

/// Where the likelihood changes, as the factors themselves would say.
fn features(observed: &Observed) -> Vec<Feature> {
    let edges = |factor: &Scalar| match factor {
        Scalar::Value(value) => vec![(value.value()[0], value.noise_covariance()[0])],
        Scalar::Levels(levels) => {
            let pieces = levels.pieces();
            let mut edges: Vec<f64> = pieces
                .iter()
                .flat_map(|(cell, _)| [cell.lower(), cell.upper()])
                .collect();
            edges.dedup();
            edges
                .into_iter()
                .map(|edge| (edge, levels.noise().variance(edge)))
                .collect()
        }
    };
    let all = observed.iter().flat_map(|(factor, _)| edges(factor));
    all.filter(|(at, _)| at.is_finite())
        .map(|(location, variance)| Feature {
            location,
            width: variance.sqrt(),
        })
        .collect()
}

#[test]
fn moments_are_right_and_cheap() {
    use Sign::{Above, Below};
    // Prior mean and deviation, observations, ends of the brute force, most evaluations.
    type Case = (f64, f64, Observed, (f64, f64), usize);
    let once = |factor: Scalar| vec![(factor, 1.0)];
    let value = |at, variance| Scalar::from(Value::scalar(at, variance).unwrap());
    let cells =
        |edges: &[f64], given: &[f64], variance: f64| Scalar::from(Levels::partition(edges, given, variance).unwrap());
    let two_modes = cells(&[-9.0, 8.9], &[0.6, 0.0, 0.7], 0.04);
    let comb = cells(&[-2.0, -1.5, 1.7, 2.0], &[0.6, 0.0, 0.7, 0.1, 1.0], 0.0025);
    let cases: Vec<Case> = vec![
        // The trapezoid rule: as wide as the prior, finer, at the limit; a feature far out; a narrow posterior.
        (0.4, 1.5, once(bit(Above, 1.1, 1.7)), (-15.0, 16.0), 40),
        (-1.3, 1.3, vec![(bit(Above, 1.1, 0.8), 2.0)], (-13.0, 12.0), 64),
        (-1.3, 1.3, vec![(bit(Below, -2.1, 0.4), 1.0), (cell(-2.2, 1.9, 1.0, 0.3), 3.0)], (-14.0, 12.0), 128),
        (0.7, 2.0, once(bit(Above, 11.9, 2.0)), (-10.0, 28.0), 40),
        (0.7, 2.0, vec![(bit(Below, -10.9, 1.3), 2.0)], (-28.0, 10.0), 64),
        (0.2, 1.1, vec![(cell(-0.9, 1.6, 7.0, 0.2), 3.0)], (-11.0, 12.0), 40),
        (0.2, 1.1, vec![(cell(-0.9, 1.6, 0.68, 0.0), 3.0)], (-7.0, 7.0), 32),
        (0.2, 1.1, vec![(cell(-1.1, 1.3, 0.54, 0.0), 2.0)], (-7.0, 7.0), 40),
        // Adaptive: coarser than the trapezoid rule allows, finer, far away, narrow, on a slope, with two modes of unequal weight.
        (0.4, 1.5, vec![(bit(Above, 1.1, 1.5), 1.0), (bit(Below, 2.3, 1.6), 1.0)], (-15.0, 16.0), 661),
        (0.2, 1.1, vec![(cell(-0.9, 1.6, 1.0, 0.0), 30.0)], (-7.0, 7.0), 456),
        (0.3, 1.4, vec![(bit(Above, 0.9, 0.15), 1.0), (bit(Below, 1.7, 0.2), 1.0)], (-1.0, 4.0), 560),
        (-2.0, 0.7, vec![(cell(3.1, 3.6, 1e-3, 0.0), 2.0)], (3.0, 3.7), 500),
        (-2.0, 0.7, vec![(cell(3.1, 3.6, 1e-3, 1e-6), 2.0)], (-9.0, 5.0), 1070),
        (-3.0, 1.7, vec![(bit(Above, 40.0, 0.9), 5.0)], (20.0, 50.0), 545),
        (1.0, 2.5, vec![(value(3.7, 1e-6), 1.0), (bit(Below, 3.699, 0.02), 3.0)], (3.68, 3.72), 565),
        (1.0, 2.5, vec![(value(60.0, 0.09), 1.0), (bit(Below, 30.0, 4.0), 2.0)], (50.0, 65.0), 505),
        (0.1, 1.2, once(two_modes), (-16.0, 16.0), 1000),
        (0.1, 1.2, vec![(comb, 3.0)], (-13.0, 13.0), 1140),
        (
            5.0,
            2.0,
            vec![(cell(-30.0, 300.0, 40.0, 0.0), 50.0), (bit(Above, 4.0, 0.05), 1.0)],
            (-10.0, 30.0),
            555,
        ),
    ];
    for (i, (mean, deviation, observed, ends, most)) in cases.into_iter().enumerate() {
        let variance = deviation * deviation;
        let evaluations = Counter::new(0);
        let tilted =
            tilted_by_quadrature(&Gaussian::scalar(mean, variance).unwrap(), features(&observed), |at, logs| {
                evaluations.set(evaluations.get() + at.len());
                log_likelihoods(&observed, at, logs);
            })
            .unwrap();
        let [log_evidence, truth, spread] = brute_force(mean, variance, &observed, ends);
        let off = [
            tilted.log_evidence - log_evidence,
            (tilted.mean[0] - truth) / spread.sqrt(),
            tilted.covariance[0] / spread - 1.0,
        ];
        assert!(off.iter().all(|off| off.abs() < 1e-9), "case {i}: {off:?}");
        assert!(evaluations.get() <= most, "case {i}: {} evaluations", evaluations.get());
    }
}

/// A likelihood that is itself only good to nine digits: panels are not split for ever.
#[test]
fn splitting_ends_where_the_likelihood_is_rounded() {
    let evaluations = Counter::new(0);
    let (at, width) = (0.37, 0.05);
    let feature = Feature { location: at, width };
    let tilted = tilted_by_quadrature(&Gaussian::scalar(0.2, 1.7).unwrap(), [feature], |m, logs| {
        evaluations.set(evaluations.get() + m.len());
        for (log, m) in logs.iter_mut().zip(m) {
            let rounding = 1e-10 * (1e9 * m).sin();
            *log += -0.5 * ((m - at) / width).powi(2) + rounding;
        }
    })
    .unwrap();
    // The product of two normal densities.
    let gain = 1.7 / (1.7 + width * width);
    assert!((tilted.mean[0] - (0.2 + gain * (at - 0.2))).abs() < 1e-9 * width);
    assert!((tilted.covariance[0] / (gain * width * width) - 1.0).abs() < 1e-8);
    assert!(evaluations.get() <= 820);
}

#[test]
fn what_is_nowhere_possible_is_an_error() {
    let prior = Gaussian::scalar(0.3, 1.9).unwrap();
    let feature = Feature {
        location: 1.0,
        width: 0.02,
    };
    let nowhere = tilted_by_quadrature(&prior, [feature], |_, logs| logs.fill(f64::NEG_INFINITY));
    assert_eq!(nowhere, Err(Error::Impossible));
    let not_a_number = tilted_by_quadrature(&prior, [], |_, logs| logs.fill(f64::NAN));
    assert!(matches!(not_a_number, Err(Error::NotANumber { .. })));
}
