//! Sensors that say late what the others say at once, as one behind a slow filter, or in a thick case.
//!
//! ```text
//! level     by the others, smoothed, as well by those after a row as by those before it
//! on time   (value - level)^2 is smallest against the level of the same row
//! late      it is smaller against that some rows before, in nearly all of 32 stretches of the rows
//! ```
//! Noise of either side is the same in both squares, also noise that lasts.

use crate::first::groups::centred;
use crate::rows::instant::Instant;
use crate::text;
use fewbits_table::names::as_argument;

/// Rows by which a sensor may be late.
const LAGS: [usize; 8] = [1, 2, 3, 5, 8, 13, 21, 34];
/// Stretches, and rows in which a sensor and others have values, at least.
const STRETCHES: usize = 32;
const FEWEST: usize = 160;
/// More sensors are not compared.
const MOST: usize = 32;
/// Share of the weight of a value that is lost from row to row, as a logarithm: least and most.
const QUICK: [f64; 2] = [0.02, 3.0];
/// The level is known by the others within so many rows of their values.
const NEAR: usize = 8;
/// The squares are smaller by so many standard errors of their mean. Of a sensor that is on time they are larger, the more the level moves.
const SURELY: f64 = 4.0;

/// The level by the other sensors' values, weighted by their precisions and less with each row that they are away, before and after alike.
fn others(rows: &[Instant], sensor: usize, noises: &[f64], change: f64) -> Vec<Option<f64>> {
    let of = |row: &Instant| -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (other, cell) in row.reports.iter().filter(|(other, _)| *other != sensor) {
            if let Some(value) = cell.filter(|cell| cell.is_finite()) {
                let weight = noises[*other].powi(-2);
                sums = [sums[0] + weight * value, sums[1] + weight];
            }
        }
        sums
    };
    let own: Vec<[f64; 2]> = rows.iter().map(of).collect();
    let precision = own.iter().map(|sums| sums[1]).sum::<f64>() / own.len() as f64;
    // The best weights for a walk.
    let kept = (-(change * precision.sqrt()).clamp(QUICK[0], QUICK[1])).exp();
    let add = |last: &mut [f64; 2], sums: &[f64; 2]| {
        *last = [kept * last[0] + sums[0], kept * last[1] + sums[1]];
        Some(*last)
    };
    let before: Vec<[f64; 2]> = own.iter().scan([0.0; 2], add).collect();
    let mut after: Vec<[f64; 2]> = own.iter().rev().scan([0.0; 2], add).collect();
    after.reverse();
    let is_near = |row: usize| {
        let near = &own[row.saturating_sub(NEAR)..own.len().min(row + NEAR + 1)];
        near.iter().any(|sums| sums[1] > 0.0)
    };
    let level = |row: usize| {
        let [sum, weight] = [0, 1].map(|i| before[row][i] + after[row][i] - own[row][i]);
        (weight > 0.0 && is_near(row)).then(|| sum / weight)
    };
    (0..own.len()).map(level).collect()
}

/// How many standard errors the squares are smaller if the others are `lag` rows before.
fn gain(pairs: &[(Option<f64>, Option<f64>)], lag: usize) -> Option<(f64, f64)> {
    let known = pairs
        .iter()
        .zip(&pairs[lag..])
        .filter_map(|((_, before), (own, now))| Some(((*own)? - (*now)?, (*own)? - (*before)?)));
    let (now, before): (Vec<f64>, Vec<f64>) = known.unzip();
    if now.len() < FEWEST {
        return None;
    }
    let smaller: Vec<f64> = centred(&now)
        .iter()
        .zip(&centred(&before))
        .map(|(now, before)| now * now - before * before)
        .collect();
    let length = smaller.len() / STRETCHES;
    let means: Vec<f64> = smaller
        .chunks_exact(length)
        .map(|part| part.iter().sum::<f64>() / length as f64)
        .collect();
    let count = means.len() as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Some((mean, mean / (variance / count).sqrt()))
}

/// A line for each sensor that is late. `change`: deviation of the level from row to row.
pub(crate) fn lags(rows: &[Instant], names: &[String], noises: &[f64], change: f64) -> Vec<String> {
    // Of many sensors a late one hardly moves the level.
    if !(2..=MOST).contains(&names.len()) || rows.len() < FEWEST {
        return Vec::new();
    }
    let line = |(sensor, name): (usize, &String)| {
        let own = |row: &Instant| {
            let cell = row.reports.iter().find(|(other, _)| *other == sensor)?.1;
            cell.filter(|cell| cell.is_finite())
        };
        let others = others(rows, sensor, noises, change);
        let pairs: Vec<_> = rows.iter().map(own).zip(others).collect();
        let gains = LAGS.iter().filter_map(|lag| Some((lag, gain(&pairs, *lag)?)));
        let (lag, (_, surely)) = gains.max_by(|one, other| one.1.0.total_cmp(&other.1.0))?;
        let name = text::name(name);
        (surely > SURELY).then(|| {
            format!(
                "{name} says late what the others say at once, by about {lag} rows: the level is drawn to where it was, and bands are too narrow; \
                 --without {} leaves it out",
                as_argument([&name])
            )
        })
    };
    names.iter().enumerate().filter_map(line).collect()
}
