//! Sums over nodes of products of per-group tables. Most of the computing time is spent here.

use super::table::{NodeWeights, Table, dot};
use crate::deadline::Deadline;
use std::borrow::Borrow;
use std::ops::ControlFlow;

/// Outcomes of smaller probability are left out of sums of quotients; their contribution to any error is below `1e-280`.
pub const IMPOSSIBLE: f64 = 1e-290;

/// The part `moment^2 / mass` of the second moment that an outcome explains, given its probability and first moment.
#[inline]
pub fn explained(mass: f64, moment: f64) -> f64 {
    if mass > IMPOSSIBLE {
        moment * (moment / mass)
    } else {
        0.0
    }
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
/// Layout of the result: the row of the first table varies slowest, the feature fastest. All tables have the same nodes.
pub fn moments(tables: &[impl Borrow<Table>], features: &[NodeWeights]) -> Vec<f64> {
    moments_until(tables, features, Deadline::NEVER).unwrap_or_default()
}

/// As [`moments`]; `None` if the time limit is reached first.
pub(crate) fn moments_until(
    tables: &[impl Borrow<Table>],
    features: &[NodeWeights],
    deadline: Deadline,
) -> Option<Vec<f64>> {
    let combinations: usize = tables.iter().map(|t| t.borrow().rows()).product();
    let mut out = Vec::with_capacity(combinations * features.len());
    let Some((last, first)) = tables.split_last() else {
        return Some(out);
    };
    let last = last.borrow();
    let mut weighted = vec![0.0; last.nodes];
    let walked = combined(first, &vec![1.0; last.nodes], |x, y| x * y, &mut |_, prefix| {
        if deadline.is_over() {
            return ControlFlow::Break(());
        }
        sums_with(last, features, prefix, &mut weighted, &mut out);
        ControlFlow::Continue(())
    });
    walked.is_continue().then_some(out)
}

/// Visits every combination of one row per table: its index (the last table varies fastest), and `weights` times the product of the rows.
pub fn for_each(tables: &[impl Borrow<Table>], weights: &[f64], mut visit: impl FnMut(usize, &[f64])) {
    // Without a break the walk goes to its end.
    let _ = combined(tables, weights, |x, y| x * y, &mut |index, product| {
        visit(index, product);
        ControlFlow::Continue(())
    });
}

/// As [`for_each`], with the sum of `logs` and the rows: for tables of logarithms.
pub fn for_each_log(tables: &[impl Borrow<Table>], logs: &[f64], mut visit: impl FnMut(usize, &[f64])) {
    let _ = combined(tables, logs, |x, y| x + y, &mut |index, sum| {
        visit(index, sum);
        ControlFlow::Continue(())
    });
}

/// The rows of every combination joined node by node, until `visit` breaks. One row per table is kept.
fn combined(
    tables: &[impl Borrow<Table>],
    first: &[f64],
    join: impl Fn(f64, f64) -> f64 + Copy,
    visit: &mut impl FnMut(usize, &[f64]) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let mut levels = vec![vec![0.0; first.len()]; tables.len()];
    descend(tables, first, join, &mut levels, 0, visit)
}

fn descend(
    tables: &[impl Borrow<Table>],
    prefix: &[f64],
    join: impl Fn(f64, f64) -> f64 + Copy,
    levels: &mut [Vec<f64>],
    index: usize,
    visit: &mut impl FnMut(usize, &[f64]) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let (Some((table, tables)), Some((joined, levels))) = (tables.split_first(), levels.split_first_mut()) else {
        return visit(index, prefix);
    };
    let table = table.borrow();
    for (r, row) in table.iter().enumerate() {
        for ((out, x), y) in joined.iter_mut().zip(prefix).zip(row) {
            *out = join(*x, *y);
        }
        descend(tables, joined, join, levels, index * table.rows() + r, visit)?;
    }
    ControlFlow::Continue(())
}

/// Appends the sums of `prefix` with every row of the last table, for each feature.
fn sums_with(last: &Table, features: &[NodeWeights], prefix: &[f64], weighted: &mut [f64], out: &mut Vec<f64>) {
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
}
