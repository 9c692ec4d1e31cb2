//! Correlations between the noises of sensors.

use super::model::LevelModel;
use crate::calibration::Instant;
use fewbits_numerics::normal::quantile;
use serde::{Deserialize, Serialize};

/// Instants from which a correlation is found, at least.
const MIN_READINGS: usize = 12;
/// Probability with which one of all correlations of a table is certain though none is there.
const BY_CHANCE: f64 = 1e-3;

/// The correlation between the noises of two sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// The sensors.
    pub sensors: (usize, usize),
    /// The correlation.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Number of pairs of sensors that are compared.
    #[serde(default)]
    pub pairs: usize,
}

impl Correlation {
    /// Whether it differs from zero, as by chance one of all pairs does once in a thousand tables.
    pub fn is_certain(&self) -> bool {
        let limit = -quantile(0.5 * BY_CHANCE / self.pairs.max(1) as f64);
        self.value.abs() > limit * self.standard_error
    }
}

/// What a sensor is off from the level that the reference reads about the time that it is late: from the line between two of its values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Off {
    pub(super) value: f64,
    /// The first of the two values, the share of the way to the second, and the seconds between them.
    pub(super) place: usize,
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

/// The values of a sensor, by time.
pub(super) fn values(instants: &[Instant], sensor: usize) -> Vec<(f64, f64)> {
    let all = instants
        .iter()
        .flat_map(|instant| instant.values.iter().map(|one| (instant.seconds, one)));
    all.filter(|(_, (other, _))| *other == sensor)
        .filter_map(|(seconds, (_, reading))| Some((seconds, reading.value()?)))
        .collect()
}

/// What each sensor is off from the reference, whose values these are, in each instant; `None` of wild values and of offsets that wander.
pub(super) fn offs(
    instants: &[Instant],
    model: &LevelModel,
    reference: usize,
    level: &[(f64, f64)],
) -> Vec<Vec<Option<Off>>> {
    let begin = instants.first().map_or(0.0, |instant| instant.seconds);
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
    instants.iter().map(off).collect()
}

/// Correlations of the noises of two sensors beside a third: of what both are off from its values, less what its own noise, and the level
/// between its values, bring into both.
pub(super) fn of(instants: &[Instant], model: &LevelModel, reference: usize) -> Vec<Correlation> {
    let rows = offs(instants, model, reference, &values(instants, reference));
    let count = model.sensors.len();
    let own_variance = model.sensors[reference].noise.powi(2);
    let rate = model.change * model.change;
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
                pairs: 0,
            });
        }
    }
    let pairs = found.len();
    found.iter_mut().for_each(|one| one.pairs = pairs);
    found
}
