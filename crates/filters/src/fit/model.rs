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

/// Numbers of the table that hardly depend on the model.
#[derive(Debug, Clone)]
pub(super) struct Scale {
    /// Width of the values of each sensor, all and without the outer ones.
    pub ranges: Vec<f64>,
    pub spreads: Vec<f64>,
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
        let scale = Scale::of(instants, &self.sensors)?;
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
    /// Checks the readings. The level is where the sensors of gain one read it, or where all do.
    pub(super) fn of(instants: &[Instant], sensors: &[SensorModel]) -> Result<Self, Error> {
        let mut numbers = vec![Vec::new(); sensors.len()];
        let mut before = f64::NEG_INFINITY;
        for instant in instants {
            if finite("seconds", instant.seconds)? < before {
                return refuse("seconds", instant.seconds, format!("{before} or later"));
            }
            before = instant.seconds;
            for (sensor, reading) in &instant.values {
                reading.check()?;
                let Some(own) = numbers.get_mut(*sensor) else {
                    return refuse("sensor", sensor, format!("below {}", sensors.len()));
                };
                if let Some(value) = reading.middle().filter(|value| !(value * value).is_finite()) {
                    return refuse("values", value, "numbers whose squares are finite");
                }
                own.extend(reading.middle());
            }
        }
        let levels = |is_of_use: &dyn Fn(f64) -> bool| {
            let of_use = numbers.iter().zip(sensors).filter(|(_, model)| is_of_use(model.gain));
            let levels = of_use.flat_map(|(own, model)| own.iter().map(|one| (one - model.bias) / model.gain));
            Spread::of(levels.filter(|level| level.is_finite()).collect())
        };
        // Otherwise bits alone.
        let level = levels(&|gain| gain == 1.0).or_else(|| levels(&|_| true));
        let level = level.unwrap_or(Spread {
            range: 1.0,
            middle: 0.0,
            spread: 1.0,
        });
        let own: Vec<Spread> = numbers
            .into_iter()
            .map(|own| Spread::of(own).unwrap_or(level))
            .collect();
        Ok(Self {
            middle: level.middle,
            spread: level.spread,
            ranges: own.iter().map(|one| one.range).collect(),
            spreads: own.iter().map(|one| one.spread).collect(),
            begin: instants.first().map_or(0.0, |instant| instant.seconds),
        })
    }
}

/// Where numbers are, and how far apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    pub(super) range: f64,
    pub(super) middle: f64,
    /// Half the width without a tenth at either end.
    pub(super) spread: f64,
}

impl Spread {
    /// `None` if they do not vary.
    pub(super) fn of(mut numbers: Vec<f64>) -> Option<Self> {
        numbers.sort_by(f64::total_cmp);
        let range = numbers.last()? - numbers.first()?;
        let at = |share: f64| numbers[(share * (numbers.len() - 1) as f64) as usize];
        let inner = 0.5 * (at(0.9) - at(0.1));
        (range > 0.0).then(|| Self {
            range,
            middle: at(0.5),
            spread: if inner > 0.0 { inner } else { range },
        })
    }
}
