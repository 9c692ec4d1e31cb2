//! Parameters, and what is known of them.

use super::model::LevelModel;
use serde::{Deserialize, Serialize};

/// Deviations of a normal number within which it is in 95 of a hundred cases.
pub(super) const DEVIATIONS: f64 = 1.96;

/// A parameter. Sensors are given by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Quantity {
    /// [`super::LevelModel::change`].
    Change,
    /// [`super::LevelModel::time_constant`].
    TimeConstant,
    /// [`super::LevelModel::mean`].
    Mean,
    /// [`super::SensorModel::noise`].
    Noise(usize),
    /// [`super::SensorModel::bias`]; of a sensor of bits minus its threshold.
    Bias(usize),
    /// [`super::SensorModel::gain`].
    Gain(usize),
    /// [`super::SensorModel::slope`].
    Slope(usize),
    /// [`super::SensorModel::walk`].
    Walk(usize),
    /// [`super::SensorModel::delay`].
    Delay(usize),
}

impl Quantity {
    pub(super) fn is_positive(self) -> bool {
        matches!(self, Self::Change | Self::TimeConstant | Self::Noise(_) | Self::Walk(_))
    }

    /// Its value; `None` of the time constant of a level that wanders.
    pub(super) fn of(self, model: &LevelModel) -> Option<f64> {
        let own = |sensor: usize| &model.sensors[sensor];
        Some(match self {
            Self::Change => model.change,
            Self::TimeConstant => return model.time_constant,
            Self::Mean => model.mean,
            Self::Noise(sensor) => own(sensor).noise,
            Self::Bias(sensor) => own(sensor).bias,
            Self::Gain(sensor) => own(sensor).gain,
            Self::Slope(sensor) => own(sensor).slope,
            Self::Walk(sensor) => own(sensor).walk,
            Self::Delay(sensor) => own(sensor).delay,
        })
    }

    /// Replaces it.
    pub(super) fn set(self, model: &mut LevelModel, value: f64) {
        match self {
            Self::Change => model.change = value,
            Self::TimeConstant => model.time_constant = Some(value),
            Self::Mean => model.mean = value,
            Self::Noise(sensor) => model.sensors[sensor].noise = value,
            Self::Bias(sensor) => model.sensors[sensor].bias = value,
            Self::Gain(sensor) => model.sensors[sensor].gain = value,
            Self::Slope(sensor) => model.sensors[sensor].slope = value,
            Self::Walk(sensor) => model.sensors[sensor].walk = value,
            Self::Delay(sensor) => model.sensors[sensor].delay = value,
        }
    }
}

/// A parameter that was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Which.
    pub quantity: Quantity,
    /// Its value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Limits of an interval that has it in 95 of a hundred tables, where these are not the value less and plus 1.96 standard errors.
    #[serde(default)]
    pub limits: Option<(f64, f64)>,
}

impl Estimate {
    /// An interval that has the parameter in 95 of a hundred tables: [`limits`](Self::limits), or 1.96 standard errors to either side.
    pub fn interval(&self) -> (f64, f64) {
        let half = DEVIATIONS * self.standard_error;
        self.limits.unwrap_or((self.value - half, self.value + half))
    }
}

/// A parameter that was not found, and why. It has the value of a sensor without that fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Refusal {
    /// Which.
    pub quantity: Quantity,
    /// Why.
    pub reason: String,
}
