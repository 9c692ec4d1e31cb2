//! Kernel estimates in the plane at many points: binning, two passes of a filter, interpolation.

use crate::{Error, KernelEstimate};
use fewbits_core::Columns;
use fewbits_numerics::ArgumentError;
use nalgebra::SVector;

/// A kernel estimate in the plane, tabulated on a grid of an eighth of the kernel's width.
///
/// Particles are spread linearly over the four nodes around them, the grid is smoothed along each axis, and densities are read
/// off by cubic interpolation. The largest error is about 0.3% of the density; in the tails, where the
/// density is below `1e-6` of its peak, use [`KernelEstimate::log_pdf_columns`]. For pictures and averages, not for suprema.
///
/// Linear binning widens the kernel by `step^2/6`; the filter is made narrower by as much.
#[derive(Debug, Clone, PartialEq)]
pub struct TabulatedEstimate {
    white: crate::matrix::Factored<2>,
    origin: SVector<f64, 2>,
    lower: [f64; 2],
    counts: [usize; 2],
    values: Vec<f64>,
    scale: f64,
}

/// Nodes per kernel standard deviation.
const FINENESS: f64 = 8.0;
/// The kernel is cut off here, in its standard deviations.
const REACH: f64 = 7.0;
/// The most nodes of a table.
const MOST_NODES: f64 = 2e7;

impl TabulatedEstimate {
    /// Tabulates the estimate.
    ///
    /// # Errors
    /// If the particles spread over so many kernel widths that the table would have over 2e7 nodes.
    pub fn new(estimate: &KernelEstimate<2>) -> Result<Self, Error> {
        let step = 1.0 / FINENESS;
        let margin = REACH + 3.0 * step;
        let mut lower = [0.0; 2];
        let mut counts = [0; 2];
        let mut nodes = 1.0;
        for d in 0..2 {
            let column = &estimate.white()[d];
            let low = column.iter().fold(f64::INFINITY, |m, x| m.min(*x)) - margin;
            let high = column.iter().fold(f64::NEG_INFINITY, |m, x| m.max(*x)) + margin;
            let count = ((high - low) / step).ceil() + 2.0;
            nodes *= count;
            if nodes.is_nan() || nodes > MOST_NODES {
                let expected = "a sample within some thousand kernel widths";
                return Err(ArgumentError::new(
                    "estimate",
                    format!("a sample {} kernel widths wide", high - low),
                    expected,
                )
                .into());
            }
            lower[d] = low;
            counts[d] = count as usize;
        }
        let mut binned = vec![0.0; counts[0] * counts[1]];
        for (i, w) in estimate.particles().weights().iter().enumerate() {
            let [(a, s), (b, t)] = [0, 1].map(|d| {
                let at = (estimate.white()[d][i] - lower[d]) / step;
                (at.floor() as usize, at - at.floor())
            });
            let at = a * counts[1] + b;
            binned[at] += w * (1.0 - s) * (1.0 - t);
            binned[at + 1] += w * (1.0 - s) * t;
            binned[at + counts[1]] += w * s * (1.0 - t);
            binned[at + counts[1] + 1] += w * s * t;
        }
        // Linear binning has variance step^2/6 averaged over positions within a cell.
        let variance = 1.0 - step * step / 6.0;
        let half = (REACH * FINENESS) as usize;
        let kernel: Vec<f64> = (0..=half)
            .map(|k| (-0.5 * (k as f64 * step).powi(2) / variance).exp() / (std::f64::consts::TAU * variance).sqrt())
            .collect();
        let rows = smoothed_rows(&binned, counts, &kernel);
        let columns = smoothed_rows(&transposed(&rows, counts), [counts[1], counts[0]], &kernel);
        let values = transposed(&columns, [counts[1], counts[0]]);
        Ok(Self {
            white: *estimate.factor(),
            origin: estimate.particles().mean(),
            lower,
            counts,
            values,
            scale: (-estimate.factor().half_log_det).exp(),
        })
    }

    /// Writes the density (not its logarithm) of every point to `out`; 0 outside the table.
    pub fn pdf_columns(&self, columns: Columns<'_, 2>, out: &mut [f64]) {
        if !fewbits_core::columns::lengths_agree(&columns, out) {
            return;
        }
        for (k, out) in out.iter_mut().enumerate() {
            let gap = SVector::<f64, 2>::new(columns[0][k] - self.origin[0], columns[1][k] - self.origin[1]);
            let z = self.white.whitener * gap;
            *out = self.scale * self.interpolated([z[0], z[1]]);
        }
    }

    fn interpolated(&self, z: [f64; 2]) -> f64 {
        let at: [f64; 2] = std::array::from_fn(|d| (z[d] - self.lower[d]) * FINENESS);
        // One node more on each side for the cubic.
        if !(0..2).all(|d| at[d] >= 1.0 && at[d] < self.counts[d] as f64 - 3.0) {
            return 0.0;
        }
        let base = at.map(|x| x.floor() as usize);
        let [u, v] = [0, 1].map(|d| cubic(at[d] - at[d].floor()));
        let mut total = 0.0;
        for (i, u) in u.iter().enumerate() {
            let row = (base[0] + i - 1) * self.counts[1] + base[1] - 1;
            let line = &self.values[row..row + 4];
            total += u * (v[0] * line[0] + v[1] * line[1] + v[2] * line[2] + v[3] * line[3]);
        }
        total.max(0.0)
    }
}

/// Lagrange weights of the nodes `-1, 0, 1, 2` at `t` in `[0, 1)`.
fn cubic(t: f64) -> [f64; 4] {
    [
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -(t + 1.0) * t * (t - 2.0) / 2.0,
        (t + 1.0) * t * (t - 1.0) / 6.0,
    ]
}

/// Each row filtered by a symmetric kernel given from its centre outwards. Rows of zeros are passed over.
fn smoothed_rows(values: &[f64], counts: [usize; 2], kernel: &[f64]) -> Vec<f64> {
    let [_, n] = counts;
    let mut out = vec![0.0; values.len()];
    for (row, out) in values.chunks(n).zip(out.chunks_mut(n)) {
        for (k, value) in row.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            let low = k.saturating_sub(kernel.len());
            let high = (k + kernel.len()).min(n);
            let (left, right) = out[low..high].split_at_mut(k - low);
            left.iter_mut()
                .rev()
                .zip(&kernel[1..])
                .for_each(|(o, w)| *o += value * w);
            right.iter_mut().zip(kernel).for_each(|(o, w)| *o += value * w);
        }
    }
    out
}

fn transposed(values: &[f64], counts: [usize; 2]) -> Vec<f64> {
    let [rows, columns] = counts;
    let mut out = vec![0.0; values.len()];
    for r in 0..rows {
        for c in 0..columns {
            out[c * rows + r] = values[r * columns + c];
        }
    }
    out
}
