//! Joint outcomes on the nodes of a search.

use crate::observation::bank::CountTable;
use nalgebra::{DMatrixView, DMatrixViewMut, Dyn, Matrix, Storage};

/// Nodes for searching: half the width of the final ones suffices with fewer points, to about `1e-10`.
pub(crate) const SEARCH_PANEL: f64 = 1.6;

/// All outcomes of some groups of exchangeable sensors, on the nodes of a search.
pub(crate) struct Outcomes {
    /// `w p(x) P(outcome|x)`, one contiguous column an outcome.
    pub(crate) w: Vec<f64>,
    /// For each outcome the one that is as likely under `-x`; meaningful where the problem is symmetric.
    pub(crate) mirror: Vec<usize>,
}

impl Outcomes {
    /// Before any sensor has reported.
    pub(crate) fn new(weights: &[f64]) -> Self {
        Self {
            w: weights.to_vec(),
            mirror: vec![0],
        }
    }

    /// One group more; `flips` says that reflecting `x` flips its bits.
    pub(crate) fn with(&self, group: &CountTable, flips: bool) -> Self {
        let counts = group.rows.len();
        let nodes = self.w.len() / self.mirror.len();
        let mut w = Vec::with_capacity(self.w.len() * counts);
        let mut mirror = Vec::with_capacity(self.mirror.len() * counts);
        for (column, &image) in self.w.chunks_exact(nodes).zip(&self.mirror) {
            for (k, row) in group.rows.iter().enumerate() {
                w.extend(column.iter().zip(row).map(|(w, p)| w * p));
                mirror.push(image * counts + if flips { counts - 1 - k } else { k });
            }
        }
        Self { w, mirror }
    }

    /// `functions x outcomes`: every row of `functions` (over the nodes) integrated against every outcome, outcome by outcome.
    pub(crate) fn integrals<S: Storage<f64, Dyn, Dyn>>(&self, functions: &Matrix<f64, Dyn, Dyn, S>) -> Vec<f64> {
        let (rows, outcomes) = (functions.nrows(), self.mirror.len());
        let mut sums = vec![0.0; rows * outcomes];
        let w = DMatrixView::from_slice(&self.w, functions.ncols(), outcomes);
        DMatrixViewMut::from_slice(&mut sums, rows, outcomes).gemm(1.0, functions, &w, 0.0);
        sums
    }
}
