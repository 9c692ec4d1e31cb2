//! Readings in the order of time, without the structure of instants.

use crate::calibration::{Instant, Reading};

/// Parts of a long table that are taken for a first search.
const PARTS: usize = 8;
/// Readings in them, about.
const READINGS: usize = 4000;
/// A table is long if it has this many times as many.
const LONG: usize = 3;

/// A reading.
#[derive(Debug, Clone, Copy)]
pub(super) struct Told {
    pub(super) seconds: f64,
    pub(super) sensor: usize,
    pub(super) reading: Reading,
    /// Probability that it comes by chance, whatever is measured, and its own probability then. `None`: that of wild readings.
    pub(super) chance: Option<(f64, f64)>,
}

/// All readings.
#[derive(Debug, Clone)]
pub(super) struct Readings {
    pub(super) told: Vec<Told>,
    /// Places of each sensor's.
    pub(super) by_sensor: Vec<Vec<usize>>,
}

impl Readings {
    /// Every sensor of the instants is below `sensors`.
    pub(super) fn of(instants: &[Instant], sensors: usize) -> Self {
        let all = instants
            .iter()
            .flat_map(|instant| instant.values.iter().map(move |one| (instant.seconds, one)));
        let told = all.map(|(seconds, (sensor, reading))| Told {
            seconds,
            sensor: *sensor,
            reading: *reading,
            chance: None,
        });
        Self::new(told.collect(), sensors)
    }

    /// In the order of time.
    fn new(told: Vec<Told>, sensors: usize) -> Self {
        let mut by_sensor = vec![Vec::new(); sensors];
        for (place, one) in told.iter().enumerate() {
            by_sensor[one.sensor].push(place);
        }
        Self { told, by_sensor }
    }

    /// These and others.
    pub(super) fn with(&self, others: impl Iterator<Item = Told>) -> Self {
        let mut told = self.told.clone();
        told.extend(others);
        // Of one time these come first.
        told.sort_by(|one, other| one.seconds.total_cmp(&other.seconds));
        Self::new(told, self.by_sensor.len())
    }

    /// Stretches of readings that are spread over a long table: their likelihood is that of fewer readings of the same model. `None` if the
    /// table is not long.
    pub(super) fn part(&self) -> Option<Self> {
        let count = self.told.len();
        if count < LONG * READINGS {
            return None;
        }
        let stretch = READINGS / PARTS;
        let begins = (0..PARTS).map(|part| part * (count - stretch) / (PARTS - 1));
        let told = begins.flat_map(|begin| self.told[begin..begin + stretch].iter().copied());
        Some(Self::new(told.collect(), self.by_sensor.len()))
    }
}
