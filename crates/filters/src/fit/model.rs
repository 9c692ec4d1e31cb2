//! The level, its sensors, and the likelihood of what they said.

use crate::Error;
use crate::calibration::Instant;
use fewbits_numerics::error::{finite, non_negative, positive, refuse};
use serde::{Deserialize, Serialize};

/// Deviation of an unknown first level in spreads of the values.
const FIRST: f64 = 10.0;

/// A sensor: `gain * level(t - delay) + bias + slope * t + walk(t) + noise`. Of a bit that is 1 above a threshold, the bias is minus the
/// threshold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorModel {
    /// Standard deviation of the noise of a reading.
    pub noise: f64,
    /// Constant offset.
    pub bias: f64,
    /// Factor of the level.
    pub gain: f64,
    /// Growth of the offset per second, from the first instant on.
    pub slope: f64,
    /// Standard deviation of the offset's random walk after a second.
    pub walk: f64,
    /// Seconds by which the sensor is late.
    pub delay: f64,
}

impl SensorModel {
    /// A sensor of this noise that has none of the other faults.
    pub fn exact(noise: f64) -> Self {
        Self {
            noise,
            bias: 0.0,
            gain: 1.0,
            slope: 0.0,
            walk: 0.0,
            delay: 0.0,
        }
    }

    fn check(&self) -> Result<(), Error> {
        positive("noise", self.noise)?;
        finite("bias", self.bias)?;
        finite("gain", self.gain)?;
        finite("slope", self.slope)?;
        finite("delay", self.delay)?;
        non_negative("walk", self.walk)?;
        Ok(())
    }
}

/// A level that wanders, or returns to its mean, and its sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LevelModel {
    /// Standard deviation of the level's change in a short time, per root of a second.
    pub change: f64,
    /// Seconds in which the level returns to its mean (Ornstein-Uhlenbeck); `None` of a random walk.
    pub time_constant: Option<f64>,
    /// The mean of a level that returns to it.
    pub mean: f64,
    /// The sensors, by index.
    pub sensors: Vec<SensorModel>,
}

/// Numbers of the table that do not depend on the model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    /// Width of all values.
    pub range: f64,
    /// A middle and a width for the first level.
    pub middle: f64,
    pub spread: f64,
    /// Time of the first instant.
    pub begin: f64,
}

impl LevelModel {
    /// # Errors
    /// If a number is not finite, or not positive where it must be.
    pub(super) fn check(&self) -> Result<(), Error> {
        positive("change", self.change)?;
        finite("mean", self.mean)?;
        if let Some(seconds) = self.time_constant {
            positive("time_constant", seconds)?;
        }
        self.sensors.iter().try_for_each(SensorModel::check)
    }

    /// Mean and standard deviation of the level at the first instant, before any reading. A level that returns has its stationary
    /// distribution, one that wanders a wide one about the middle of the values.
    ///
    /// # Errors
    /// As [`log_likelihood`](Self::log_likelihood).
    pub fn first_level(&self, instants: &[Instant]) -> Result<(f64, f64), Error> {
        self.check()?;
        let scale = Scale::of(instants, self.sensors.len())?;
        let (mean, variance) = self.first(&scale);
        Ok((mean, variance.sqrt()))
    }

    /// Mean and variance of the level at first.
    pub(super) fn first(&self, scale: &Scale) -> (f64, f64) {
        match self.settled() {
            Some(variance) => (self.mean, variance),
            None => (scale.middle, (FIRST * scale.spread).powi(2)),
        }
    }

    /// Variance in the long run of a level that returns.
    fn settled(&self) -> Option<f64> {
        self.time_constant
            .map(|seconds| 0.5 * (self.change * self.change) * seconds)
    }
}

impl Scale {
    /// Checks the readings.
    pub(super) fn of(instants: &[Instant], sensors: usize) -> Result<Self, Error> {
        let mut numbers = Vec::new();
        let mut before = f64::NEG_INFINITY;
        for instant in instants {
            if finite("seconds", instant.seconds)? < before {
                return refuse("seconds", instant.seconds, format!("{before} or later"));
            }
            before = instant.seconds;
            for (sensor, reading) in &instant.values {
                reading.check()?;
                if *sensor >= sensors {
                    return refuse("sensor", sensor, format!("below {sensors}"));
                }
                numbers.extend(reading.middle());
            }
        }
        numbers.sort_by(f64::total_cmp);
        let (range, middle, spread) = match (numbers.first(), numbers.last()) {
            (Some(low), Some(high)) if high > low => {
                let at = |share: f64| numbers[(share * (numbers.len() - 1) as f64) as usize];
                let spread = 0.5 * (at(0.9) - at(0.1));
                (high - low, at(0.5), if spread > 0.0 { spread } else { high - low })
            }
            // Bits alone.
            _ => (1.0, 0.0, 1.0),
        };
        Ok(Self {
            range,
            middle,
            spread,
            begin: instants.first().map_or(0.0, |instant| instant.seconds),
        })
    }
}
