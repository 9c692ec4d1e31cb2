//! A region of the posterior, and the grid on it.

use super::pass::Found;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{SMatrix, SVector};

/// Largest number of successive splits of a region: up to 256 modes.
const MAX_CUTS: usize = 8;
/// After this many grids with too few nodes per deviation (because edges of a cell fall between nodes), the spacing is reduced.
const RETRIES: u32 = 2;
/// Factor of the spacing: 1.75 nodes per deviation become 2, and 3.5 deviations to each side remain inside.
const CLOSER: f64 = 0.875;

/// With more nodes per deviation than this, the grid is made wider, up to five deviations, so that its ends cut off less.
const NODES_PER_DEVIATION: f64 = 4.0;
const WIDER: f64 = 1.25;

/// A grid on a region of the whitened coordinates `u`: node `t` is at `centre + axes diag(deviations) t`.
#[derive(Debug, Clone)]
pub(super) struct Region<const K: usize> {
    pub centre: SVector<f64, K>,
    /// Orthonormal columns.
    axes: SMatrix<f64, K, K>,
    deviations: SVector<f64, K>,
    /// Nodes on each axis.
    pub nodes: usize,
    /// The splits that led to this region; the first `depth` entries are used.
    cuts: [Cut<K>; MAX_CUTS],
    depth: usize,
    /// How often the grid was evaluated again although it no longer narrowed.
    retries: u32,
    /// Whether the grid is still the one over the prediction.
    pub is_prediction: bool,
}

/// One side of a split: `normal' u >= offset`. The posterior is negligible near the plane.
#[derive(Debug, Clone, Copy)]
struct Cut<const K: usize> {
    normal: SVector<f64, K>,
    offset: f64,
}

/// Moments of `u` in one resolved region.
#[derive(Debug, Clone)]
pub(super) struct Piece<const K: usize> {
    pub log_evidence: f64,
    pub mean: SVector<f64, K>,
    pub covariance: SMatrix<f64, K, K>,
}

impl<const K: usize> Region<K> {
    /// The region of the whole prediction.
    pub(crate) fn whole(nodes: usize) -> Self {
        let nothing = Cut {
            normal: SVector::zeros(),
            offset: 0.0,
        };
        Self {
            centre: SVector::zeros(),
            axes: SMatrix::identity(),
            deviations: SVector::repeat(1.0),
            nodes,
            cuts: [nothing; MAX_CUTS],
            depth: 0,
            retries: 0,
            is_prediction: true,
        }
    }

    /// Whether `u` is in this region.
    #[inline]
    pub(crate) fn holds(&self, u: &SVector<f64, K>) -> bool {
        self.cuts[..self.depth]
            .iter()
            .all(|cut| cut.normal.dot(u) >= cut.offset)
    }

    /// `ln` of the volume in `u` of a unit cube of grid coordinates.
    pub(crate) fn log_volume(&self) -> f64 {
        self.deviations.iter().map(|d| d.ln()).sum()
    }

    /// Whether another split is possible.
    pub(crate) fn can_split(&self) -> bool {
        self.depth < MAX_CUTS
    }

    /// Matrix from grid coordinates to `u`.
    pub(crate) fn basis(&self) -> SMatrix<f64, K, K> {
        SMatrix::from_fn(|i, j| self.axes[(i, j)] * self.deviations[j])
    }

    /// Moments of `u` from those of the grid coordinates.
    pub(crate) fn moments(
        &self,
        mean: &SVector<f64, K>,
        covariance: &SMatrix<f64, K, K>,
    ) -> (SVector<f64, K>, SMatrix<f64, K, K>) {
        let basis = self.basis();
        (self.centre + basis * mean, symmetrised(&(basis * covariance * basis.transpose())))
    }

    /// The next grid, along the principal axes of what was found. If the nodes are too far apart to measure a deviation, half a spacing is
    /// added to it, since the posterior may be between nodes.
    pub(crate) fn narrowed(self, found: &Found<K>) -> Self {
        let slack = if found.is_tempered() { 0.25 } else { 1.0 / 48.0 };
        let spread = found.covariance + SMatrix::identity() * (slack * found.step * found.step);
        let (centre, covariance) = self.moments(&found.mean, &spread);
        // The axes of the next grid are those of the posterior, so that few nodes fall where it is negligible.
        let (values, axes) = symmetric_eigen(covariance);
        let retries = self.retries + u32::from(!found.is_tempered());
        let wider = (1.0 / (found.step * NODES_PER_DEVIATION)).clamp(1.0, WIDER);
        let share = if retries > RETRIES { CLOSER } else { wider };
        Self {
            centre,
            axes,
            deviations: values.map(|v| share * v.max(f64::MIN_POSITIVE).sqrt()),
            retries,
            is_prediction: false,
            ..self
        }
    }

    /// The same grid with half the distance between its nodes.
    pub(crate) fn refined(self) -> Self {
        Self {
            nodes: 2 * self.nodes - 1,
            ..self
        }
    }

    /// The two sides of `along' t = offset`, a plane in grid coordinates.
    pub(crate) fn split(self, along: &SVector<f64, K>, offset: f64) -> [Self; 2] {
        // t = diag(1/deviations) axes' (u - centre)
        let normal = self.axes * along.component_div(&self.deviations);
        let offset = normal.dot(&self.centre) + offset;
        [(normal, offset), (-normal, -offset)].map(|(normal, offset)| {
            let mut side = self.clone();
            side.cuts[side.depth] = Cut { normal, offset };
            side.depth += 1;
            // Each side is a new posterior, which may narrow again.
            side.retries = 0;
            side
        })
    }
}
