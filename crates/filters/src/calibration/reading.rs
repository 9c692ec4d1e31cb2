//! What sensors say of their measurements.

use super::wrapped;
use crate::Error;
use fewbits_numerics::error::{finite, positive, refuse};
use fewbits_numerics::normal::{log_interval, truncated_moments};

/// What a sensor says of its measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// It is this value.
    Value {
        /// The value.
        value: f64,
        /// Standard deviation of its noise, if the reading states it. Otherwise it is the sensor's.
        deviation: Option<f64>,
    },
    /// It lies between two ends, of which one may be infinite: a rounded value, one beyond a limit, one that has not changed by much.
    Within {
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
}

impl From<f64> for Reading {
    fn from(value: f64) -> Self {
        Self::Value { value, deviation: None }
    }
}

impl Reading {
    /// A bit: whether the measurement is above zero.
    pub fn bit(above: bool) -> Self {
        let (lower, upper) = if above {
            (0.0, f64::INFINITY)
        } else {
            (f64::NEG_INFINITY, 0.0)
        };
        Self::Within { lower, upper }
    }

    /// The value, if it is one.
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Value { value, .. } => Some(*value),
            Self::Within { .. } => None,
        }
    }

    /// The value, or the middle of a cell of which both ends are finite.
    pub(crate) fn middle(&self) -> Option<f64> {
        match self {
            Self::Value { value, .. } => Some(*value),
            Self::Within { lower, upper } => Some(0.5 * (lower + upper)).filter(|middle| middle.is_finite()),
        }
    }

    /// The finite numbers that it states.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        let both = match *self {
            Self::Value { value, .. } => [value, f64::INFINITY],
            Self::Within { lower, upper } => [lower, upper],
        };
        both.into_iter().filter(|number| number.is_finite())
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        match *self {
            Self::Value { value, deviation } => {
                finite("values", value)?;
                deviation.map_or(Ok(()), |deviation| positive("deviation", deviation).map(|_| ()))?;
            }
            Self::Within { lower, upper } => {
                let is_ordered = lower < upper && (lower.is_finite() || upper.is_finite());
                if !is_ordered {
                    return refuse("reading", format!("from {lower} to {upper}"), "ends in order, one of them finite");
                }
            }
        }
        Ok(())
    }

    /// What it says of a measurement, under a prediction of this mean and variance without noise: the density or probability, mean and
    /// variance of the measurement afterwards in the prediction's deviations, noise included, and that variance.
    pub(crate) fn said(&self, mean: f64, variance: f64, noise: f64, period: Option<f64>) -> Option<ReadingMoments> {
        match *self {
            Self::Value { value, deviation } => {
                let noise = deviation.unwrap_or(noise);
                let variance = variance + noise * noise;
                let score = wrapped(value - mean, period) / variance.sqrt();
                let density = (-0.5 * score * score).exp() / (std::f64::consts::TAU * variance).sqrt();
                Some(ReadingMoments {
                    density,
                    score,
                    left: 0.0,
                    variance,
                })
            }
            Self::Within { lower, upper } => {
                let variance = variance + noise * noise;
                let deviation = variance.sqrt();
                // An arc of a circle keeps its width.
                let shift = match (lower.is_finite() && upper.is_finite(), period) {
                    (true, Some(_)) => {
                        let middle = 0.5 * (lower + upper);
                        wrapped(middle - mean, period) - middle
                    }
                    _ => -mean,
                };
                let found = truncated_moments((lower + shift) / deviation, (upper + shift) / deviation).ok()?;
                Some(ReadingMoments {
                    density: found.log_probability.exp(),
                    score: found.mean,
                    left: found.variance,
                    variance,
                })
            }
        }
    }

    /// The standard deviation of a value's noise, or the distance of two ends.
    pub(super) fn width(&self, noise: f64) -> f64 {
        match *self {
            Self::Value { deviation, .. } => deviation.unwrap_or(noise),
            Self::Within { lower, upper } => upper - lower,
        }
    }

    /// Logarithm of its density or probability, if the measurement without noise is `level`.
    pub(crate) fn log_given(&self, level: f64, noise: f64, period: Option<f64>) -> f64 {
        match *self {
            Self::Value { value, deviation } => {
                let noise = deviation.unwrap_or(noise);
                let score = wrapped(value - level, period) / noise;
                -0.5 * score * score - (std::f64::consts::TAU.sqrt() * noise).ln()
            }
            Self::Within { lower, upper } => {
                let shift = match (lower.is_finite() && upper.is_finite(), period) {
                    (true, Some(_)) => wrapped(0.5 * (lower + upper) - level, period) - 0.5 * (lower + upper),
                    _ => -level,
                };
                log_interval((lower + shift) / noise, (upper + shift) / noise)
            }
        }
    }

    /// Density or probability if it is wild with this probability, and then anywhere in a range.
    pub(crate) fn wild(&self, share: f64, range: f64) -> f64 {
        match *self {
            Self::Value { .. } => share / range,
            Self::Within { lower, upper } => share * ((upper - lower) / range).min(1.0),
        }
    }
}

/// Moments of a measurement given a reading of it.
pub(crate) struct ReadingMoments {
    /// Its density or probability.
    pub(crate) density: f64,
    /// Mean of the innovation afterwards, and its variance, in the prediction's deviations.
    pub(crate) score: f64,
    pub(crate) left: f64,
    /// Variance of the prediction, noise included.
    pub(crate) variance: f64,
}

/// Moments given a reading that is right, or wild, and then says nothing.
pub(crate) struct Doubtful {
    /// Density of the reading.
    pub(crate) density: f64,
    /// Probability that it is right.
    pub(crate) right: f64,
    /// Mean of the innovation afterwards, and what its variance loses, in the prediction's deviations.
    pub(crate) score: f64,
    pub(crate) spread: f64,
}

impl ReadingMoments {
    /// With this probability of a wild reading, and the density that such ones have together with it.
    pub(crate) fn doubted(&self, share: f64, wild: f64) -> Doubtful {
        let density = (1.0 - share) * self.density + wild;
        let right = (1.0 - share) * self.density / density;
        Doubtful {
            density,
            right,
            score: right * self.score,
            spread: right * ((1.0 - self.left) - (1.0 - right) * self.score * self.score),
        }
    }
}
