//! Columns that hold their values: each measurement stands in several rows, because the table is written more often than the sensor measures.
//!
//! ```text
//! of measurements with noise, written with steps s, a share of about .4 s / (deviation of a change) equals the one before by chance
//! held    if a share of 1/4 does so, in runs of ten different values, although some change is below a fifth of the median one
//! ```
//! By chance that share is then at most .06. Repetitions say nothing new: taken for measurements, they make bands too narrow.

use crate::first::constant::Constants;
use crate::first::derived::{Derived, derived};
use crate::first::marks::Marks;
use crate::rows::instant::Instant;
use fewbits_numerics::Runs;
use std::collections::VecDeque;

/// Least share of the values that equal the one before, and number of different values that are repeated.
const OFTEN: f64 = 0.25;
const DIFFERENT: usize = 10;
/// Largest of the smallest change, in medians of the changes.
const FINE: f64 = 0.2;
/// A longer run than so many of the longest among the first rows is no longer left out: the sensor may be stuck.
const LONGER: u32 = 3;

#[derive(Debug, Clone, Copy, Default)]
struct Column {
    /// Longest run that is left out; 0 if the column does not hold its values.
    longest: u32,
    runs: Runs,
}

/// Leaves repetitions, and numbers that stand for gaps, out of rows.
#[derive(Debug)]
pub(crate) struct Held {
    columns: Vec<Column>,
    marks: Marks,
    constants: Constants,
    derived: Vec<Derived>,
}

/// Longest run of repetitions in values, if they are held.
fn held(values: &[f64]) -> Option<u32> {
    let (mut runs, mut longest) = (Runs::default(), 0);
    let (mut changes, mut repeated) = (Vec::new(), Vec::new());
    for value in values {
        let last = runs.add(*value);
        longest = longest.max(runs.repetitions);
        match runs.repetitions {
            0 => changes.extend(last.map(|last| (value - last).abs())),
            1 => repeated.push(*value),
            _ => {}
        }
    }
    let equal = runs.equal.saturating_add(runs.repetitions);
    changes.sort_by(f64::total_cmp);
    repeated.sort_by(f64::total_cmp);
    repeated.dedup();
    let is_often = f64::from(equal) >= OFTEN * values.len() as f64 && repeated.len() >= DIFFERENT;
    let is_fine = changes.first()? <= &(FINE * changes[changes.len() / 2]);
    (is_often && is_fine).then_some(longest)
}

fn columns(first: &VecDeque<Instant>, sensors: usize) -> Vec<Column> {
    let of = |sensor: usize| {
        let all = first.iter().flat_map(|instant| &instant.reports);
        let own = all.filter(|(other, _)| *other == sensor);
        let values: Vec<f64> = own
            .filter_map(|(_, cell)| cell.filter(|cell| cell.is_finite()))
            .collect();
        Column {
            longest: held(&values).map_or(0, |longest| LONGER * longest),
            ..Column::default()
        }
    };
    (0..sensors).map(of).collect()
}

impl Held {
    /// Leaves them out of the first rows.
    pub(crate) fn begin(first: &mut VecDeque<Instant>, sensors: usize) -> Self {
        let marks = Marks::begin(first, sensors);
        let mut held = Self {
            columns: columns(first, sensors),
            marks,
            constants: Constants::begin(first.make_contiguous(), sensors),
            derived: derived(first.make_contiguous(), sensors),
        };
        first.iter_mut().for_each(|row| held.leave_out(row));
        held
    }

    /// Leaves only repetitions out of the first rows.
    pub(crate) fn of_repetitions(first: &mut VecDeque<Instant>, sensors: usize) -> Self {
        let mut held = Self {
            columns: columns(first, sensors),
            marks: Marks::begin(&VecDeque::new(), sensors),
            constants: Constants::begin(&[], sensors),
            derived: Vec::new(),
        };
        first.iter_mut().for_each(|row| held.leave_out(row));
        held
    }

    /// The sensors whose columns hold their values.
    pub(crate) fn sensors(&self) -> impl Iterator<Item = usize> + '_ {
        let all = self.columns.iter().enumerate();
        all.filter(|(_, column)| column.longest > 0).map(|(sensor, _)| sensor)
    }

    /// What numbers are taken for gaps, and which columns are constant or computed from others.
    pub(crate) fn hints(&self, names: &[String]) -> Vec<String> {
        let mut lines = self.marks.hints(names);
        lines.extend(self.constants.hints(names));
        lines.extend(self.derived.iter().map(|one| one.hint(names)));
        lines
    }

    /// Takes them out of the next row; a repetition as if the sensor had not been asked.
    pub(crate) fn leave_out(&mut self, row: &mut Instant) {
        self.marks.leave_out(row);
        if self.sensors().next().is_none() && self.constants.is_empty() && self.derived.is_empty() {
            return;
        }
        let mut stays = Vec::with_capacity(row.reports.len());
        for (sensor, cell) in &row.reports {
            let is_derived = self.derived.iter().any(|one| one.column() == *sensor);
            if self.constants.repeats(*sensor, *cell) || is_derived {
                stays.push(false);
                continue;
            }
            let Some(column) = self.columns.get_mut(*sensor).filter(|column| column.longest > 0) else {
                stays.push(true);
                continue;
            };
            match cell {
                Some(value) => _ = column.runs.add(*value),
                None => column.runs.repetitions = 0,
            }
            let repetitions = column.runs.repetitions;
            stays.push(repetitions == 0 || repetitions > column.longest);
        }
        let mut of_reports = stays.iter();
        row.reports.retain(|_| of_reports.next().is_none_or(|stays| *stays));
        let mut of_qualifiers = stays.iter();
        row.qualifiers
            .retain(|_| of_qualifiers.next().is_none_or(|stays| *stays));
    }
}
