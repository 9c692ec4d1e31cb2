//! What all hypotheses together say.

use super::bank::Hypothesis;
use super::gaussian::{Normal, merged};
use super::odds::shares_of;
use super::settings::Known;
use fewbits_numerics::normal;
use nalgebra::{Matrix3, Vector3};

/// Hypotheses of less than this share are no second place.
const SECOND: f64 = 0.01;
/// A second place differs by more than this many deviations.
const APART: f64 = 3.0;
/// Deviations to either side of a mean that hold 95 % of a normal law.
const BAND: f64 = 1.959_963_984_540_054;

/// Halvings of the interval in which the end of a band lies.
const HALVINGS: usize = 24;

/// The estimate after one range. Lengths are in the unit of the anchors' coordinates.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RangeEstimate {
    /// Position. Without an estimated height, the last coordinate is the known one.
    pub position: Vector3<f64>,
    /// Covariance of the position, over all places that explain the ranges. Zero for a known height.
    pub covariance: Matrix3<f64>,
    /// The bands that hold each coordinate with a probability of 95 %: lower and upper ends. While there are several places, they hold all
    /// that are probable.
    pub bands: [(f64, f64); 3],
    /// Number of places that explain the ranges, each by more than one in a hundred: 1 if the place is clear.
    pub places: usize,
    /// Common bias of the ranges.
    pub bias: f64,
    /// Error of scale: ranges are `1 + scale` times the distance, plus the bias.
    pub scale: f64,
    /// Estimated standard deviation of a range's error: the geometric mean over the bank's filters, weighted by their probabilities.
    pub noise: f64,
    /// Estimated standard deviation of the velocity along an axis, per second, averaged in the same way.
    pub speed: f64,
    /// Whether this range showed that the track was lost. Acquisition then starts again.
    pub lost: bool,
}

impl RangeEstimate {
    /// Squared error of the position in the plane divided by its covariance, per coordinate. On average 1 if the covariance is right. `None`
    /// if the covariance is singular.
    pub fn normalised_error(&self, truth: &Vector3<f64>) -> Option<f64> {
        let error = (self.position - truth).xy();
        let covariance = self.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        Some(0.5 * error.dot(&covariance.cholesky()?.solve(&error)))
    }
}

/// The estimate of all hypotheses together; `None` without any.
pub(super) fn of(known: &Known, hypotheses: &[Hypothesis], lost: bool) -> Option<RangeEstimate> {
    let (axes, noises) = (known.axes, known.noises.len());
    let shares = shares_of(hypotheses);
    let parts: Vec<(f64, Normal)> = shares
        .iter()
        .zip(hypotheses)
        .filter_map(|(share, one)| Some((*share, part(&one.moments()?))))
        .collect();
    let all = merged(parts.iter().map(|(share, normal)| (*share, normal)))?;
    let n = all.mean.len();
    let mut position = Vector3::new(0.0, 0.0, known.level);
    let mut covariance = Matrix3::zeros();
    let mut bands = [(known.level, known.level); 3];
    for i in 0..axes {
        position[i] = all.mean[i];
        (0..axes).for_each(|j| covariance[(i, j)] = all.covariance[i * n + j]);
        let laws: Vec<(f64, f64, f64)> = parts
            .iter()
            .map(|(share, one)| (*share, one.mean[i], one.variance(i).sqrt()))
            .collect();
        bands[i] = band(&laws);
    }
    let best = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let others = parts
        .iter()
        .filter(|(share, one)| *share > SECOND && are_apart(one, &best.1, axes))
        .count();
    let (mut noise, mut speed) = (0.0, 0.0);
    for (share, one) in shares.iter().zip(hypotheses) {
        for (i, weight) in one.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            noise += share * weight * known.noises[i % noises].ln();
            speed += share * weight * known.speeds[i / noises].ln();
        }
    }
    Some(RangeEstimate {
        position,
        covariance,
        bands,
        places: 1 + others,
        bias: all.mean[axes],
        scale: all.mean[axes + 1],
        noise: noise.exp(),
        speed: speed.exp(),
        lost,
    })
}

/// Position, bias and scale of a law.
fn part(one: &Normal) -> Normal {
    let (n, axes) = (one.mean.len(), one.axes);
    let kept: Vec<usize> = (0..axes).chain([one.bias(), one.scale()]).collect();
    Normal {
        mean: kept.iter().map(|i| one.mean[*i]).collect(),
        covariance: kept
            .iter()
            .flat_map(|i| kept.iter().map(move |j| one.covariance[i * n + j]))
            .collect(),
        axes,
    }
}

fn are_apart(a: &Normal, b: &Normal, axes: usize) -> bool {
    (0..axes).any(|i| (a.mean[i] - b.mean[i]).abs() > APART * (a.variance(i).sqrt() + b.variance(i).sqrt()))
}

/// The interval that holds 95 % of a mixture of `(share, mean, deviation)`, with 2.5 % on either side.
fn band(laws: &[(f64, f64, f64)]) -> (f64, f64) {
    let low = laws.iter().map(|(_, mean, deviation)| mean - BAND * deviation);
    let high = laws.iter().map(|(_, mean, deviation)| mean + BAND * deviation);
    let (low_most, low_least) = (low.clone().fold(f64::INFINITY, f64::min), low.fold(f64::NEG_INFINITY, f64::max));
    let (high_least, high_most) = (high.clone().fold(f64::INFINITY, f64::min), high.fold(f64::NEG_INFINITY, f64::max));
    let below = |x: f64| -> f64 {
        laws.iter()
            .map(|(share, mean, deviation)| {
                let z = (x - mean) / deviation;
                share * if z.is_nan() { 0.5 } else { normal::cdf(z) }
            })
            .sum()
    };
    let bisect = |target: f64, mut from: f64, mut to: f64| {
        if laws.len() > 1 {
            for _ in 0..HALVINGS {
                let middle = 0.5 * (from + to);
                if below(middle) < target {
                    from = middle
                } else {
                    to = middle
                }
            }
        }
        0.5 * (from + to)
    };
    (bisect(0.025, low_most, low_least), bisect(0.975, high_least, high_most))
}
