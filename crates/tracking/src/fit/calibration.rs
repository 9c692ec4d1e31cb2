//! What a calibration found, and what it says to a tracker.

use crate::level::options::{LevelOptions, Model};
use crate::rows::correction::Correction;
use crate::text::short;
use fewbits_filters::fit::{FaultKind, SensorModel};
use serde::{Deserialize, Serialize};

/// What a calibration found. Its stored form, as JSON, is what `fewbits fit -o` writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The sensor to which offsets are relative.
    pub relative_to: String,
    /// Standard deviation of the level's change per root of a second.
    pub change: f64,
    /// Seconds in which the level returns to its mean, if it does.
    pub time_constant: Option<f64>,
    /// Mean of the level.
    pub mean: f64,
    /// The sensors.
    pub sensors: Vec<CalibratedSensor>,
    /// Name, value and standard error of each parameter that was found.
    pub estimates: Vec<(String, f64, f64)>,
    /// Name and limits of each parameter whose interval reaches farther to one side: it is within in 95 of a hundred tables. The others are within
    /// 1.96 standard errors.
    #[serde(default)]
    pub limits: Vec<(String, f64, f64)>,
    /// Name of each parameter that was not found, and the reason.
    pub refused: Vec<(String, String)>,
    /// Seconds after the first row at which the level jumps.
    #[serde(default)]
    pub jumps: Vec<f64>,
    /// Names, value and standard error of each correlation of noises.
    #[serde(default)]
    pub correlations: Vec<(String, String, f64, f64)>,
    /// Faults that are no parameters: sensor, kind, size and evidence in nats.
    #[serde(default)]
    pub faults: Vec<(String, FaultKind, f64, f64)>,
    /// Sensors whose readings the model does not explain.
    #[serde(default)]
    pub not_explained: Vec<String>,
    /// Logarithm of the likelihood of all readings.
    pub log_likelihood: f64,
}

/// A sensor that was calibrated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibratedSensor {
    /// Its name.
    pub name: String,
    /// Threshold of bits.
    pub threshold: Option<f64>,
    /// Its noise and faults.
    #[serde(flatten)]
    pub model: SensorModel,
}

impl Calibration {
    /// A sensor that cannot be used, because its noise or gain is 0.
    pub fn unusable(&self) -> Option<&CalibratedSensor> {
        self.sensors.iter().find(|sensor| {
            let noise = sensor.noise();
            !(noise > 0.0 && noise.is_finite())
        })
    }

    /// Variance in the long run of a level that returns in so many seconds.
    pub fn settled(&self, seconds: f64) -> f64 {
        0.5 * self.change * self.change * seconds
    }

    /// Mean and standard deviation of the level in the long run. `None` of a level that wanders.
    pub fn prior(&self) -> Option<(f64, f64)> {
        let variance = self.settled(self.time_constant?);
        Some((self.mean, variance.sqrt()))
    }

    /// Which faults of its sensors are not corrected, a sentence each. `drifts`: linear ones are neither. `names`: those of the sensors that matter;
    /// all without any.
    pub fn uncorrected(&self, names: &[String], drifts: bool) -> Vec<String> {
        let own = self.sensors.iter().filter(|sensor| sensor.is_among(names));
        own.flat_map(|sensor| sensor.uncorrected(drifts)).collect()
    }

    /// Takes noises, thresholds, change and prior into options that do not state them. Returns the corrections of values. `names`: the sensors of the
    /// table; none if they are not known before its rows.
    pub fn apply(&self, options: &mut LevelOptions, names: &[String]) -> Vec<Correction> {
        let (mut noises, mut thresholds, mut corrections) = (Vec::new(), Vec::new(), Vec::new());
        for sensor in self.sensors.iter().filter(|sensor| sensor.is_among(names)) {
            let (name, model) = (sensor.name.clone(), &sensor.model);
            noises.push((name.clone(), Some(sensor.noise())));
            match sensor.threshold {
                Some(threshold) => thresholds.push((name, Some(threshold))),
                None => corrections.push(Correction {
                    name,
                    bias: model.bias,
                    slope: model.slope,
                    gain: model.gain,
                }),
            }
        }
        if !options.noise.is_stated() {
            options.noise.named = noises;
        }
        if !options.threshold.is_stated() {
            options.threshold.named = thresholds;
        }
        let is_walk = options.model.is_none_or(|model| model == Model::Walk);
        match self.time_constant {
            Some(seconds) if is_walk && options.change.is_none() => {
                let variance = self.settled(seconds);
                // After a second a level that returns at once has forgotten all, and its time constant could not be told.
                let within = f64::min(0.5 * seconds, 1.0);
                // The deviation from the forecast after that time.
                let after = (-variance * (-2.0 * within / seconds).exp_m1()).sqrt();
                options.model = Some(Model::Returning);
                options.change = Some((after, within));
                options.prior = options.prior.or(self.prior());
            }
            None if is_walk && options.change.is_none() => options.change = Some((self.change, 1.0)),
            // Of a model with a slope the change is another number.
            _ => {}
        }
        corrections
    }
}

impl CalibratedSensor {
    /// Standard deviation of its noise in the unit of the level.
    pub fn noise(&self) -> f64 {
        self.model.noise / self.model.gain.abs()
    }

    /// Whether it has one of these names; any has if there are none.
    fn is_among(&self, names: &[String]) -> bool {
        names.is_empty() || names.contains(&self.name)
    }

    fn uncorrected(&self, drifts: bool) -> Vec<String> {
        let (name, model) = (&self.name, &self.model);
        let mut lines = Vec::new();
        if model.delay != 0.0 {
            lines.push(format!("{name} is {} s late, which is not corrected here", short(model.delay)));
        }
        if drifts && model.slope != 0.0 {
            lines
                .push(format!("the offset of {name} drifts by {} per second, which is not followed here", model.slope));
        }
        if model.walk > 0.0 {
            lines.push(format!(
                "the offset of {name} wanders, which is not followed here: `track --align` finds the present one"
            ));
        }
        lines
    }
}
