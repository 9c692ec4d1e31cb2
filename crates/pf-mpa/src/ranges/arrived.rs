//! What arrives of a range: a number, or the level of its innovation.

use super::gaussian::Predicted;
use crate::Error;
use crate::quantized::RangeReference;
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

    /// Density or probability of what arrived for a range of these moments; mean and variance of the noise-free range afterwards; and the
    /// innovation in its own deviations, with variance one.
    pub(super) fn right(&self, predicted: &Predicted, noise: f64) -> Result<(f64, f64, f64, f64), Error> {
        let total = predicted.variance + noise * noise;
        let deviation = total.sqrt();
        let gain = predicted.variance / total;
        let (density, mean, left, score) = match self {
            Self::Value(value) | Self::First(value) => {
                let score = (value - predicted.mean) / deviation;
                (normal::pdf(score) / deviation, score, 0.0, score)
            }
            Self::Level {
                lower, upper, levels, ..
            } => {
                // An infinite end stays infinite.
                let edge = |edge: f64| (edge - predicted.mean) / deviation;
                let (log_probability, mean, variance) = in_cell(edge(*lower), edge(*upper))?;
                let bits = (levels.ilog2() as usize).clamp(1, DISTORTION.len());
                let score = mean / (1.0 - DISTORTION[bits - 1]).sqrt();
                (log_probability.exp(), mean, variance, score)
            }
        };
        let after = predicted.mean + gain * deviation * mean;
        Ok((density, after, predicted.variance * (1.0 - gain) + predicted.variance * gain * left, score))
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
