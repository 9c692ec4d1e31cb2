//! Weights of particles: draws in proportion, rows that travel along, normalisation.

use crate::Error;
use fewbits_numerics::kernels::{exp_minus, largest_number, vectorised};
use rand::{Rng, RngExt};

/// Running sums of weights, for draws in proportion to them.
pub(crate) struct Cumulative {
    sums: Vec<f64>,
    last: usize,
}

impl Cumulative {
    pub(crate) fn new(weights: &[f64]) -> Self {
        let mut total = 0.0;
        let mut sum = |w: &f64| {
            total += w;
            total
        };
        Self {
            sums: weights.iter().map(&mut sum).collect(),
            last: weights.iter().rposition(|w| *w > 0.0).unwrap_or(0),
        }
    }

    /// An index of positive weight.
    pub(crate) fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> usize {
        let point = rng.random::<f64>() * self.sums.last().copied().unwrap_or(0.0);
        self.sums.partition_point(|sum| *sum <= point).min(self.last)
    }
}

/// Copies the chosen rows.
pub(crate) fn gather_rows(rows: &[f64], width: usize, chosen: &[u32], out: &mut Vec<f64>) {
    if width > 0 {
        for a in chosen {
            let start = *a as usize * width;
            out.extend_from_slice(&rows[start..start + width]);
        }
    }
}

/// Normalises log weights and writes their exponentials; returns `ln sum exp` and the effective
/// sample size. On failure `weights` is as it was.
pub(crate) fn normalise(logs: &mut [f64], weights: &mut [f64]) -> Result<(f64, f64), Error> {
    let what = "a log weight";
    let largest = largest_number(logs).ok_or(fewbits_core::Error::NotANumber { what })?;
    if !largest.is_finite() {
        return Err(fewbits_core::Error::unlikely_or_no_number(largest, what).into());
    }
    let sums = exp_minus(logs, largest, weights);
    let log_sum = largest + sums.sum.ln();
    let scale = 1.0 / sums.sum;
    vectorised(
        #[inline(always)]
        || {
            for (log, weight) in logs.iter_mut().zip(weights) {
                *log -= log_sum;
                *weight *= scale;
            }
        },
    );
    Ok((log_sum, sums.sum * sums.sum / sums.sum_of_squares))
}
