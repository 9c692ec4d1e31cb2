//! Reports that come again a little later, as a message that is delivered twice with the time of its arrival.
//!
//! ```text
//! usual   median time from a value to the next other one of a sensor
//! near    pairs of successive values within a quarter of that
//! again   nearly all near pairs are equal, and hardly any of the others
//! ```
//! By chance values that are near in time are equal hardly more often than others. A measurement that repeats is another matter (`held`): it repeats at
//! any distance.

use crate::rows::instant::Instant;
use crate::text::{self, short};
use fewbits_filters::calibration::median;
use std::collections::VecDeque;

/// A repetition comes within this share of the usual time.
const NEAR: f64 = 0.25;
/// Other values, and repetitions, from which that is known.
const FEWEST_OTHERS: usize = 10;
const FEWEST: usize = 3;
/// Share of the near pairs that are equal at least, and of the others at most.
const NEARLY_ALL: f64 = 0.9;
const HARDLY_ANY: f64 = 0.2;
/// Coarsely rounded values are equal at any distance: all near pairs are, and that by chance with this probability at most, in nats.
const SURELY: f64 = 20.0;

#[derive(Debug, Clone, Copy, Default)]
struct Column {
    /// Seconds within which an equal value is a repetition; 0 if there are none.
    within: f64,
    /// The last value, and its time.
    last: Option<(f64, f64)>,
    dropped: u64,
}

/// Leaves such repetitions out of rows.
#[derive(Debug, Default)]
pub(crate) struct Again {
    columns: Vec<Column>,
}

/// Seconds within which values of a sensor repeat, from times and values; 0 if they do not.
fn within(values: &[(f64, f64)]) -> f64 {
    let pairs = values
        .windows(2)
        .map(|pair| (pair[1].0 - pair[0].0, pair[1].1 == pair[0].1));
    let (equal, others): (Vec<_>, Vec<_>) = pairs.partition(|pair| pair.1);
    if others.len() < FEWEST_OTHERS {
        return 0.0;
    }
    let within = NEAR * median(others.iter().map(|pair| pair.0).collect());
    let count = |pairs: &[(f64, bool)]| pairs.iter().filter(|pair| pair.0 <= within).count();
    let (near, near_others) = (count(&equal), count(&others));
    let (far, far_others) = (equal.len() - near, others.len() - near_others);
    let is_seldom = far as f64 <= HARDLY_ANY * (far + far_others) as f64;
    let is_fine = is_seldom && near >= FEWEST && near as f64 >= NEARLY_ALL * (near + near_others) as f64;
    let chance = (far + 1) as f64 / (far + far_others + 1) as f64;
    let is_coarse = near_others == 0 && -chance.ln() * near as f64 >= SURELY;
    if is_fine || is_coarse { within } else { 0.0 }
}

impl Again {
    /// What the first rows say of each sensor.
    pub(crate) fn of(first: &VecDeque<Instant>, sensors: usize) -> Self {
        let mut values = vec![Vec::new(); sensors];
        for instant in first {
            for (sensor, cell) in &instant.reports {
                if let (Some(value), Some(own)) = (cell.filter(|cell| cell.is_finite()), values.get_mut(*sensor)) {
                    own.push((instant.seconds, value));
                }
            }
        }
        let column = |values: &Vec<(f64, f64)>| Column {
            within: within(values),
            ..Column::default()
        };
        Self {
            columns: values.iter().map(column).collect(),
        }
    }

    /// Takes repetitions out of a row, as if the sensor had not been asked.
    pub(crate) fn leave_out(&mut self, row: &mut Instant) {
        if self.columns.iter().all(|column| column.within == 0.0) {
            return;
        }
        let seconds = row.seconds;
        let again = row
            .reports
            .iter()
            .map(|(sensor, cell)| self.repeats(*sensor, seconds, *cell));
        let again: Vec<bool> = again.collect();
        let mut of_reports = again.iter();
        row.reports.retain(|_| !of_reports.next().is_some_and(|again| *again));
        let mut of_qualifiers = again.iter();
        row.qualifiers
            .retain(|_| !of_qualifiers.next().is_some_and(|again| *again));
    }

    fn repeats(&mut self, sensor: usize, seconds: f64, cell: Option<f64>) -> bool {
        let (Some(column), Some(value)) = (self.columns.get_mut(sensor), cell) else {
            return false;
        };
        let before = column.last.replace((seconds, value));
        let is_again = before.is_some_and(|(time, last)| last == value && seconds - time <= column.within);
        column.dropped += u64::from(is_again);
        is_again
    }

    /// A line for each sensor that repeats.
    pub(crate) fn hints(&self, names: &[String]) -> Vec<String> {
        let told = self.columns.iter().zip(names).filter(|(column, _)| column.dropped > 0);
        let line = |(column, name): (&Column, &String)| {
            format!(
                "{} has {} values that repeat the last one within {} s, as messages that are delivered twice do: they are left out; --noise, \
                 --change and --prior together keep them",
                text::name(name),
                column.dropped,
                short(column.within)
            )
        };
        told.map(line).collect()
    }
}
