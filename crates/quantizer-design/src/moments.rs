//! Sums over nodes of products of per-group tables. Most of the computing time is spent here.

use crate::deadline::Deadline;
use crate::observation_model::Feature;

/// Functions on the nodes, one per row.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Table {
    pub(crate) values: Vec<f64>,
    pub(crate) nodes: usize,
}

impl Table {
    pub(crate) fn new(values: Vec<f64>, nodes: usize) -> Self {
        Self { values, nodes }
    }

    pub(crate) fn rows(&self) -> usize {
        self.values.len() / self.nodes
    }

    pub(crate) fn row(&self, r: usize) -> &[f64] {
        &self.values[r * self.nodes..(r + 1) * self.nodes]
    }

    /// All products of a row of `self` and a row of `other`; the index of `other` varies faster.
    pub(crate) fn outer(&self, other: &Self) -> Self {
        let mut values = Vec::with_capacity(self.values.len() * other.rows());
        for a in 0..self.rows() {
            for b in 0..other.rows() {
                values.extend(self.row(a).iter().zip(other.row(b)).map(|(x, y)| x * y));
            }
        }
        Self::new(values, self.nodes)
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

/// [`dot`] of `a` with four rows, with the same bits; `a` is read only once.
#[inline]
fn dot_with_four(a: &[f64], rows: [&[f64]; 4]) -> [f64; 4] {
    let whole = a.len() / 4 * 4;
    let mut sums = [[0.0; 4]; 4];
    let (head, rest) = a.split_at(whole);
    let heads = rows.map(|row| &row[..whole]);
    for (k, x) in head.chunks_exact(4).enumerate() {
        for (sums, row) in sums.iter_mut().zip(heads) {
            let y = &row[4 * k..4 * k + 4];
            for i in 0..4 {
                sums[i] += x[i] * y[i];
            }
        }
    }
    [0, 1, 2, 3].map(|r| {
        let rest: f64 = rest.iter().zip(&rows[r][whole..]).map(|(x, y)| x * y).sum();
        (sums[r][0] + sums[r][1]) + (sums[r][2] + sums[r][3]) + rest
    })
}

/// `sum_node feature(node) prod_g table_g[r_g](node)` for every combination of one row per table, and every feature.
///
/// Layout of the result: the row of the first table varies slowest, the feature fastest.
pub(crate) fn moments(tables: &[&Table], features: &[Feature]) -> Vec<f64> {
    moments_until(tables, features, Deadline::NEVER).unwrap_or_default()
}

/// As [`moments`]; `None` if the time limit is reached first.
pub(crate) fn moments_until(tables: &[&Table], features: &[Feature], deadline: Deadline) -> Option<Vec<f64>> {
    let combinations: usize = tables.iter().map(|t| t.rows()).product();
    let mut out = Vec::with_capacity(combinations * features.len());
    if let Some((last, first)) = tables.split_last() {
        let ones = vec![1.0; last.nodes];
        let mut weighted = vec![0.0; last.nodes];
        descend(first, last, features, deadline, &ones, &mut weighted, &mut out)?;
    }
    Some(out)
}

fn descend(
    first: &[&Table],
    last: &Table,
    features: &[Feature],
    deadline: Deadline,
    prefix: &[f64],
    weighted: &mut [f64],
    out: &mut Vec<f64>,
) -> Option<()> {
    if let Some((table, rest)) = first.split_first() {
        let mut product = vec![0.0; prefix.len()];
        for r in 0..table.rows() {
            for ((p, x), y) in product.iter_mut().zip(prefix).zip(table.row(r)) {
                *p = x * y;
            }
            descend(rest, last, features, deadline, &product, weighted, out)?;
        }
        return Some(());
    }
    if deadline.is_over() {
        return None;
    }
    let base = out.len();
    out.resize(base + last.rows() * features.len(), 0.0);
    for (f, feature) in features.iter().enumerate() {
        let range = feature.start..feature.start + feature.weights.len();
        let weighted = &mut weighted[range.clone()];
        for ((w, x), y) in weighted.iter_mut().zip(&prefix[range.clone()]).zip(&feature.weights) {
            *w = x * y;
        }
        let mut at = base + f;
        let mut put = |sum| {
            out[at] = sum;
            at += features.len();
        };
        // Four dot products at a time, so that the common factor is read once.
        let fours = last.rows() / 4 * 4;
        for r in (0..fours).step_by(4) {
            let four = [0, 1, 2, 3].map(|i| &last.row(r + i)[range.clone()]);
            dot_with_four(weighted, four).into_iter().for_each(&mut put);
        }
        (fours..last.rows()).for_each(|r| put(dot(weighted, &last.row(r)[range.clone()])));
    }
    Some(())
}
