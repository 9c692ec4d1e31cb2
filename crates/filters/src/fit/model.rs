//! The level, its sensors, and the likelihood of what they said.

use crate::Error;
use crate::calibration::{Instant, Reading};
use fewbits_numerics::error::{finite, non_negative, positive, refuse};
use serde::{Deserialize, Serialize};

/// Assumed share of wild values, which keeps one of them from moving everything.
const WILD: f64 = 1e-3;
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

/// A reading in the order of the times at which the level was as it says.
#[derive(Debug, Clone, Copy)]
struct Told {
    /// Time of the level, and of the reading.
    level: f64,
    seconds: f64,
    sensor: usize,
    reading: Reading,
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
    fn first(&self, scale: &Scale) -> (f64, f64) {
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

    /// `ln p` of all readings, with their standardised innovations by sensor.
    ///
    /// # Errors
    /// If an instant names a sensor that the model does not have, a reading or a number of the model is not finite or out of range.
    pub fn log_likelihood(&self, instants: &[Instant]) -> Result<(f64, Vec<Vec<f64>>), Error> {
        self.check()?;
        let scale = Scale::of(instants, self.sensors.len())?;
        let mut residuals = vec![Vec::new(); self.sensors.len()];
        let total = self.run(instants, &scale, |sensor, score| residuals[sensor].push(score));
        match total.filter(|total| total.is_finite()) {
            Some(total) => Ok((total, residuals)),
            None => Err(Error::NotANumber {
                what: "the likelihood of the readings",
            }),
        }
    }

    /// The same without checks; `None` if numbers run out of range.
    pub(super) fn run(&self, instants: &[Instant], scale: &Scale, mut each: impl FnMut(usize, f64)) -> Option<f64> {
        let mut told: Vec<Told> = Vec::new();
        for instant in instants {
            for (sensor, reading) in &instant.values {
                told.push(Told {
                    level: instant.seconds - self.sensors[*sensor].delay,
                    seconds: instant.seconds,
                    sensor: *sensor,
                    reading: *reading,
                });
            }
        }
        if self.sensors.iter().any(|sensor| sensor.delay != 0.0) {
            told.sort_by(|one, other| one.level.total_cmp(&other.level));
        }
        // Coordinate 0 is the level; then the walks.
        let mut place = vec![None; self.sensors.len()];
        let mut walks = Vec::new();
        for (sensor, model) in self.sensors.iter().enumerate() {
            if model.walk > 0.0 {
                place[sensor] = Some(1 + walks.len());
                walks.push(model.walk * model.walk);
            }
        }
        let n = 1 + walks.len();
        let (mut mean, mut covariance, mut cross) = (vec![0.0; n], vec![0.0; n * n], vec![0.0; n]);
        let rate = self.change * self.change;
        let settled = self.settled();
        (mean[0], covariance[0]) = self.first(scale);
        let (mut total, mut now) = (0.0, told.first()?.level);
        for one in &told {
            let seconds = one.level - now;
            if seconds > 0.0 {
                now = one.level;
                match (self.time_constant, settled) {
                    (Some(constant), Some(variance)) => {
                        let kept = (-seconds / constant).exp();
                        mean[0] = self.mean + kept * (mean[0] - self.mean);
                        for j in 0..n {
                            covariance[j] *= kept;
                            covariance[j * n] *= kept;
                        }
                        covariance[0] -= variance * (-2.0 * seconds / constant).exp_m1();
                    }
                    _ => covariance[0] += rate * seconds,
                }
                for (walk, variance) in walks.iter().enumerate() {
                    covariance[(walk + 1) * n + walk + 1] += variance * seconds;
                }
            }
            let model = &self.sensors[one.sensor];
            let own = place[one.sensor];
            for (j, cross) in cross.iter_mut().enumerate() {
                *cross = model.gain * covariance[j * n] + own.map_or(0.0, |own| covariance[j * n + own]);
            }
            let variance = model.gain * cross[0] + own.map_or(0.0, |own| cross[own]);
            let offset = model.bias + model.slope * (one.seconds - scale.begin);
            let expected = model.gain * mean[0] + own.map_or(0.0, |own| mean[own]) + offset;
            let said = one.reading.said(expected, variance.max(0.0), model.noise, None)?;
            let (right, wild) = ((1.0 - WILD) * said.log.exp(), one.reading.wild(WILD, scale.range));
            total += (right + wild).ln();
            let weight = right / (right + wild);
            if one.reading.value().is_some() {
                each(one.sensor, said.score);
            }
            let deviation = said.variance.sqrt();
            let spread = weight * ((1.0 - said.left) - (1.0 - weight) * said.score * said.score);
            for i in 0..n {
                mean[i] += cross[i] / deviation * weight * said.score;
                for j in 0..n {
                    covariance[i * n + j] -= cross[i] * cross[j] / said.variance * spread;
                }
            }
        }
        (!total.is_nan()).then_some(total)
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
                numbers.extend(reading.value());
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
