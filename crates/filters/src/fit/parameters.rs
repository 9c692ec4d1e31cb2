//! Parameters, and what is known of them.

use serde::{Deserialize, Serialize};

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
}

/// A parameter that was not found, and why. It has the value of a sensor without that fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Refusal {
    /// Which.
    pub quantity: Quantity,
    /// Why.
    pub reason: String,
}
