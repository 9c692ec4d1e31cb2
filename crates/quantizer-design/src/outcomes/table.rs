//! Functions on the nodes of a quadrature rule, and the probabilities of cells.

use fewbits_numerics::kernels;

/// Functions on the nodes, one per row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// All values, row by row.
    pub values: Vec<f64>,
    /// Number of nodes.
    pub nodes: usize,
}

/// Weights on a range of nodes: a linear functional of functions on the nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeWeights {
    /// The first node of the range.
    pub start: usize,
    /// The weights, from the first node of the range on.
    pub weights: Vec<f64>,
}

impl NodeWeights {
    /// A weight for every node.
    pub fn of_all(weights: Vec<f64>) -> Self {
        Self { start: 0, weights }
    }

    /// The sum of a function on the nodes with these weights.
    pub(crate) fn of(&self, function: &[f64]) -> f64 {
        dot(&self.weights, &function[self.start..self.start + self.weights.len()])
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
        intervals(&mut lower, &upper);
        values.extend_from_slice(&lower);
        lower = upper;
    }
    Table::new(values, means.len())
}

/// Nodes that are looked at together.
const RUN: usize = 64;
/// Beyond it the normal distribution is 0 or 1 in double precision.
pub(crate) const SETTLED: f64 = 40.0;

/// `Phi(upper) - Phi(lower)` in place of `lower`, to the bit as [`kernels::interval`]. Runs of nodes that are far from both edges, most where
/// the noise is small, take no exponentials.
pub(crate) fn intervals(lower: &mut [f64], upper: &[f64]) {
    if lower.len() < 16 * RUN {
        return kernels::interval(lower, upper);
    }
    let is_settled = |edges: &[f64]| edges.iter().all(|z| z.abs() > SETTLED);
    for (lower, upper) in lower.chunks_mut(RUN).zip(upper.chunks(RUN)) {
        if is_settled(lower) && is_settled(upper) {
            let within = |(l, u): (&mut f64, &f64)| *l = f64::from(*l < 0.0 && *u > 0.0);
            lower.iter_mut().zip(upper).for_each(within);
        } else {
            kernels::interval(lower, upper);
        }
    }
}

/// Inner product with four independent sums, which the compiler vectorises.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a4.zip(b4) {
        for i in 0..4 {
            sums[i] += x[i] * y[i];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// `to += factor * from`.
pub(crate) fn add_scaled(to: &mut [f64], factor: f64, from: &[f64]) {
    if factor != 0.0 {
        to.iter_mut().zip(from).for_each(|(t, f)| *t += factor * f);
    }
}

#[cfg(test)]
mod tests {
    use super::{RUN, intervals};
    use fewbits_numerics::kernels;

    #[test]
    fn settled_runs_have_the_bits_of_the_kernel() {
        let count = 40 * RUN + 7;
        for width in [0.0, 1e-3, 3.0, 50.0, 200.0, f64::INFINITY] {
            let mut lower: Vec<f64> = (0..count).map(|i| 0.1 * i as f64 - 120.0).collect();
            let upper: Vec<f64> = lower.iter().map(|z| z + width).collect();
            let mut expected = lower.clone();
            kernels::interval(&mut expected, &upper);
            intervals(&mut lower, &upper);
            assert!(lower.iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits()), "{width}");
        }
    }
}
