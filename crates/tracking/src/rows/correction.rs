//! Corrections of a sensor's values, as a calibration finds them.

use super::instant::Reports;

/// What is subtracted from a sensor's values, and by what they are divided: `(value - bias - slope seconds) / gain`.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// The sensor.
    pub name: String,
    /// In the unit of its values.
    pub bias: f64,
    /// The same per second since the first row.
    pub slope: f64,
    /// Change of its values with the level.
    pub gain: f64,
}

impl Correction {
    /// The value of a sensor without faults.
    fn of(&self, value: f64, seconds: f64) -> f64 {
        (value - self.bias - self.slope * seconds) / self.gain
    }
}

/// Corrects the values of the sensors that have a correction.
pub(crate) fn correct(corrections: &[Correction], reports: &mut Reports, names: &[String], seconds: f64) {
    for (sensor, cell) in reports {
        let correction = corrections.iter().find(|one| Some(&one.name) == names.get(*sensor));
        if let (Some(correction), Some(value)) = (correction, cell) {
            *value = correction.of(*value, seconds);
        }
    }
}
