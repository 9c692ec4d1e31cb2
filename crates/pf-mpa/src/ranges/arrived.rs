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
        level: usize,
        levels: usize,
        reference: RangeReference,
    },
}

impl Arrived {
    /// Density or probability of what arrived if the range does not depend on the distance.
    pub(super) fn stray(&self, width: f64) -> f64 {
        match self {
            Self::Value(_) | Self::First(_) => 1.0 / width,
            Self::Level {
                level,
                levels,
                reference,
            } => {
                let inner = (2.0 * reference.half_width / width).min(1.0) / *levels as f64;
                if *level == 0 || level + 1 == *levels {
                    0.5 * (1.0 - (*levels - 2) as f64 * inner)
                } else {
                    inner
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
                level,
                levels,
                reference,
            } => {
                let cell = reference.nominal_cell(*level, *levels)?;
                let edge = |edge: f64| (edge - predicted.mean) / deviation;
                let lower = if *level == 0 {
                    f64::NEG_INFINITY
                } else {
                    edge(cell.lower())
                };
                let upper = if level + 1 == *levels {
                    f64::INFINITY
                } else {
                    edge(cell.upper())
                };
                let moments = normal::truncated_moments(lower, upper)?;
                let bits = (levels.ilog2() as usize).clamp(1, DISTORTION.len());
                let score = moments.mean / (1.0 - DISTORTION[bits - 1]).sqrt();
                (moments.log_probability.exp(), moments.mean, moments.variance, score)
            }
        };
        let after = predicted.mean + gain * deviation * mean;
        Ok((density, after, predicted.variance * (1.0 - gain) + predicted.variance * gain * left, score))
    }
}
