//! The other side of anchors that are nearly on a line.
//!
//! Such anchors tell the two sides of their line apart little, and a filter on one side does not follow a target that crosses: beside a place near the line, its
//! mirror image is carried until the ranges decide.

use super::bank::Hypothesis;
use super::gaussian::Normal;
use super::odds::shares_of;
use super::settings::Known;
use nalgebra::{Matrix2, Vector2, Vector3};

/// Anchors are nearly on a line if their deviation across it is less than this share of that along it.
const FLAT: f64 = 0.4;
/// A place within so many deviations of the line may be on either side.
const NEAR: f64 = 4.0;
/// Share of a place that its mirror image takes.
const CROSSED: f64 = 0.02;
/// Hypotheses of less than this share have no mirror image.
const PROBABLE: f64 = 0.02;

/// A line in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    middle: Vector2<f64>,
    /// Across the line.
    normal: Vector2<f64>,
}

impl Line {
    /// The line that anchors are nearly on, if they are.
    pub(super) fn of(anchors: &[Vector3<f64>]) -> Option<Self> {
        let middle = anchors.iter().map(|place| place.xy()).sum::<Vector2<f64>>() / anchors.len() as f64;
        let scatter: Matrix2<f64> = anchors
            .iter()
            .map(|place| (place.xy() - middle) * (place.xy() - middle).transpose())
            .sum();
        let eigen = scatter.symmetric_eigen();
        let across = eigen.eigenvalues.argmin().0;
        let is_flat = eigen.eigenvalues[across] < FLAT * FLAT * eigen.eigenvalues[1 - across];
        is_flat.then(|| Self {
            middle,
            normal: eigen.eigenvectors.column(across).into_owned(),
        })
    }

    /// How far a point is across the line.
    fn offset(&self, point: &[f64; 2]) -> f64 {
        self.normal.dot(&(Vector2::from(*point) - self.middle))
    }

    /// Mirrors positions and velocities of a law in the plane.
    fn mirror(&self, state: &mut Normal) {
        let n = state.mean.len();
        let flip = |x: &mut [f64], from: usize, stride: usize| {
            let (a, b) = (from, from + stride);
            let twice = 2.0 * (self.normal.x * x[a] + self.normal.y * x[b]);
            x[a] -= twice * self.normal.x;
            x[b] -= twice * self.normal.y;
        };
        for i in 0..2 {
            state.mean[i] -= self.middle[i];
        }
        for first in [0, 2] {
            flip(&mut state.mean, first, 1);
            for other in 0..n {
                flip(&mut state.covariance, other * n + first, 1);
            }
            for other in 0..n {
                flip(&mut state.covariance, first * n + other, n);
            }
        }
        for i in 0..2 {
            state.mean[i] += self.middle[i];
        }
    }
}

/// Adds the mirror images of probable places near the line, unless a hypothesis of the same kind is there.
pub(super) fn add_mirrored(known: &Known, hypotheses: &mut Vec<Hypothesis>) {
    let Some(line) = known.line.filter(|_| known.axes == 2) else {
        return;
    };
    let mut added: Vec<Hypothesis> = Vec::new();
    for i in (0..hypotheses.len()).filter({
        let shares = shares_of(hypotheses);
        move |i| shares[*i] > PROBABLE
    }) {
        let one = &hypotheses[i];
        let (mean, covariance) = one.marginal(&[0, 1]);
        let covariance = Matrix2::from_fn(|a, b| covariance[a][b]);
        let (off, variance) = (line.offset(&mean), line.normal.dot(&(covariance * line.normal)));
        if off * off > NEAR * NEAR * variance {
            continue;
        }
        let image = Vector2::from(mean) - 2.0 * off * line.normal;
        let is_there = |other: &Hypothesis| {
            let (place, spread) = other.marginal(&[0, 1]);
            other.variant == one.variant
                && (0..2).all(|i| (place[i] - image[i]).powi(2) <= spread[i][i].max(covariance[(i, i)]))
        };
        if hypotheses.iter().chain(&added).any(is_there) {
            continue;
        }
        let mut mirrored = one.clone();
        mirrored.log_weight += CROSSED.ln();
        for (state, weight) in mirrored.filters.iter_mut().zip(&mirrored.weights) {
            if *weight > 0.0 {
                line.mirror(state);
            }
        }
        added.push(mirrored);
    }
    hypotheses.append(&mut added);
}
