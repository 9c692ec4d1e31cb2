//! Linear maps along the axis of one group in a table of joint outcomes.
//!
//! A table holds a few moments for every joint outcome. The axis of a group runs over its count vectors. If a breakpoint moves, one report
//! may change from one symbol to another. This relates a table over `N` reports to one over `N - 1`.

use super::counts::Compositions;

/// Position of one group's axis in a table of joint outcomes: products of the sizes of the axes before and after it.
#[derive(Clone, Copy)]
pub(crate) struct Axis {
    pub(crate) outer: usize,
    pub(crate) inner: usize,
}

/// The part of a table that belongs to one block, if the axis has rows `(block, m)`.
pub(crate) fn slice(values: &[f64], axis: Axis, blocks: usize, rows: usize, block: usize) -> Vec<f64> {
    let chunk = rows * axis.inner;
    let mut out = Vec::with_capacity(axis.outer * chunk);
    for o in 0..axis.outer {
        let at = (o * blocks + block) * chunk;
        out.extend_from_slice(&values[at..at + chunk]);
    }
    out
}

/// `out(m) = (N - missing) sum_t c_t worth(m + e_t)` along the group's axis.
pub(crate) fn reduce(worth: &[f64], axis: Axis, compositions: &Compositions, missing: usize, c: &[f64]) -> Vec<f64> {
    let sensors = (compositions.total - missing) as f64;
    let (above, below) = (compositions.len_below(missing), compositions.len_below(missing + 1));
    let mut out = vec![0.0; axis.outer * below * axis.inner];
    for (o, block) in out.chunks_exact_mut(below * axis.inner).enumerate() {
        for (m, row) in block.chunks_exact_mut(axis.inner).enumerate() {
            for (t, at) in compositions.up(missing + 1)[m * c.len()..(m + 1) * c.len()]
                .iter()
                .enumerate()
            {
                // Cells that the breakpoint does not bound have coefficient zero.
                if c[t] != 0.0 {
                    let from = (o * above + at) * axis.inner;
                    let factor = sensors * c[t];
                    for (r, w) in row.iter_mut().zip(&worth[from..from + axis.inner]) {
                        *r += factor * w;
                    }
                }
            }
        }
    }
    out
}

/// The transpose of [`reduce`]: `out(m + e_t) += N c_t moved(m)`.
pub(crate) fn scatter(moved: &[f64], axis: Axis, compositions: &Compositions, c: &[f64]) -> Vec<f64> {
    let sensors = compositions.total as f64;
    let (above, below) = (compositions.len(), compositions.len_below(1));
    let mut out = vec![0.0; axis.outer * above * axis.inner];
    for o in 0..axis.outer {
        for m in 0..below {
            let from = (o * below + m) * axis.inner;
            for (t, at) in compositions.up(1)[m * c.len()..(m + 1) * c.len()].iter().enumerate() {
                if c[t] != 0.0 {
                    let to = (o * above + at) * axis.inner;
                    let factor = sensors * c[t];
                    for i in 0..axis.inner {
                        out[to + i] += factor * moved[from + i];
                    }
                }
            }
        }
    }
    out
}
