//! The line that anchors are nearly on.

use super::gaussian::Normal;
use nalgebra::{Matrix2, Vector2, Vector3};

/// Anchors are nearly on a line if their deviation across it is less than this share of that along it.
const FLAT: f64 = 0.4;

/// Anchors are on it if this share is less.
const EXACT: f64 = 1e-6;

/// A line in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    middle: Vector2<f64>,
    /// Across the line.
    pub(super) normal: Vector2<f64>,
    /// Whether the anchors are on it: ranges say nothing of the side.
    pub(super) is_exact: bool,
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
            is_exact: eigen.eigenvalues[across] < EXACT * EXACT * eigen.eigenvalues[1 - across],
        })
    }

    /// How far a point is across the line.
    pub(super) fn offset(&self, point: &[f64; 2]) -> f64 {
        self.normal.dot(&(Vector2::from(*point) - self.middle))
    }

    /// Mirrors positions and velocities of a law in the plane.
    pub(super) fn mirror(&self, state: &mut Normal) {
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
