//! Sweeps of [`Levels`] over many noise-free measurements, in vector registers.

use super::super::scalar::middle;
use super::{Cells, Levels};
use crate::cell::Cell;
use crate::columns::{Columns, lengths_agree};
use crate::error::Error;
use crate::factor::{Factor, Scalar, Tilted};
use crate::gaussian::Gaussian;
use crate::noise::{Noise, RangeNoise};
use fewbits_numerics::kernels::{self, scalar};
use nalgebra::SVector;

/// Number of means that are processed together.
const BLOCK: usize = 128;
/// Probabilities below this have lost digits; the sum is then taken over logarithms.
const MIN_PROBABILITY: f64 = 1e-280;

/// Adds `p P(lower < m + n < upper)` for every mean.
fn add_cell(means: &[f64], cell: &Cell, scale: f64, p: f64, probabilities: &mut [f64]) {
    use kernels::scalar::{cdf, interval};
    let (lower, upper) = (cell.lower(), cell.upper());
    let pairs = probabilities.iter_mut().zip(means);
    if lower == f64::NEG_INFINITY && upper == f64::INFINITY {
        pairs.for_each(|(sum, _)| *sum += p);
    } else if let Some((edge, sign)) = only_edge(cell) {
        let scale = sign * scale;
        kernels::vectorised(
            #[inline(always)]
            || {
                for (sum, m) in pairs {
                    *sum += p * cdf((m - edge) * scale);
                }
            },
        );
    } else {
        kernels::vectorised(
            #[inline(always)]
            || {
                for (sum, m) in pairs {
                    *sum += p * interval((lower - m) * scale, (upper - m) * scale);
                }
            },
        );
    }
}

/// The finite edge of a half-line, and 1 if the half-line is above it or -1 if it is below.
fn only_edge(cell: &Cell) -> Option<(f64, f64)> {
    if cell.upper() == f64::INFINITY {
        Some((cell.lower(), 1.0))
    } else {
        (cell.lower() == f64::NEG_INFINITY).then(|| (cell.upper(), -1.0))
    }
}

/// Adds `log(m)` to the log weight of every mean, vectorised. `log` must be inlined for that.
#[inline(always)]
fn add_to_each(log_weights: &mut [f64], means: &[f64], log: impl Fn(f64) -> f64) {
    kernels::vectorised(
        #[inline(always)]
        || {
            for (log_weight, m) in log_weights.iter_mut().zip(means) {
                *log_weight += log(*m);
            }
        },
    );
}

impl Levels {
    /// One cell in noise of one variance. Writes probabilities into a short buffer first and takes logarithms second: each loop runs in
    /// vector registers.
    fn add_one(&self, cell: &Cell, weight: f64, means: &[f64], log_weights: &mut [f64]) {
        let (lower, upper) = (cell.lower(), cell.upper());
        let (scale, floor, constant) = (1.0 / self.deviation, self.floor, self.log_scale);
        let edge = only_edge(cell);
        let wide = (upper - lower) * scale >= scalar::WIDE;
        let (mut buffer, mut upper_edges) = ([0.0; BLOCK], [0.0; BLOCK]);
        for (log_weights, means) in log_weights.chunks_mut(BLOCK).zip(means.chunks(BLOCK)) {
            let buffer = &mut buffer[..means.len()];
            if let Some((edge, sign)) = edge {
                let scale = sign * scale;
                buffer.iter_mut().zip(means).for_each(|(x, m)| *x = (m - edge) * scale);
                match floor > 0.0 {
                    true => kernels::cdf(buffer),
                    false => kernels::log_cdf(buffer),
                }
            } else {
                let upper_edges = &mut upper_edges[..means.len()];
                for ((low, high), m) in buffer.iter_mut().zip(&mut *upper_edges).zip(means) {
                    (*low, *high) = ((lower - m) * scale, (upper - m) * scale);
                }
                match (floor > 0.0, wide) {
                    (true, false) => kernels::interval(buffer, upper_edges),
                    (true, true) => kernels::interval_wide(buffer, upper_edges),
                    (false, false) => kernels::log_interval(buffer, upper_edges),
                    (false, true) => kernels::log_interval_wide(buffer, upper_edges),
                }
            }
            // With a floor the buffer holds probabilities, otherwise logarithms, which do not underflow far from the cell.
            if floor > 0.0 {
                buffer.iter_mut().for_each(|p| *p = floor + weight * *p);
                kernels::ln(buffer);
            }
            let pairs = log_weights.iter_mut().zip(buffer);
            pairs.for_each(|(log_weight, log)| *log_weight += constant + *log);
        }
    }

    /// Many cells in noise of one variance.
    fn add_many(&self, cells: &[(Cell, f64)], means: &[f64], log_weights: &mut [f64]) {
        let mut probabilities = [0.0; BLOCK];
        for (log_weights, means) in log_weights.chunks_mut(BLOCK).zip(means.chunks(BLOCK)) {
            let probabilities = &mut probabilities[..means.len()];
            probabilities.fill(self.floor);
            for (cell, p) in cells {
                add_cell(means, cell, 1.0 / self.deviation, *p, probabilities);
            }
            kernels::vectorised(
                #[inline(always)]
                || {
                    for (log_weight, p) in log_weights.iter_mut().zip(&*probabilities) {
                        // Where the probability is tiny, the logarithms below replace it.
                        let p = if *p > MIN_PROBABILITY { *p } else { 1.0 };
                        *log_weight += self.log_scale + scalar::ln(if p < 1.0 { p } else { 1.0 });
                    }
                },
            );
            for ((log_weight, m), p) in log_weights.iter_mut().zip(means).zip(&*probabilities) {
                // The whole line has probability one even for a mean of NaN, which must not raise the weight.
                if *p <= MIN_PROBABILITY || p.is_nan() || m.is_nan() {
                    *log_weight += self.log_probability(*m) - self.log_scale;
                }
            }
        }
    }

    /// One cell without a floor, in noise whose deviation grows with the measurement.
    fn add_range(&self, cell: &Cell, noise: RangeNoise, means: &[f64], log_weights: &mut [f64]) {
        let (lower, upper, constant) = (cell.lower(), cell.upper(), self.log_scale);
        let largest = |most: f64, m: &f64| if m.abs() > most { m.abs() } else { most };
        if let Some((edge, sign)) = only_edge(cell) {
            add_to_each(
                log_weights,
                means,
                #[inline(always)]
                |m| constant + scalar::log_cdf(sign * ((m - edge) / noise.deviation(m))),
            );
        } else if upper - lower > 17.0 * noise.deviation(means.iter().fold(0.0, largest)) {
            // Only the nearer edge of a cell wider than 17 deviations matters: the other tail is below the rounding of the sum.
            add_to_each(
                log_weights,
                means,
                #[inline(always)]
                |m| {
                    let (above, below) = (m - lower, upper - m);
                    let inside = if above < below { above } else { below };
                    constant + scalar::log_cdf(inside / noise.deviation(m))
                },
            );
        } else {
            add_to_each(
                log_weights,
                means,
                #[inline(always)]
                |m| {
                    let deviation = noise.deviation(m);
                    constant + scalar::log_interval((lower - m) / deviation, (upper - m) / deviation)
                },
            );
        }
    }
}

impl Factor<1> for Levels {
    #[inline]
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.log_probability(m[0])
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        if !lengths_agree(means, log_weights) {
            return;
        }
        match (&self.cells, self.noise) {
            (Cells::One(cell, weight), Noise::Variance(_)) => self.add_one(cell, *weight, means[0], log_weights),
            (Cells::Many(cells), Noise::Variance(_)) => self.add_many(cells, means[0], log_weights),
            (Cells::One(cell, _), Noise::Range(noise)) if self.floor == 0.0 => {
                self.add_range(cell, noise, means[0], log_weights);
            }
            _ => {
                let pairs = log_weights.iter_mut().zip(means[0]);
                pairs.for_each(|(log_weight, m)| *log_weight += self.log_probability(*m));
            }
        }
    }

    fn location(&self) -> Option<SVector<f64, 1>> {
        middle(self.features().into_iter())
    }

    fn as_scalar(&self) -> Option<Scalar> {
        matches!(self.noise, Noise::Variance(_)).then(|| self.clone().into())
    }

    #[inline]
    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        self.posterior(prior)
    }
}
