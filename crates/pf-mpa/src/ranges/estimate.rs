//! What all hypotheses together say.

use super::band::Laws;
use super::bank::Hypothesis;
use super::odds::shares_of;
use super::settings::Known;
use nalgebra::{Matrix3, Vector3};

/// Hypotheses of less than this share are no second place.
const SECOND: f64 = 0.01;
/// Hypotheses of less than this share do not move the end of a band.
const FAINT: f64 = 1e-4;
/// A second place differs by more than this many deviations.
const APART: f64 = 3.0;
/// Squares of one and of two standard normal variables that are exceeded once in a thousand cases: each row asks.
const IMPROBABLE: [f64; 2] = [10.828, 13.816];
/// A share of the prior's variance that the ranges must have taken off before they can contradict it.
const TOLD: f64 = 0.05;

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
    /// Whether bias and scale are farther from zero than their priors allow in one case of a thousand: an anchor may be wrong whose error they
    /// took up, as they can if there are few anchors, or the priors are too narrow.
    pub is_doubtful: bool,
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

/// Position (the third coordinate only if it is estimated), bias and scale by one hypothesis.
struct Part {
    share: f64,
    mean: [f64; 5],
    covariance: [[f64; 5]; 5],
}

/// Places of bias and scale in a [`Part`].
const BIAS: usize = 3;
const SCALE: usize = 4;

impl Part {
    /// A part with these moments at some of its places, and zeros at the others.
    fn new<const N: usize>(share: f64, places: [usize; N], (means, rows): ([f64; N], [[f64; N]; N])) -> Self {
        let (mut mean, mut covariance) = ([0.0; 5], [[0.0; 5]; 5]);
        for ((at, of_mean), row) in places.into_iter().zip(means).zip(rows) {
            mean[at] = of_mean;
            places
                .into_iter()
                .zip(row)
                .for_each(|(other, x)| covariance[at][other] = x);
        }
        Self {
            share,
            mean,
            covariance,
        }
    }
}

/// The estimate of all hypotheses together; `None` without any.
pub(super) fn of(known: &Known, hypotheses: &[Hypothesis], lost: bool) -> Option<RangeEstimate> {
    let axes = known.axes;
    let shares = shares_of(hypotheses);
    let parts: Vec<Part> = shares
        .iter()
        .zip(hypotheses)
        .map(|(share, one)| {
            let (bias, scale) = (2 * axes, 2 * axes + 1);
            if axes == 3 {
                Part::new(*share, [0, 1, 2, BIAS, SCALE], one.marginal(&[0, 1, 2, bias, scale]))
            } else {
                Part::new(*share, [0, 1, BIAS, SCALE], one.marginal(&[0, 1, bias, scale]))
            }
        })
        .collect();
    let best = parts.iter().max_by(|a, b| a.share.total_cmp(&b.share))?;
    let mean = |i: usize| parts.iter().map(|one| one.share * one.mean[i]).sum::<f64>();
    let mut position = Vector3::new(0.0, 0.0, known.level);
    (0..axes).for_each(|i| position[i] = mean(i));
    let mut covariance = Matrix3::zeros();
    let mut laws = Laws::default();
    let mut bands = [(known.level, known.level); 3];
    for i in 0..axes {
        for j in 0..axes {
            let one = |one: &Part| {
                one.share * (one.covariance[i][j] + (one.mean[i] - position[i]) * (one.mean[j] - position[j]))
            };
            covariance[(i, j)] = parts.iter().map(one).sum();
        }
        laws.clear();
        for one in parts.iter().filter(|one| one.share > FAINT) {
            laws.push(one.share, one.mean[i], one.covariance[i][i].sqrt());
        }
        bands[i] = laws.band();
    }
    let others = parts
        .iter()
        .filter(|one| one.share > SECOND && are_apart(one, best, axes))
        .count();
    let (mut noise, mut speed) = (0.0, 0.0);
    for (share, one) in shares.iter().zip(hypotheses) {
        for i in &one.alive {
            let weight = one.weights[*i];
            noise += share * weight * known.bank[*i].log_noise;
            speed += share * weight * known.bank[*i].log_speed;
        }
    }
    Some(RangeEstimate {
        position,
        covariance,
        bands,
        places: 1 + others,
        is_doubtful: is_doubtful(known, &parts),
        bias: mean(BIAS),
        scale: mean(SCALE),
        noise: noise.exp(),
        speed: speed.exp(),
        lost,
    })
}

/// Whether the estimates of bias and scale contradict their priors. Before the ranges, the mean of an estimate has the prior's variance less the
/// estimate's own.
fn is_doubtful(known: &Known, parts: &[Part]) -> bool {
    if known.clock.is_some() {
        return false;
    }
    let priors = [(BIAS, known.bias), (SCALE, known.scale)];
    let asked: Vec<(usize, f64)> = priors.into_iter().filter(|(_, prior)| *prior > 0.0).collect();
    let mut means = [0.0; 5];
    for i in [BIAS, SCALE] {
        means[i] = parts.iter().map(|one| one.share * one.mean[i]).sum();
    }
    // In deviations of the priors.
    let covariance = |(i, of_i): (usize, f64), (j, of_j): (usize, f64)| {
        let one = |one: &Part| one.share * (one.covariance[i][j] + (one.mean[i] - means[i]) * (one.mean[j] - means[j]));
        parts.iter().map(one).sum::<f64>() / (of_i * of_j)
    };
    let off = |(i, of): (usize, f64)| means[i] / of;
    // One of the two alone, where the ranges tell of the other nothing.
    let is_far = |one: (usize, f64)| {
        let left = 1.0 - covariance(one, one);
        left > TOLD && off(one).powi(2) > IMPROBABLE[0] * left
    };
    match asked.as_slice() {
        [one] => off(*one).powi(2) > IMPROBABLE[0] * (1.0 - covariance(*one, *one)),
        [a, b] => {
            let left = [1.0 - covariance(*a, *a), -covariance(*a, *b), 1.0 - covariance(*b, *b)];
            let determinant = left[0] * left[2] - left[1] * left[1];
            let (x, y) = (off(*a), off(*b));
            let square = x * x * left[2] - 2.0 * x * y * left[1] + y * y * left[0];
            if left[0] <= TOLD || left[2] <= TOLD {
                return is_far(*a) || is_far(*b);
            }
            // Ranges that say nothing leave nothing to contradict.
            determinant > TOLD * TOLD && square > IMPROBABLE[1] * determinant
        }
        _ => false,
    }
}

fn are_apart(a: &Part, b: &Part, axes: usize) -> bool {
    let deviation = |one: &Part, i: usize| one.covariance[i][i].sqrt();
    (0..axes).any(|i| (a.mean[i] - b.mean[i]).abs() > APART * (deviation(a, i) + deviation(b, i)))
}
