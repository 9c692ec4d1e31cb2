//! Probabilities of quantizers and joint outcomes at the nodes of a search.

use crate::observation::source::{Nodes, Threshold};
use crate::{BinaryQuantizer, Source};
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_quantizer_design::outcomes::{Table, explained};
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, Dyn, Matrix, Storage};

/// Width of quadrature panels in a search, in noise standard deviations; errors of about `1e-10`.
pub(crate) const SEARCH_PANEL: f64 = 1.6;

/// All outcomes of some groups of exchangeable sensors, at the nodes of a search.
pub(crate) struct Outcomes {
    /// `w p(x) P(outcome|x)`, one row per outcome.
    pub(crate) w: Table,
    /// For each outcome, the index of the one with the same probability under `-x`; used only if the problem is symmetric.
    pub(crate) mirror: Vec<usize>,
}

impl Outcomes {
    /// The state before any sensor has reported.
    pub(crate) fn new(weights: &[f64]) -> Self {
        Self {
            w: Table::new(weights.to_vec(), weights.len()),
            mirror: vec![0],
        }
    }

    /// Adds a group; `flips` says whether the reflection of `x` inverts its bits.
    pub(crate) fn with(&self, group: &Table, flips: bool) -> Self {
        let counts = group.rows();
        let image = |k: usize| if flips { counts - 1 - k } else { k };
        let images = self
            .mirror
            .iter()
            .flat_map(|m| (0..counts).map(move |k| m * counts + image(k)));
        Self {
            mirror: images.collect(),
            w: self.w.outer(group),
        }
    }

    /// Integrals of every row of `functions` (values at the nodes) against every outcome: `functions x outcomes`, stored outcome by
    /// outcome.
    pub(crate) fn integrals<S: Storage<f64, Dyn, Dyn>>(&self, functions: &Matrix<f64, Dyn, Dyn, S>) -> Vec<f64> {
        let (rows, outcomes) = (functions.nrows(), self.mirror.len());
        let mut sums = vec![0.0; rows * outcomes];
        let w = DMatrixView::from_slice(&self.w.values, functions.ncols(), outcomes);
        DMatrixViewMut::from_slice(&mut sums, rows, outcomes).gemm(1.0, functions, &w, 0.0);
        sums
    }
}

/// The candidate quantizers of a search, at its nodes.
pub(crate) struct Candidates {
    pub(crate) nodes: Nodes,
    /// Whether all quantizers are symmetric about zero. Then only half of the nodes are used, and outcomes are paired with their mirror
    /// images.
    folded: bool,
    /// Whether the reflection of `x` inverts the bit of a quantizer.
    pub(crate) flips: Vec<bool>,
}

impl Candidates {
    /// Nodes for these quantizers at sensors with these noises.
    pub(crate) fn new(source: &Source, quantizers: &[BinaryQuantizer], noise_deviations: &[f64]) -> Self {
        let is_symmetric = |q: &BinaryQuantizer| {
            let t = q.breakpoints();
            t.iter().zip(t.iter().rev()).all(|(a, b)| a + b == 0.0)
        };
        let folded = quantizers.iter().all(is_symmetric);
        let mut edges: Vec<f64> = quantizers.iter().flat_map(|q| q.breakpoints()).copied().collect();
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        let of_noise = |noise: &f64| Threshold::of(&edges, *noise);
        let thresholds: Vec<Threshold> = noise_deviations.iter().flat_map(of_noise).collect();
        let reach = source.reach();
        let from = if folded { 0.0 } else { -reach };
        Self {
            nodes: Nodes::adapted(source, from, reach, &thresholds, SEARCH_PANEL, gauss_legendre::<8>()),
            folded,
            flips: quantizers.iter().map(|q| q.breakpoints().len() % 2 == 1).collect(),
        }
    }

    /// For every table and count, two rows: the probability at the nodes, and the same times `x`.
    pub(crate) fn integrands<'t>(&self, tables: impl Iterator<Item = &'t Table>) -> DMatrix<f64> {
        let rows: Vec<&[f64]> = tables.flat_map(Table::iter).collect();
        DMatrix::from_fn(2 * rows.len(), self.nodes.points.len(), |row, at| {
            let p = rows[row / 2][at];
            if row % 2 == 0 { p } else { p * self.nodes.points[at] }
        })
    }

    /// Variance explained by the outcomes of some groups together with the counts of one more group of `count` sensors with quantizer
    /// `candidate`. `sums` has `rows` [`integrals`](Outcomes::integrals) per outcome; those of this group begin at `first`.
    pub(crate) fn explained(
        &self,
        outcomes: &Outcomes,
        sums: &[f64],
        [rows, first]: [usize; 2],
        count: usize,
        candidate: usize,
    ) -> f64 {
        let mut total = 0.0;
        for (outcome, &image) in outcomes.mirror.iter().enumerate() {
            for k in 0..=count {
                let at = |outcome: usize, k: usize| outcome * rows + first + 2 * k;
                let here = at(outcome, k);
                let (mut mass, mut moment) = (sums[here], sums[here + 1]);
                // By symmetry only half of the axis is integrated. The other half gives the mirrored outcome, with the sign of the moment
                // changed.
                if self.folded {
                    let there = at(image, if self.flips[candidate] { count - k } else { k });
                    mass += sums[there];
                    moment -= sums[there + 1];
                }
                total += explained(mass, moment);
            }
        }
        total
    }
}
