//! Functions on the nodes of a quadrature rule, and the probabilities of cells.

use fewbits_numerics::kernels;

/// Functions on the nodes, one per row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    pub(crate) values: Vec<f64>,
    pub(crate) nodes: usize,
}

/// Weights on a range of nodes: a linear functional of functions on the nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Feature {
    pub(crate) start: usize,
    pub(crate) weights: Vec<f64>,
}

impl Feature {
    /// A weight for every node.
    pub fn of_all(weights: Vec<f64>) -> Self {
        Self { start: 0, weights }
    }

    /// The first node of the range.
    pub fn start(&self) -> usize {
        self.start
    }

    /// The weights, from the first node of the range on.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }
}

impl Table {
    /// A table of `values`, row by row, on so many nodes.
    pub fn new(values: Vec<f64>, nodes: usize) -> Self {
        Self { values, nodes }
    }

    /// Number of rows; 0 without nodes.
    pub fn rows(&self) -> usize {
        self.values.len().checked_div(self.nodes).unwrap_or(0)
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// All values, row by row.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// A row, of which there must be that many.
    pub fn row(&self, r: usize) -> &[f64] {
        &self.values[r * self.nodes..(r + 1) * self.nodes]
    }

    /// All rows.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.nodes.max(1))
    }

    /// All products of a row of `self` and a row of `other`; the index of `other` varies faster.
    pub fn outer(&self, other: &Self) -> Self {
        let mut values = Vec::with_capacity(self.values.len() * other.rows());
        for a in self.iter() {
            for b in other.iter() {
                values.extend(a.iter().zip(b).map(|(x, y)| x * y));
            }
        }
        Self::new(values, self.nodes)
    }

    /// Row `t` of the result is the sum of `share(t, r)` times row `r`.
    pub fn mixed(&self, rows: usize, share: impl Fn(usize, usize) -> f64) -> Self {
        let mut values = vec![0.0; rows * self.nodes];
        for (t, out) in values.chunks_exact_mut(self.nodes.max(1)).enumerate() {
            for (r, row) in self.iter().enumerate() {
                add_scaled(out, share(t, r), row);
            }
        }
        Self::new(values, self.nodes)
    }
}

/// Probability of each cell between breakpoints, for normal samples with these means and this standard deviation: one row per cell, one
/// column per mean.
pub fn cell_probabilities(means: &[f64], deviation: f64, breakpoints: &[f64]) -> Table {
    let mut values = Vec::with_capacity((breakpoints.len() + 1) * means.len());
    let mut lower = vec![f64::NEG_INFINITY; means.len()];
    for edge in breakpoints.iter().copied().chain([f64::INFINITY]) {
        let upper: Vec<f64> = means.iter().map(|m| (edge - m) / deviation).collect();
        kernels::interval(&mut lower, &upper);
        values.extend_from_slice(&lower);
        lower = upper;
    }
    Table::new(values, means.len())
}

/// `to += factor * from`.
pub(crate) fn add_scaled(to: &mut [f64], factor: f64, from: &[f64]) {
    if factor != 0.0 {
        to.iter_mut().zip(from).for_each(|(t, f)| *t += factor * f);
    }
}
