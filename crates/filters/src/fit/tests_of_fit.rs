//! Whether a model explains its readings.

use super::model::LevelModel;
use crate::Error;
use crate::calibration::Instant;
use serde::{Deserialize, Serialize};

/// A test fails beyond so many deviations: once in a thousand tests of a right model. The second is of the largest of several.
const FAILED: f64 = 3.3;
const FAILED_OF_SEVERAL: f64 = 3.7;
/// Successive innovations in a sum at first, and sums at least.
const SUMMED: usize = 4;
const MIN_SUMS: usize = 8;
/// Values that are tested, at least.
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
    /// The same of sums of 4, 8, 16 and more successive innovations, whose mean square is that of so many single ones; the farthest of them: positive
    /// if the level keeps a direction for many values, as in a cycle of a day, negative if it returns. 0 if there are other readings than values.
    #[serde(default)]
    pub persistence: f64,
    /// Number of values beyond five deviations.
    pub wild: usize,
}

impl SensorTest {
    /// Whether no test fails at one in a thousand.
    pub fn is_passed(&self) -> bool {
        self.size.abs() < FAILED && self.repetition.abs() < FAILED && self.persistence.abs() < FAILED_OF_SEVERAL
    }

    /// Whether the level keeps a direction for longer than the model has it.
    pub fn is_persistent(&self) -> bool {
        self.persistence >= FAILED_OF_SEVERAL
    }
}

/// By how many deviations the mean square of sums of successive numbers differs from that of independent ones, at its farthest.
fn persistence(scores: &[f64], mean_square: f64) -> f64 {
    let lengths = std::iter::successors(Some(SUMMED), |length| Some(2 * length));
    let lengths = lengths.take_while(|length| scores.len() / length >= MIN_SUMS);
    let off = lengths.map(|length| {
        let sums = scores.chunks_exact(length).map(|part| part.iter().sum::<f64>().powi(2));
        let ratio = sums.sum::<f64>() / (scores.len() / length * length) as f64 / mean_square;
        // The cube root of a mean square is nearly Gaussian (Wilson and Hilferty).
        let variance = 2.0 / (9.0 * (scores.len() / length) as f64);
        (ratio.cbrt() - (1.0 - variance)) / variance.sqrt()
    });
    off.fold(0.0, |farthest: f64, off| if off.abs() > farthest.abs() { off } else { farthest })
}

impl LevelModel {
    /// Whether the model explains the values of each sensor.
    ///
    /// # Errors
    /// As [`log_likelihood`](Self::log_likelihood).
    pub fn tests(&self, instants: &[Instant]) -> Result<Vec<SensorTest>, Error> {
        let residuals = self.log_likelihood(instants)?.1;
        let mut counts = vec![0; residuals.len()];
        let readings = instants.iter().flat_map(|instant| &instant.values);
        readings.for_each(|(sensor, _)| counts[*sensor] += 1);
        Ok(of(&residuals, &counts))
    }
}

/// `counts`: the readings of each sensor, those that are no values included.
pub(super) fn of(residuals: &[Vec<f64>], counts: &[usize]) -> Vec<SensorTest> {
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
            // Values beside limits are those that the limits left, on one side of the forecast.
            persistence: match counts[sensor] == all.len() {
                true => persistence(&kept, mean_square.max(f64::MIN_POSITIVE)),
                false => 0.0,
            },
            wild: all.len() - kept.len(),
        })
    };
    residuals.iter().enumerate().filter_map(one).collect()
}
