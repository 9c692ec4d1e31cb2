//! Whether a model explains its readings.

use super::model::LevelModel;
use crate::calibration::Instant;
use serde::{Deserialize, Serialize};

/// A test fails beyond so many deviations: once in a thousand tests of a right model.
const FAILED: f64 = 3.3;
/// Instants from which a correlation is found, at least.
const MIN_READINGS: usize = 12;

/// The test of a sensor of values, from its standardised innovations: under the right model they are independent, of mean square one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorTest {
    /// The sensor.
    pub sensor: usize,
    /// Number of its values.
    pub values: usize,
    /// Mean square of the innovations, those beyond five deviations left out as wild.
    pub mean_square: f64,
    /// By how many of its deviations that differs from one.
    pub size: f64,
    /// Correlation of successive innovations in its deviations: positive if the level moves faster than supposed.
    pub repetition: f64,
    /// Number of values beyond five deviations.
    pub wild: usize,
}

impl SensorTest {
    /// Whether neither test fails at one in a thousand.
    pub fn is_passed(&self) -> bool {
        self.size.abs() < FAILED && self.repetition.abs() < FAILED
    }
}

/// The correlation between the noises of two sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// The sensors.
    pub sensors: (usize, usize),
    /// The correlation.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

pub(super) fn of(residuals: &[Vec<f64>]) -> Vec<SensorTest> {
    let one = |(sensor, all): (usize, &Vec<f64>)| {
        let kept: Vec<f64> = all.iter().copied().filter(|score| score.abs() <= 5.0).collect();
        let count = kept.len() as f64;
        let mean_square = kept.iter().map(|score| score * score).sum::<f64>() / count;
        let products: f64 = kept.windows(2).map(|pair| pair[0] * pair[1]).sum();
        (kept.len() >= MIN_READINGS).then(|| SensorTest {
            sensor,
            values: all.len(),
            mean_square,
            size: (mean_square - 1.0) * (0.5 * count).sqrt(),
            repetition: products / (mean_square.max(f64::MIN_POSITIVE) * (count - 1.0).sqrt()),
            wild: all.len() - kept.len(),
        })
    };
    residuals.iter().enumerate().filter_map(one).collect()
}

/// Correlations of what the sensors' values are off from a reference.
pub(super) fn correlations(instants: &[Instant], model: &LevelModel, reference: usize) -> Vec<Correlation> {
    let begin = instants.first().map_or(0.0, |instant| instant.seconds);
    let level: Vec<(f64, f64)> = instants
        .iter()
        .flat_map(|instant| instant.values.iter().map(|one| (instant.seconds, one)))
        .filter(|(_, (sensor, _))| *sensor == reference)
        .filter_map(|(seconds, (_, reading))| Some((seconds, reading.value()?)))
        .collect();
    let at = |seconds: f64| {
        let next = level.partition_point(|one| one.0 < seconds);
        let after = level.get(next)?;
        let before = level.get(next.checked_sub(1).unwrap_or(next))?;
        let share = if after.0 > before.0 {
            (seconds - before.0) / (after.0 - before.0)
        } else {
            0.0
        };
        (seconds >= before.0).then_some(before.1 + share * (after.1 - before.1))
    };
    let count = model.sensors.len();
    let off = |instant: &Instant| -> Vec<Option<f64>> {
        let mut found = vec![None; count];
        for (sensor, reading) in &instant.values {
            let own = &model.sensors[*sensor];
            if let (Some(value), Some(level)) = (reading.value(), at(instant.seconds - own.delay)) {
                let expected = own.gain * level + own.bias + own.slope * (instant.seconds - begin);
                let score = (value - expected) / own.noise;
                found[*sensor] = (own.walk == 0.0 && score.abs() <= 5.0).then_some(score);
            }
        }
        found
    };
    let rows: Vec<Vec<Option<f64>>> = instants.iter().map(off).collect();
    let mut found = Vec::new();
    for one in (0..count).filter(|one| *one != reference) {
        for other in (one + 1..count).filter(|other| *other != reference) {
            let pairs: Vec<(f64, f64)> = rows.iter().filter_map(|row| Some((row[one]?, row[other]?))).collect();
            if pairs.len() < MIN_READINGS {
                continue;
            }
            let sum = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>();
            let value =
                sum(&|pair| pair.0 * pair.1) / (sum(&|pair| pair.0 * pair.0) * sum(&|pair| pair.1 * pair.1)).sqrt();
            found.push(Correlation {
                sensors: (one, other),
                value,
                standard_error: (1.0 - value * value) / (pairs.len() as f64).sqrt(),
            });
        }
    }
    found
}
