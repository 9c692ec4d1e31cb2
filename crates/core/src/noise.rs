//! Noise whose deviation may grow with the measurement.

use crate::error::Error;
use fewbits_numerics::error::{ArgumentError, finite, non_negative, positive, refuse};
use serde::{Deserialize, Serialize};

/// Gaussian noise of a scalar measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Noise {
    /// The same variance at every measurement.
    Variance(f64),
    /// A deviation that grows with the measurement.
    Range(RangeNoise),
}

impl Noise {
    /// The noise, as [`Noise::Variance`] wherever it does not depend on the measurement.
    ///
    /// # Errors
    /// If the variance is not positive.
    pub(crate) fn checked(self) -> Result<Self, ArgumentError> {
        let variance = match self {
            Self::Range(noise) if noise.relative > 0.0 => return Ok(self),
            Self::Range(noise) => noise.constant * noise.constant,
            Self::Variance(variance) => variance,
        };
        positive("noise_variance", variance).map(Self::Variance)
    }

    /// Variance at the noise-free measurement `m`.
    pub fn variance(&self, m: f64) -> f64 {
        match self {
            Self::Variance(variance) => *variance,
            Self::Range(noise) => noise.deviation(m) * noise.deviation(m),
        }
    }
}

impl From<f64> for Noise {
    fn from(variance: f64) -> Self {
        Self::Variance(variance)
    }
}

impl From<RangeNoise> for Noise {
    fn from(noise: RangeNoise) -> Self {
        Self::Range(noise)
    }
}

/// Noise of a range: variance `s0^2 + (d / c)^2` at distance `d`. The papers use `s0 = 0`: a constant signal-to-noise ratio.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct RangeNoise {
    constant: f64,
    relative: f64,
}

/// The stored form of [`RangeNoise`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    constant: f64,
    relative: f64,
}

impl TryFrom<Stored> for RangeNoise {
    type Error = Error;

    fn try_from(parts: Stored) -> Result<Self, Error> {
        RangeNoise::new(parts.constant, parts.relative)
    }
}

impl RangeNoise {
    /// Standard deviation `constant` (length) at distance 0. The other part grows as `relative` = `1 / c` times the distance.
    ///
    /// # Errors
    /// If one is negative or not finite, or both are zero.
    pub fn new(constant: f64, relative: f64) -> Result<Self, Error> {
        non_negative("constant", constant)?;
        non_negative("relative", relative)?;
        if constant == 0.0 && relative == 0.0 {
            return refuse("noise", "zero at every distance", "a standard deviation above 0");
        }
        Ok(Self { constant, relative })
    }

    /// A constant ratio `d^2 / sigma^2` of the powers of range and noise, in decibels: `sigma = d / 10^(SNR / 20)`.
    ///
    /// # Errors
    /// If the ratio is not finite, or the resulting deviation is not.
    pub fn from_snr_db(snr_db: f64) -> Result<Self, Error> {
        Self::new(0.0, 10.0_f64.powf(-finite("snr_db", snr_db)? / 20.0))
    }

    /// The same standard deviation at every distance.
    ///
    /// # Errors
    /// If `deviation` is not positive.
    pub fn constant(deviation: f64) -> Result<Self, Error> {
        Self::new(deviation, 0.0)
    }

    /// Standard deviation at distance `d`. It is positive also for `d <= 0`.
    #[inline(always)]
    pub fn deviation(&self, distance: f64) -> f64 {
        let relative = (self.relative * distance).abs();
        let deviation = if self.constant == 0.0 {
            relative
        } else if self.relative == 0.0 {
            self.constant
        } else {
            (self.constant * self.constant + relative * relative).sqrt()
        };
        if deviation > f64::MIN_POSITIVE {
            deviation.min(f64::MAX)
        } else {
            f64::MIN_POSITIVE
        }
    }

    /// Derivative of the standard deviation with respect to the distance.
    pub fn slope(&self, distance: f64) -> f64 {
        self.relative * (self.relative * distance / self.deviation(distance))
    }

    /// Standard deviation at distance 0, the constant part.
    pub fn at_sensor(&self) -> f64 {
        self.constant
    }

    /// Growth `1 / c` of the standard deviation with the distance.
    pub fn relative(&self) -> f64 {
        self.relative
    }
}
