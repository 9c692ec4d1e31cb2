//! Whether innovations of sensors repeat, as those of a level that wanders do not.

use crate::level::options::Model;
use crate::level::settings::Settings;
use crate::rows::instant::Instant;
use fewbits_filters::calibration;
use fewbits_filters::fit::{LevelModel, SensorModel, SensorTest};

/// Innovations repeat if their correlation is beyond so many deviations: once in a thousand tables of a right model.
pub(crate) const REPEATING: f64 = 3.3;

impl Settings {
    /// Tests of the innovations of each sensor, of a level that wanders.
    pub(crate) fn tests(&self, readings: &[calibration::Instant], names: &[String]) -> Vec<SensorTest> {
        // A constant offset, which is told elsewhere, would last too.
        let biases = calibration::offsets(readings, names.len(), None);
        let sensors = names.iter().zip(biases).enumerate();
        let model = LevelModel {
            change: self.world.change / self.world.within.sqrt(),
            time_constant: None,
            mean: self.world.prior.0,
            sensors: sensors
                .map(|(sensor, (name, bias))| SensorModel {
                    bias,
                    ..SensorModel::exact(self.seat(sensor, name).noise)
                })
                .collect(),
        };
        model.tests(readings).unwrap_or_default()
    }

    /// Sensors whose innovations in the first rows repeat, or return: each wrongly with one in a thousand tables. Only of a level that wanders, read by
    /// values.
    pub(crate) fn repeating(&self, first: &[Instant], names: &[String]) -> Vec<String> {
        let readings = self.readings(first, names);
        let is_value = |(_, reading): &(usize, calibration::Reading)| reading.value().is_some();
        let are_values = readings.iter().all(|instant| instant.values.iter().all(is_value));
        if self.world.model != Model::Walk || self.world.period.is_some() || !are_values || self.lasting.is_some() {
            return Vec::new();
        }
        let tests = self.tests(&readings, names);
        let line = |test: &SensorTest| {
            let name = &names[test.sensor];
            match test.repetition {
                z if z > REPEATING => Some(format!(
                    "{name}: its differences from the forecasts last for several rows ({z:.1} deviations), as a level that moves faster than supposed or a \
                     noise that lasts makes them: bands may be too narrow; `fewbits fit --reference NAME --find walk` tells which"
                )),
                z if z < -REPEATING => Some(format!(
                    "{name}: its differences from the forecasts turn back ({:.1} deviations), as a noise that sensors share makes them, which is taken \
                     for the level: bands may be too narrow; --change says how much the level moves, and `fewbits fit --reference NAME` finds the shared noise",
                    -z
                )),
                _ => None,
            }
        };
        tests.iter().filter_map(line).collect()
    }
}
