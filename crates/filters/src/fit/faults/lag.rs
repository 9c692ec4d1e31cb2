//! Sensors that lag behind the rises and falls of a level.

use super::super::correlations::{offs, values};
use super::super::problem::Problem;
use super::{FEWEST, Fault, FaultKind};
use crate::calibration::Instant;
use fewbits_numerics::normal::quantile;

/// Probability with which one of all sensors of values lags by chance.
const BY_CHANCE: f64 = 1e-2;
/// Half widths of the ways that are tried, in noises of the sensor.
const WAYS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Rows whose products may be correlated.
const LAGS: usize = 4;

impl Problem<'_> {
    /// The level by the values of the reference up to each.
    fn smooth(&self, level: &[(f64, f64)], reference: usize) -> Vec<f64> {
        let noise = self.model.sensors[reference].noise.powi(2);
        let rate = self.model.change.powi(2);
        let (mut mean, mut variance, mut before) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
        let of = |one: &(f64, f64)| {
            if variance.is_finite() {
                variance += rate * (one.0 - before);
                let gain = variance / (variance + noise);
                mean += gain * (one.1 - mean);
                variance = gain * noise;
            } else {
                (mean, variance) = (one.1, noise);
            }
            before = one.0;
            mean
        };
        level.iter().map(of).collect()
    }

    /// Sensors whose differences from the reference depend on the way that the reference went before.
    pub(super) fn lags(&self, instants: &[Instant], reference: usize) -> Vec<Fault> {
        let level = values(instants, reference);
        let rows = offs(instants, &self.model, reference, &level);
        let smooth = self.smooth(&level, reference);
        let mut found = Vec::new();
        let mut tested = 0;
        for sensor in 0..self.model.sensors.len() {
            let all: Vec<_> = rows.iter().filter_map(|row| row[sensor]).collect();
            if all.len() < FEWEST {
                continue;
            }
            tested += 1;
            let farthest = WAYS.iter().filter_map(|half| {
                let own = &self.model.sensors[sensor];
                let way = way(&smooth, half * own.noise / own.gain.abs());
                // Only values before those between which this difference and the one before were read: their noise is no part of them.
                let pairs: Vec<[f64; 3]> = all
                    .iter()
                    .filter_map(|off| {
                        let before = off.place.checked_sub(2)?;
                        Some([off.value, way[before], smooth[before]])
                    })
                    .collect();
                dependence(&pairs)
            });
            if let Some((lag, deviations)) = farthest.max_by(|one, other| one.1.abs().total_cmp(&other.1.abs())) {
                found.push((sensor, lag, deviations));
            }
        }
        let limit = -quantile(0.5 * BY_CHANCE / (WAYS.len() * tested.max(1)) as f64);
        found
            .into_iter()
            .filter(|(.., deviations)| deviations.abs() > limit)
            .map(|(sensor, lag, deviations)| Fault {
                sensor,
                kind: FaultKind::Lag,
                size: lag * self.model.sensors[sensor].gain.signum(),
                evidence: 0.5 * deviations * deviations,
            })
            .collect()
    }
}

/// Whether the level rises or falls at each value, between 1 and -1: where the value is in an interval of this half width that it draws along.
fn way(level: &[f64], half: f64) -> Vec<f64> {
    let mut middle = level.first().copied().unwrap_or(0.0);
    let of = |one: &f64| {
        // No interval of a half width that is no number.
        middle = middle.max(one - half).min(one + half);
        (one - middle) / half
    };
    level.iter().map(of).collect()
}

/// How far `[difference, way, level]` lags: minus the slope of the difference in the way, beside a line in the level and in time and errors that last, and that in its
/// deviations.
fn dependence(rows: &[[f64; 3]]) -> Option<(f64, f64)> {
    let count = rows.len();
    if count < FEWEST {
        return None;
    }
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let time: Vec<f64> = (0..count).map(|row| row as f64).collect();
    let mut basis = vec![vec![1.0; count], time, column(2)];
    for i in 0..basis.len() {
        let (before, rest) = basis.split_at_mut(i);
        before.iter().for_each(|other| remove(&mut rest[0], other));
    }
    let (mut off, mut way) = (column(0), column(1));
    for other in &basis {
        remove(&mut off, other);
        remove(&mut way, other);
    }
    // What lasts beside the dependence is taken out of both.
    let beside = |off: &[f64], way: &[f64]| {
        let slope = dot(off, way) / dot(way, way);
        let left: Vec<f64> = off.iter().zip(way).map(|(off, way)| off - slope * way).collect();
        (slope, left)
    };
    let left = beside(&off, &way).1;
    let lasting = left.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / dot(&left, &left);
    let lasting = if lasting.is_finite() {
        lasting.clamp(0.0, 1.0)
    } else {
        0.0
    };
    let differences = |of: &[f64]| {
        of.windows(2)
            .map(|pair| pair[1] - lasting * pair[0])
            .collect::<Vec<f64>>()
    };
    let (off, way) = (differences(&off), differences(&way));
    let (slope, left) = beside(&off, &way);
    let products: Vec<f64> = left.iter().zip(&way).map(|(left, way)| left * way).collect();
    let single = dot(&products, &products);
    let lagged = (1..=LAGS).map(|lag| {
        let weight = 1.0 - lag as f64 / (LAGS + 1) as f64;
        2.0 * weight * dot(&products[lag..], &products[..products.len() - lag])
    });
    let variance = single.max(single + lagged.sum::<f64>());
    let deviations = dot(&off, &way) / variance.sqrt();
    (slope.is_finite() && deviations.is_finite()).then_some((-slope, deviations))
}

fn dot(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

/// Removes the part along another column; of one that is zero nothing.
fn remove(from: &mut [f64], other: &[f64]) {
    let share = dot(from, other) / dot(other, other);
    if share.is_finite() {
        from.iter_mut()
            .zip(other)
            .for_each(|(one, other)| *one -= share * other);
    }
}
