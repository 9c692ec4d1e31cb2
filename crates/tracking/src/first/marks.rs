//! Numbers that stand for gaps, as -999: far from all values of their sensor, and written as such numbers are; or zeros of all sensors at once.

use crate::rows::instant::Instant;
use crate::text;
use std::collections::{BTreeMap, VecDeque};

/// Numbers by which devices mark gaps, beside those of nines alone.
const WRITTEN: [f64; 7] = [
    32767.0,
    32768.0,
    65535.0,
    8388607.0,
    2147483647.0,
    2147483648.0,
    4294967295.0,
];
/// Most nines of such a number.
const NINES: i32 = 10;
/// They are farther from all other values than so many times their range.
const FAR: f64 = 3.0;
/// Values from which the range is known.
const FEWEST: usize = 10;

#[derive(Debug, Clone, Copy)]
struct Range {
    low: f64,
    high: f64,
    count: usize,
}

impl Range {
    fn add(&mut self, value: f64) {
        (self.low, self.high) = (self.low.min(value), self.high.max(value));
        self.count += 1;
    }

    fn is_far(&self, value: f64) -> bool {
        let off = (self.low - value).max(value - self.high);
        self.count >= FEWEST && self.high > self.low && off > FAR * (self.high - self.low)
    }
}

/// Whether a number is written as one that marks a gap.
fn is_written(value: f64) -> bool {
    let size = value.abs();
    // 99, 999, 999.9, 99.99 and so on.
    let is_nines = |decimals: i32| (2..=NINES).any(|digits| size == (10f64.powi(digits) - 1.0) / 10f64.powi(decimals));
    size >= 99.0 && (WRITTEN.contains(&size) || (0..3).any(is_nines))
}

/// Leaves such numbers out of rows.
#[derive(Debug)]
pub(crate) struct Marks {
    ranges: Vec<Range>,
    /// How often a sensor had a number that was left out, by its text.
    found: BTreeMap<(usize, String), u64>,
}

impl Marks {
    /// Ranges of the values of the first rows.
    pub(crate) fn begin(first: &VecDeque<Instant>, sensors: usize) -> Self {
        let empty = Range {
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            count: 0,
        };
        let mut ranges = vec![empty; sensors];
        for (sensor, cell) in first.iter().flat_map(|row| &row.reports) {
            if let Some(value) = cell.filter(|cell| cell.is_finite() && *cell != 0.0 && !is_written(*cell)) {
                ranges[*sensor].add(value);
            }
        }
        Self {
            ranges,
            found: BTreeMap::new(),
        }
    }

    /// Empties the cells of a row that mark gaps.
    pub(crate) fn leave_out(&mut self, row: &mut Instant) {
        let is_zero = |(sensor, cell): &(usize, Option<f64>)| {
            *cell == Some(0.0) && self.ranges.get(*sensor).is_some_and(|range| range.is_far(0.0))
        };
        let all_zero = row.reports.len() > 1 && row.reports.iter().all(is_zero);
        for (sensor, cell) in &mut row.reports {
            let (Some(value), Some(range)) = (*cell, self.ranges.get_mut(*sensor)) else {
                continue;
            };
            if all_zero || is_written(value) && range.is_far(value) {
                *self.found.entry((*sensor, value.to_string())).or_default() += 1;
                *cell = None;
            } else if value.is_finite() {
                range.add(value);
            }
        }
    }

    /// A line for each sensor and number.
    pub(crate) fn hints(&self, names: &[String]) -> Vec<String> {
        let line = |((sensor, value), count): (&(usize, String), &u64)| {
            format!(
                "{} is {value} in {count} rows, far from all its other values: these are taken for gaps; say --missing {value} to be certain, or --noise, \
                 --change and --prior together to keep them",
                text::name(&names[*sensor])
            )
        };
        self.found.iter().map(line).collect()
    }
}
