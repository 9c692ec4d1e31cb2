//! Values of the first rows.

use crate::rows::instant::Instant;
use fewbits_filters::calibration::{self, median, wrapped};
use std::collections::BTreeMap;

/// The deviation of an unknown slope in multiples of the slopes between values that are an eighth of the first rows apart.
const STEEP: f64 = 3.0;

/// Finite measurements of one sensor.
pub(crate) fn values_of(first: &[Instant], sensor: usize) -> Vec<f64> {
    let all = first.iter().flat_map(|instant| &instant.reports);
    let own = all.filter(|(other, _)| *other == sensor);
    own.filter_map(|(_, cell)| cell.filter(|cell| cell.is_finite()))
        .collect()
}

/// The first rows as instants of finite values, whatever they mean.
pub(crate) fn values(first: &[Instant], offsets: &[f64]) -> Vec<calibration::Instant> {
    let offset = |sensor: usize| offsets.get(sensor).copied().unwrap_or(0.0);
    let of = |instant: &Instant| calibration::Instant {
        seconds: instant.seconds,
        values: instant
            .reports
            .iter()
            .filter_map(|(sensor, cell)| {
                let value = cell.filter(|cell| cell.is_finite())? - offset(*sensor);
                Some((*sensor, value.into()))
            })
            .collect(),
    };
    first.iter().map(of).collect()
}

/// The same of sensors that send on change, each with its last value until the next: otherwise they hardly ever have values at one time.
pub(crate) fn held_values(first: &[Instant]) -> Vec<calibration::Instant> {
    let mut held = BTreeMap::new();
    let of = |mut instant: calibration::Instant| {
        held.extend(instant.values.iter().copied());
        instant.values = held.iter().map(|(sensor, reading)| (*sensor, *reading)).collect();
        instant
    };
    values(first, &[]).into_iter().map(of).collect()
}

/// A deviation for the slope per second before the first row: what the first rows do over an eighth of their length.
pub(crate) fn steepest(first: &[calibration::Instant], sensors: usize, period: Option<f64>) -> f64 {
    let of = |sensor: usize| {
        let own: Vec<(f64, f64)> = first
            .iter()
            .flat_map(|instant| instant.values.iter().map(|one| (instant.seconds, one)))
            .filter(|(_, (other, _))| *other == sensor)
            .filter_map(|(seconds, (_, reading))| Some((seconds, reading.value()?)))
            .collect();
        // Whole turns would be lost over many values.
        let apart = if period.is_some() { 1 } else { (own.len() / 8).max(1) };
        own.iter()
            .zip(own.iter().skip(apart))
            .filter(|(one, other)| other.0 > one.0)
            .map(|(one, other)| (wrapped(other.1 - one.1, period) / (other.0 - one.0)).abs())
            .collect::<Vec<f64>>()
    };
    STEEP * median((0..sensors).flat_map(of).collect())
}

/// Whether a sensor has two values that differ.
pub(crate) fn vary<'a>(first: impl IntoIterator<Item = &'a Instant>) -> bool {
    let mut of: BTreeMap<usize, f64> = BTreeMap::new();
    let mut cells = first.into_iter().flat_map(|instant| &instant.reports);
    cells.any(|(sensor, cell)| cell.is_some_and(|cell| cell.is_finite() && *of.entry(*sensor).or_insert(cell) != cell))
}

/// Number of values of the sensor with the most of them.
pub(crate) fn values_in<'a>(first: impl IntoIterator<Item = &'a Instant>) -> usize {
    let mut counts: Vec<usize> = Vec::new();
    for (sensor, _) in first
        .into_iter()
        .flat_map(|instant| &instant.reports)
        .filter(|(_, cell)| cell.is_some_and(f64::is_finite))
    {
        if counts.len() <= *sensor {
            counts.resize(sensor + 1, 0);
        }
        counts[*sensor] += 1;
    }
    counts.into_iter().max().unwrap_or(0)
}
