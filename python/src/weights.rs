//! Weights of particles that are not divided by their sum, so that a step passes over them as rarely as possible.

use fewbits_filters::Error;
use fewbits_numerics::kernels::{LANES, exp_minus, folded, largest_number, vectorised};
use serde::{Deserialize, Serialize};

/// Log weights that are processed together: they stay in the first-level cache.
const BLOCK: usize = 1024;
/// Largest distance of the centre of sums of squares from the mean, in standard deviations: the variance then loses three digits at most.
const FAR: f64 = 30.0;

/// Positive factors times the weights, and their logarithms up to a constant.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Weights {
    logs: Vec<f64>,
    /// Logarithm of the sum of the exponentials of `logs`.
    log_sum: f64,
    /// The weights times their sum.
    scaled: Vec<f64>,
    sum: f64,
    effective_sample_size: f64,
}

/// What a likelihood is added to.
pub(crate) enum Before<'a> {
    /// Equal weights.
    Equal,
    /// The weights before the step.
    Of(&'a Weights),
    /// What is there.
    Sum,
}

/// Writes the log weights after one more likelihood. Returns the largest, or `None` if one is NaN.
pub(crate) fn add(logs: &mut [f64], before: &Before<'_>, found: &[f64]) -> Option<f64> {
    let mut largest = Some(f64::NEG_INFINITY);
    for (block, (logs, found)) in logs.chunks_mut(BLOCK).zip(found.chunks(BLOCK)).enumerate() {
        match before {
            Before::Equal => logs.copy_from_slice(found),
            Before::Of(weights) => {
                let earlier = &weights.logs[block * BLOCK..][..logs.len()];
                vectorised(
                    #[inline(always)]
                    || {
                        for ((log, earlier), found) in logs.iter_mut().zip(earlier).zip(found) {
                            *log = (earlier - weights.log_sum) + found;
                        }
                    },
                );
            }
            Before::Sum => vectorised(
                #[inline(always)]
                || logs.iter_mut().zip(found).for_each(|(log, found)| *log += found),
            ),
        }
        largest = largest.zip(largest_number(logs)).map(|(one, other)| one.max(other));
    }
    largest
}

/// Sums of exponentials of log weights.
pub(crate) struct Sums {
    /// Relative to the largest.
    pub(crate) sum: f64,
    /// Logarithm of the sum, not relative.
    pub(crate) log_sum: f64,
    pub(crate) effective_sample_size: f64,
}

/// Writes the exponentials of log weights of the given largest one, relative to it: none overflows, and the sum is at least one. On failure
/// nothing is written.
pub(crate) fn exponentials(logs: &[f64], largest: Option<f64>, out: &mut [f64]) -> Result<Sums, Error> {
    match largest {
        Some(f64::NEG_INFINITY) => Err(Error::Impossible),
        Some(largest) if largest < f64::INFINITY => {
            let sums = exp_minus(logs, largest, out);
            Ok(Sums {
                sum: sums.sum,
                log_sum: largest + sums.sum.ln(),
                effective_sample_size: sums.sum * sums.sum / sums.sum_of_squares,
            })
        }
        _ => Err(Error::NotANumber { what: "a log weight" }),
    }
}

impl Weights {
    /// `count` equal weights.
    pub(crate) fn equal(count: usize) -> Self {
        let mut made = Self {
            logs: vec![0.0; count],
            log_sum: 0.0,
            scaled: vec![1.0; count],
            sum: 0.0,
            effective_sample_size: 0.0,
        };
        made.make_equal();
        made
    }

    pub(crate) fn make_equal(&mut self) {
        let count = self.logs.len() as f64;
        self.logs.fill(0.0);
        self.scaled.fill(1.0);
        (self.log_sum, self.sum, self.effective_sample_size) = (count.ln(), count, count);
    }

    /// Takes on new log weights of the given largest one; `logs` then has the earlier ones. Returns the logarithm of the sum of their
    /// exponentials. On failure nothing is changed.
    pub(crate) fn replace(&mut self, logs: &mut Vec<f64>, largest: Option<f64>) -> Result<f64, Error> {
        let sums = exponentials(logs, largest, &mut self.scaled)?;
        (self.sum, self.log_sum) = (sums.sum, sums.log_sum);
        self.effective_sample_size = sums.effective_sample_size;
        std::mem::swap(&mut self.logs, logs);
        Ok(self.log_sum)
    }

    /// Whether these, of a stored state, are weights.
    pub(crate) fn are_valid(&self) -> bool {
        let sum = self.scaled.iter().sum::<f64>();
        let are_weights = self.scaled.iter().all(|x| *x >= 0.0) && sum > 0.0 && (sum / self.sum - 1.0).abs() < 1e-9;
        self.logs.len() == self.scaled.len() && are_weights && self.log_sum.is_finite()
    }

    pub(crate) fn len(&self) -> usize {
        self.logs.len()
    }

    pub(crate) fn effective_sample_size(&self) -> f64 {
        self.effective_sample_size
    }

    /// The weights times their sum.
    pub(crate) fn scaled(&self) -> &[f64] {
        &self.scaled
    }

    /// The weights, which sum to one.
    pub(crate) fn normalised(&self) -> Vec<f64> {
        self.scaled.iter().map(|weight| weight / self.sum).collect()
    }

    /// Weighted mean and variance of a coordinate.
    pub(crate) fn moments(&self, column: &[f64]) -> (f64, f64) {
        // In one pass, unless the first particle is far from the mean.
        let centre = column.first().copied().unwrap_or(0.0);
        let (mean, variance) = self.moments_about(centre, column);
        if (mean - centre).abs() <= FAR * variance.sqrt() {
            return (mean, variance);
        }
        self.moments_about(mean, column)
    }

    fn moments_about(&self, centre: f64, column: &[f64]) -> (f64, f64) {
        let (first, second) = vectorised(
            #[inline(always)]
            || {
                let (weights, column) = (self.scaled.chunks_exact(LANES), column.chunks_exact(LANES));
                let (mut first, mut second) = ([0.0; LANES], [0.0; LANES]);
                for (j, (w, x)) in weights.remainder().iter().zip(column.remainder()).enumerate() {
                    first[j] = w * (x - centre);
                    second[j] = first[j] * (x - centre);
                }
                for (w, x) in weights.zip(column) {
                    for j in 0..LANES {
                        let part = w[j] * (x[j] - centre);
                        first[j] += part;
                        second[j] += part * (x[j] - centre);
                    }
                }
                (folded(first), folded(second))
            },
        );
        let shift = first / self.sum;
        (centre + shift, (second / self.sum - shift * shift).max(0.0))
    }
}
