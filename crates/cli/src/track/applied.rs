//! What `fit` found, as a file, and as settings of `track` and `design`.

use super::instant::Reports;
use crate::arguments::{Model, TrackOptions};
use crate::error::Error;
use crate::numbers::short;
use crate::say::say;
use fewbits_filters::fit::{FaultKind, SensorModel};
use fewbits_table::names::quoted;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What was found. Other fields of the file are for people.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Found {
    /// The sensor to which offsets are relative.
    pub(super) relative_to: String,
    /// Standard deviation of the level's change per root of a second.
    pub(crate) change: f64,
    pub(crate) time_constant: Option<f64>,
    pub(crate) mean: f64,
    pub(crate) sensors: Vec<Sensor>,
    /// Name, value and standard error of each parameter that was found; name and reason of each that was not.
    pub(super) estimates: Vec<(String, f64, f64)>,
    pub(super) refused: Vec<(String, String)>,
    /// Seconds after the first row at which the level jumps.
    #[serde(default)]
    pub(super) jumps: Vec<f64>,
    /// Names, value and standard error of each correlation of noises.
    #[serde(default)]
    pub(crate) correlations: Vec<(String, String, f64, f64)>,
    /// Faults that are no parameters: sensor, kind, size and evidence in nats.
    #[serde(default)]
    pub(super) faults: Vec<(String, FaultKind, f64, f64)>,
    /// Sensors whose readings the model does not explain.
    #[serde(default)]
    pub(super) not_explained: Vec<String>,
    pub(super) log_likelihood: f64,
}

/// A sensor of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sensor {
    pub(crate) name: String,
    /// Of bits.
    pub(crate) threshold: Option<f64>,
    #[serde(flatten)]
    pub(crate) model: SensorModel,
}

impl Found {
    /// # Errors
    /// If the file is none of `fit`, or a noise or gain is 0.
    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(Error::io(&name, "read"))?;
        let found: Self = serde_json::from_str(&text)
            .map_err(|error| Error::content(&name, format_args!("it is no file of `fewbits fit -o`: {error}")))?;
        for sensor in &found.sensors {
            let noise = sensor.noise();
            let is_usable = noise > 0.0 && noise.is_finite();
            if !is_usable {
                return Err(Error::content(
                    &name,
                    format_args!("sensor {}: noise and gain must not be 0", sensor.name),
                ));
            }
        }
        Ok(found)
    }

    /// Variance in the long run of a level that returns in so many seconds.
    pub(crate) fn settled(&self, seconds: f64) -> f64 {
        0.5 * self.change * self.change * seconds
    }

    /// Mean and standard deviation of the level in the long run. `None` of a level that wanders.
    pub(crate) fn prior(&self) -> Option<(f64, f64)> {
        let variance = self.settled(self.time_constant?);
        Some((self.mean, variance.sqrt()))
    }

    /// The same as the option `--prior`.
    pub(crate) fn prior_option(&self) -> Option<String> {
        let (mean, deviation) = self.prior()?;
        Some(format!("{mean}±{deviation}"))
    }

    /// Says which faults of its sensors are not corrected. `drifts`: linear ones are neither.
    pub(crate) fn say_uncorrected(&self, file: &Path, drifts: bool) {
        self.sensors
            .iter()
            .for_each(|sensor| sensor.say_uncorrected(file, drifts));
    }
}

impl Sensor {
    /// Standard deviation of its noise in the unit of the level.
    pub(crate) fn noise(&self) -> f64 {
        self.model.noise / self.model.gain.abs()
    }

    fn say_uncorrected(&self, file: &Path, drifts: bool) {
        let (name, file, model) = (&self.name, file.display(), &self.model);
        if model.delay != 0.0 {
            say!("{file}: {name} is {} s late, which is not corrected here", short(model.delay));
        }
        if drifts && model.slope != 0.0 {
            say!("{file}: the offset of {name} drifts by {} per second, which is not followed here", model.slope);
        }
        if model.walk > 0.0 {
            say!(
                "{file}: the offset of {name} wanders, which is not followed here: `track --align` finds the present one"
            );
        }
    }
}

/// What is subtracted from a sensor's values, and by what they are divided.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Correction {
    pub(super) name: String,
    bias: f64,
    slope: f64,
    gain: f64,
}

impl Correction {
    /// The value of a sensor without faults.
    fn of(&self, value: f64, seconds: f64) -> f64 {
        (value - self.bias - self.slope * seconds) / self.gain
    }
}

/// Corrects the values of the sensors that have a correction.
pub(super) fn correct(corrections: &[Correction], reports: &mut Reports, names: &[String], seconds: f64) {
    for (sensor, cell) in reports {
        let correction = corrections.iter().find(|one| Some(&one.name) == names.get(*sensor));
        if let (Some(correction), Some(value)) = (correction, cell) {
            *value = correction.of(*value, seconds);
        }
    }
}

/// The options with what the file of `--settings` says where they say nothing, and corrections of values. `names`: the sensors of the table, if
/// they are known before its rows; the file may have others.
pub(super) fn applied(options: &TrackOptions, names: &[String]) -> Result<(TrackOptions, Vec<Correction>), Error> {
    let mut options = options.clone();
    let Some(path) = &options.settings else {
        return Ok((options, Vec::new()));
    };
    let found = Found::read(path)?;
    let mut corrections = Vec::new();
    let (mut noises, mut thresholds) = (Vec::new(), Vec::new());
    let is_there = |sensor: &&Sensor| names.is_empty() || names.contains(&sensor.name);
    for sensor in found.sensors.iter().filter(is_there) {
        let model = &sensor.model;
        noises.push(format!("{}={}", quoted(&sensor.name), sensor.noise()));
        match sensor.threshold {
            Some(threshold) => thresholds.push(format!("{}={threshold}", quoted(&sensor.name))),
            None => corrections.push(Correction {
                name: sensor.name.clone(),
                bias: model.bias,
                slope: model.slope,
                gain: model.gain,
            }),
        }
        sensor.say_uncorrected(path, false);
    }
    if options.noise.is_empty() {
        options.noise = noises.join(",");
    }
    if options.threshold.is_empty() {
        options.threshold = thresholds.join(",");
    }
    let is_walk = options.model.is_none_or(|model| model == Model::Walk);
    match found.time_constant {
        Some(seconds) if is_walk && options.change.is_none() => {
            let variance = found.settled(seconds);
            // After a second a level that returns at once has forgotten all, and its time constant could not be told.
            let (within, text) = match (0.5e9 * seconds).round().max(1.0) {
                nanoseconds if seconds < 1.0 => (1e-9 * nanoseconds, format!("{nanoseconds}ns")),
                _ => (1.0, "1s".to_owned()),
            };
            // The deviation from the forecast after that time.
            let after = (-variance * (-2.0 * within / seconds).exp_m1()).sqrt();
            options.model = Some(Model::Returning);
            options.change = Some(format!("{after}/{text}"));
            options.prior = options.prior.or(found.prior_option());
        }
        None if is_walk && options.change.is_none() => {
            options.change = Some(format!("{}/1s", found.change));
        }
        // Of a model with a slope the change is another number.
        _ => {}
    }
    Ok((options, corrections))
}
