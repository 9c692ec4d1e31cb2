//! A recording against the table that it was made of.

use crate::bounds;
use crate::error::Error;
use crate::source::{Batch, Source, Watch, report};
use fewbits_record::{Block, Column, Playback, TimeBase};
use serde::Serialize;
use std::io::{Read, Seek};

mod by_time;

pub use by_time::verify_by_time;

/// Largest number of failures of a column that are kept.
const MAX_FAILURES: usize = 3;

/// What was found for one column.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ColumnVerdict {
    /// Name of the column.
    pub name: String,
    /// Its bound in the language of [`bounds`].
    pub bound: String,
    /// Largest distance of a finite value from the restored one, along the shorter arc on a circle.
    pub largest_error: f64,
    /// Mean distance of finite values from the restored ones; 0 without any.
    pub mean_error: f64,
    /// Number of rows whose restored cell breaks the bound.
    pub failed: u64,
    /// The first of them.
    pub first_failures: Vec<CellFailure>,
}

/// A restored cell that breaks its bound.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CellFailure {
    /// Number of the row, from 1.
    pub row: u64,
    /// Its tick in the recording.
    pub tick: i64,
    /// The table's cell; `None` is a gap.
    pub sample: Option<f64>,
    /// The recording's cell; `None` is a gap.
    pub restored: Option<f64>,
}

/// What was found for a whole recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Verdict {
    /// Rows that both have.
    pub rows: u64,
    /// Whether times were compared.
    pub times_checked: bool,
    /// Rows whose time is further off than the tolerance.
    pub ticks_failed: u64,
    /// Rows that only the table has.
    pub missing_rows: u64,
    /// Rows that only the recording has.
    pub extra_rows: u64,
    /// Damage of the recording, behind which nothing was compared.
    pub damage: Option<String>,
    /// Whether all that was compared is as promised, and nothing is missing or damaged.
    pub holds: bool,
    /// The columns that were compared.
    pub columns: Vec<ColumnVerdict>,
    /// Names of the recording's columns that were not compared.
    pub not_compared: Vec<String>,
}

/// The rows of a source one by one.
struct Rows<'a> {
    source: &'a mut dyn Source,
    columns: usize,
    batch: Batch,
    next: usize,
}

impl Rows<'_> {
    /// Moves to the next row; `false` after the last.
    fn advance(&mut self) -> Result<bool, Error> {
        while self.next >= self.batch.rows() {
            match self.source.next_batch().map_err(Error::Source)? {
                Some(batch) => {
                    batch.check(self.columns)?;
                    (self.batch, self.next) = (batch, 0);
                }
                None => return Ok(false),
            }
        }
        self.next += 1;
        Ok(true)
    }
}

/// Compares every row. `matches[i]` is the index of the recording's column that column `i` of the source's batches is compared with.
/// Times are compared if both have them.
///
/// # Errors
/// If the source or reading fails, an index in `matches` is not that of a column, or `watch` breaks; it is called after each block.
/// Damage of the recording is no error but stands in the result.
pub fn verify<R: Read + Seek>(
    playback: &mut Playback<R>,
    source: &mut dyn Source,
    matches: &[usize],
    watch: &mut Watch<'_>,
) -> Result<Verdict, Error> {
    let schema = playback.schema().clone();
    let (mut verdict, compared) = Verdict::new(schema.columns(), matches)?;
    let mut rows = Rows {
        source,
        columns: matches.len(),
        batch: Batch::default(),
        next: 0,
    };
    let mut counts = vec![0; matches.len()];
    for block in playback.blocks() {
        let block = match block {
            Ok(block) => block,
            Err(error @ fewbits_record::Error::Block { .. }) => {
                verdict.damage = Some(error.to_string());
                return Ok(verdict);
            }
            Err(error) => return Err(error.into()),
        };
        verdict.compare(&block, schema.time(), &compared, matches, &mut rows, &mut counts)?;
        report(watch, verdict.rows)?;
    }
    while rows.advance()? {
        verdict.missing_rows += 1;
    }
    verdict.judge();
    Ok(verdict)
}

impl Verdict {
    /// Before the first row, and the columns that are compared.
    fn new<'a>(all: &'a [Column], matches: &[usize]) -> Result<(Self, Vec<&'a Column>), Error> {
        if let Some(found) = matches.iter().copied().find(|index| *index >= all.len()) {
            return Err(Error::Batch {
                found,
                expected: all.len(),
            });
        }
        let compared: Vec<&Column> = matches.iter().map(|index| &all[*index]).collect();
        let others = all.iter().enumerate().filter(|(index, _)| !matches.contains(index));
        let verdict = Self {
            rows: 0,
            times_checked: false,
            ticks_failed: 0,
            missing_rows: 0,
            extra_rows: 0,
            damage: None,
            holds: false,
            columns: compared.iter().map(|column| ColumnVerdict::new(column)).collect(),
            not_compared: others.map(|(_, column)| column.name().to_owned()).collect(),
        };
        Ok((verdict, compared))
    }

    /// Sums up after the last row.
    fn judge(&mut self) {
        self.holds = self.damage.is_none()
            && self.ticks_failed == 0
            && self.missing_rows == 0
            && self.extra_rows == 0
            && self.columns.iter().all(|column| column.failed == 0);
    }

    /// Compares the rows of a block.
    fn compare(
        &mut self,
        block: &Block,
        time: TimeBase,
        columns: &[&Column],
        matches: &[usize],
        rows: &mut Rows<'_>,
        compared: &mut [u64],
    ) -> Result<(), Error> {
        for (row, tick) in block.ticks.iter().enumerate() {
            if !rows.advance()? {
                self.extra_rows += (block.ticks.len() - row) as u64;
                return Ok(());
            }
            self.rows += 1;
            let original = rows.next - 1;
            if let (Some(ticks), true) = (&rows.batch.ticks, time != TimeBase::Numbered) {
                self.times_checked = true;
                self.ticks_failed += u64::from(ticks[original].abs_diff(*tick) > time.tolerance());
            }
            self.compare_row((block, row), (&rows.batch, original), columns, matches, compared);
        }
        Ok(())
    }

    /// Compares a row of a block with one of a batch.
    fn compare_row(
        &mut self,
        (block, row): (&Block, usize),
        (batch, original): (&Batch, usize),
        columns: &[&Column],
        matches: &[usize],
        compared: &mut [u64],
    ) {
        for (i, (column, index)) in columns.iter().zip(matches).enumerate() {
            let (sample, restored) = (batch.columns[i][original], block.columns[*index][row]);
            let found = &mut self.columns[i];
            if let Some(error) = distance(column, sample, restored) {
                compared[i] += 1;
                found.largest_error = found.largest_error.max(error);
                // A running mean, which no large sum rounds.
                found.mean_error += (error - found.mean_error) / compared[i] as f64;
            }
            if column.keeps(sample, restored, block.share_bounds[*index]) {
                continue;
            }
            found.failed += 1;
            if found.first_failures.len() < MAX_FAILURES {
                found.first_failures.push(CellFailure {
                    row: self.rows,
                    tick: block.ticks[row],
                    sample,
                    restored,
                });
            }
        }
    }
}

impl ColumnVerdict {
    fn new(column: &Column) -> Self {
        Self {
            name: column.name().to_owned(),
            bound: bounds::of_column(column),
            largest_error: 0.0,
            mean_error: 0.0,
            failed: 0,
            first_failures: Vec::new(),
        }
    }
}

/// Distance of two finite values, on a circle along the shorter arc; `None` for other cells. Whole numbers have codes, whose distance is
/// 0 or means nothing.
fn distance(column: &Column, sample: Option<f64>, restored: Option<f64>) -> Option<f64> {
    let (a, b) = (sample.filter(|a| a.is_finite())?, restored.filter(|b| b.is_finite())?);
    let turns = column
        .period()
        .map_or(0.0, |period| period * ((a - b) / period).round());
    Some((a - b - turns).abs())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::source::Columns;
    use fewbits_record::{Bound, Recorder, Schema};
    use std::io::Cursor;
    use std::ops::ControlFlow;

    fn batch(rows: u32) -> Batch {
        let cells = |scale: f64| (0..rows).map(|i| Some(scale * f64::from(i))).collect();
        Batch {
            ticks: None,
            columns: vec![cells(1.0), cells(-2.0)],
        }
    }

    fn recording(rows: u32) -> Vec<u8> {
        let columns = ["a", "b"].map(|name| Column::new(name, Bound::Lossless).unwrap());
        let schema = Schema::new(columns.to_vec(), TimeBase::Numbered).unwrap();
        let mut recorder = Recorder::new(Vec::new(), schema.with_rows_per_block(64).unwrap());
        let mut go = |_| ControlFlow::Continue(());
        crate::pack::fill(&mut Columns::new(batch(rows)), &mut recorder, &mut go).unwrap();
        recorder.finish().unwrap()
    }

    fn verdict(bytes: Vec<u8>, batch: Batch, matches: &[usize]) -> Verdict {
        let mut playback = Playback::new(Cursor::new(bytes)).unwrap();
        let mut go = |_| ControlFlow::Continue(());
        verify(&mut playback, &mut Columns::new(batch), matches, &mut go).unwrap()
    }

    #[test]
    fn columns_are_compared_with_their_matches() {
        let mut swapped = batch(200);
        swapped.columns.swap(0, 1);
        let found = verdict(recording(200), swapped.clone(), &[1, 0]);
        assert!(found.holds && found.rows == 200 && found.not_compared.is_empty());
        let found = verdict(recording(200), swapped, &[0, 1]);
        assert_eq!((found.holds, found.columns[0].failed, found.columns[0].first_failures.len()), (false, 200, 3));
        // Row `i` is off by `3 i`.
        assert_eq!(found.columns[0].largest_error, 597.0);
        assert!((found.columns[0].mean_error - 298.5).abs() < 1e-9, "{}", found.columns[0].mean_error);
    }

    #[test]
    fn columns_without_a_match_are_named() {
        let mut one = batch(200);
        one.columns.remove(1);
        let found = verdict(recording(200), one, &[0]);
        assert_eq!((found.holds, found.not_compared), (true, vec!["b".to_owned()]));
    }

    #[test]
    fn missing_and_extra_rows_fail() {
        let found = verdict(recording(200), batch(210), &[0, 1]);
        assert_eq!((found.holds, found.missing_rows, found.extra_rows), (false, 10, 0));
        let found = verdict(recording(200), batch(100), &[0, 1]);
        assert_eq!((found.holds, found.rows, found.extra_rows), (false, 100, 100));
    }

    #[test]
    fn damage_is_a_verdict() {
        let mut bytes = recording(200);
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        let found = verdict(bytes, batch(200), &[0, 1]);
        assert!(!found.holds && found.damage.is_some());
    }
}
