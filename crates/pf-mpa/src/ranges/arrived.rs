//! What arrives of a range: a number, or the level of its innovation.

use super::columns::Columns;
use crate::Error;
use crate::quantized::RangeReference;
use fewbits_numerics::kernels::{scalar, vectorised};
use fewbits_numerics::normal;

/// Mean squared error of a normal variable of unit variance given its level: 1, 2, 3, 4 bits.
const DISTORTION: [f64; 4] = [0.363, 0.119, 0.037, 0.012];

/// What arrived: a range in full, or the level of its innovation.
#[derive(Debug, Clone, Copy)]
pub(super) enum Arrived {
    Value(f64),
    /// The first range of an instant whose clock is unknown: it tells the clock, and nothing of the anchor.
    First(f64),
    Level {
        /// Ends of the level's cell; those of the first and the last are infinite.
        lower: f64,
        upper: f64,
        levels: usize,
        /// From the middle of the cells to the outermost edge.
        half_width: f64,
    },
}

impl Arrived {
    /// A level about a reference.
    ///
    /// # Errors
    /// If there is no such level, or the ends of its cell coincide after rounding.
    pub(super) fn level(level: usize, levels: usize, reference: &RangeReference) -> Result<Self, Error> {
        let cell = reference.nominal_cell(level, levels)?;
        Ok(Self::Level {
            lower: if level == 0 { f64::NEG_INFINITY } else { cell.lower() },
            upper: if level + 1 == levels {
                f64::INFINITY
            } else {
                cell.upper()
            },
            levels,
            half_width: reference.half_width,
        })
    }

    /// Density or probability of what arrived if the range does not depend on the distance.
    pub(super) fn stray(&self, width: f64) -> f64 {
        match self {
            Self::Value(_) | Self::First(_) => 1.0 / width,
            Self::Level {
                lower,
                upper,
                levels,
                half_width,
            } => {
                let inner = (2.0 * half_width / width).min(1.0) / *levels as f64;
                if lower.is_finite() && upper.is_finite() {
                    inner
                } else {
                    0.5 * (1.0 - (*levels - 2) as f64 * inner)
                }
            }
        }
    }

    /// For each filter density or probability of what arrived, mean and variance of the noise-free range afterwards, and the innovation in its
    /// own deviations, with variance one.
    pub(super) fn right(&self, columns: &mut Columns) -> Result<(), Error> {
        columns.extend();
        let count = columns.mean.len();
        let (mean, variance, total) = (&columns.mean[..count], &columns.variance[..count], &columns.total[..count]);
        let (density, after) = (&mut columns.density[..count], &mut columns.after[..count]);
        let (left, scores) = (&mut columns.left[..count], &mut columns.score[..count]);
        match *self {
            Self::Value(value) | Self::First(value) => vectorised(
                #[inline(always)]
                || {
                    for k in 0..count {
                        let deviation = total[k].sqrt();
                        let gain = variance[k] / total[k];
                        let score = (value - mean[k]) / deviation;
                        density[k] = scalar::pdf(score) / deviation;
                        after[k] = mean[k] + gain * deviation * score;
                        left[k] = variance[k] * (1.0 - gain);
                        scores[k] = score;
                    }
                },
            ),
            Self::Level {
                lower, upper, levels, ..
            } => {
                let bits = (levels.ilog2() as usize).clamp(1, DISTORTION.len());
                let of_score = (1.0 - DISTORTION[bits - 1]).sqrt();
                for k in 0..count {
                    let deviation = total[k].sqrt();
                    let gain = variance[k] / total[k];
                    // An infinite end stays infinite.
                    let edge = |edge: f64| (edge - mean[k]) / deviation;
                    let (log_probability, middle, rest) = in_cell(edge(lower), edge(upper))?;
                    density[k] = log_probability.exp();
                    after[k] = mean[k] + gain * deviation * middle;
                    left[k] = variance[k] * (1.0 - gain) + variance[k] * gain * rest;
                    scores[k] = middle / of_score;
                }
            }
        }
        Ok(())
    }
}

/// `ln` of the probability of a cell of a standard normal variable, and its mean and variance there. A half-line takes half as long.
fn in_cell(lower: f64, upper: f64) -> Result<(f64, f64, f64), Error> {
    if upper == f64::INFINITY && lower.is_finite() {
        let found = normal::one_sided(-lower);
        Ok((found.log_probability, found.mean, found.variance))
    } else if lower == f64::NEG_INFINITY && upper.is_finite() {
        let found = normal::one_sided(upper);
        Ok((found.log_probability, -found.mean, found.variance))
    } else {
        let found = normal::truncated_moments(lower, upper)?;
        Ok((found.log_probability, found.mean, found.variance))
    }
}
