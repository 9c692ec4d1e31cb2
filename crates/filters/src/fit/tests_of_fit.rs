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

impl Correlation {
    /// Whether it differs from zero, as by chance once in a thousand times.
    pub fn is_certain(&self) -> bool {
        self.value.abs() > FAILED * self.standard_error
    }
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

/// What a sensor is off from the level that the reference reads about the time that it is late: from the line between two of its values.
#[derive(Debug, Clone, Copy)]
struct Off {
    value: f64,
    /// The first of the two values, the share of the way to the second, and the seconds between them.
    place: usize,
    share: f64,
    seconds: f64,
}

impl Off {
    /// Share of the reference's variance that two have in common, and variance of the level's way from the line per squared change.
    fn common(&self, other: &Self) -> (f64, f64) {
        let weights = |off: &Self| [(off.place, 1.0 - off.share), (off.place + 1, off.share)];
        let mut noise = 0.0;
        for (place, weight) in weights(self) {
            for (same, further) in weights(other) {
                noise += if place == same { weight * further } else { 0.0 };
            }
        }
        let (one, two) = (self.share.min(other.share), self.share.max(other.share));
        let way = if self.place == other.place {
            self.seconds * one * (1.0 - two)
        } else {
            0.0
        };
        (noise, way)
    }
}

/// Correlations of the noises of two sensors beside a third: of what both are off from its values, less what its own noise, and the level
/// between its values, bring into both.
pub(super) fn correlations(instants: &[Instant], model: &LevelModel, reference: usize) -> Vec<Correlation> {
    let begin = instants.first().map_or(0.0, |instant| instant.seconds);
    let level: Vec<(f64, f64)> = instants
        .iter()
        .flat_map(|instant| instant.values.iter().map(|one| (instant.seconds, one)))
        .filter(|(_, (sensor, _))| *sensor == reference)
        .filter_map(|(seconds, (_, reading))| Some((seconds, reading.value()?)))
        .collect();
    let at = |seconds: f64| {
        let next = level.partition_point(|one| one.0 <= seconds);
        let place = next.checked_sub(1)?;
        let before = level[place];
        let Some(after) = level.get(next) else {
            return (before.0 == seconds).then_some((before.1, place, 0.0, 0.0));
        };
        let share = (seconds - before.0) / (after.0 - before.0);
        Some((before.1 + share * (after.1 - before.1), place, share, after.0 - before.0))
    };
    let count = model.sensors.len();
    let own_variance = model.sensors[reference].noise.powi(2);
    let rate = model.change * model.change;
    let off = |instant: &Instant| -> Vec<Option<Off>> {
        let mut found = vec![None; count];
        for (sensor, reading) in instant.values.iter().filter(|(sensor, _)| *sensor != reference) {
            let own = &model.sensors[*sensor];
            let about = reading.value().zip(at(instant.seconds - own.delay));
            let Some((value, (level, place, share, seconds))) = about.filter(|_| own.walk == 0.0) else {
                continue;
            };
            let off = Off {
                value: value - own.gain * level - own.bias - own.slope * (instant.seconds - begin),
                place,
                share,
                seconds,
            };
            let (noise, way) = off.common(&off);
            let variance = own.noise.powi(2) + own.gain.powi(2) * (noise * own_variance + way * rate);
            found[*sensor] = (off.value.powi(2) <= 25.0 * variance).then_some(off);
        }
        found
    };
    let rows: Vec<Vec<Option<Off>>> = instants.iter().map(off).collect();
    let mut found = Vec::new();
    for one in (0..count).filter(|one| *one != reference) {
        for other in (one + 1..count).filter(|other| *other != reference) {
            let (first, second) = (&model.sensors[one], &model.sensors[other]);
            let product = |row: &Vec<Option<Off>>| {
                let (own, its) = (row[one]?, row[other]?);
                let (noise, way) = own.common(&its);
                let shared = first.gain * second.gain * (noise * own_variance + way * rate);
                Some((own.value * its.value - shared) / (first.noise * second.noise))
            };
            let products: Vec<f64> = rows.iter().filter_map(product).collect();
            if products.len() < MIN_READINGS {
                continue;
            }
            let number = products.len() as f64;
            let value = products.iter().sum::<f64>() / number;
            let squares = products.iter().map(|one| (one - value) * (one - value)).sum::<f64>();
            found.push(Correlation {
                sensors: (one, other),
                value,
                standard_error: squares.sqrt() / number,
            });
        }
    }
    found
}
