//! Weights of particles: random selection in proportion, copies of auxiliary rows, normalisation.

use crate::Error;
use fewbits_numerics::kernels::{exp_minus, largest_number, vectorised};
use rand::{Rng, RngExt};

/// Draws indices with probability proportional to weights, by cumulative sums: `O(n)` to prepare, `O(log n)` per draw.
///
/// ```
/// use fewbits_densities::Categorical;
/// use rand::SeedableRng;
/// let weighted = Categorical::new(&[0.0, 2.0, 0.0]);
/// assert_eq!(weighted.draw(&mut rand_pcg::Pcg64Mcg::seed_from_u64(1)), 1);
/// ```
#[derive(Debug, Clone)]
pub struct Categorical {
    sums: Vec<f64>,
    last: usize,
}

impl Categorical {
    /// Prepares draws from weights of any sum, each zero or positive. If all are zero, every draw is index 0.
    pub fn new(weights: &[f64]) -> Self {
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

    /// Draws an index of positive weight.
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> usize {
        // Rounding may put the point at the total, beyond the last index of positive weight.
        let point = rng.random::<f64>() * self.sums.last().copied().unwrap_or(0.0);
        self.sums.partition_point(|sum| *sum <= point).min(self.last)
    }
}

/// Copies the rows with the chosen indices to `out`.
pub(crate) fn gather_rows(rows: &[f64], width: usize, chosen: &[u32], out: &mut Vec<f64>) {
    if width > 0 {
        for a in chosen {
            let start = *a as usize * width;
            out.extend_from_slice(&rows[start..start + width]);
        }
    }
}

/// Normalises log weights and writes their exponentials to `weights`. Returns `ln sum exp` and the effective sample size. On failure
/// `weights` is unchanged.
pub(crate) fn normalise(logs: &mut [f64], weights: &mut [f64]) -> Result<(f64, f64), Error> {
    let what = "a log weight";
    let largest = largest_number(logs).ok_or(Error::NotANumber { what })?;
    if !largest.is_finite() {
        return Err(Error::unlikely_or_no_number(largest, what));
    }
    // Relative to the largest, so that no exponential overflows and the sum is at least one.
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
