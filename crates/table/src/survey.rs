//! Counts over all rows of a table.

use crate::column::{Batch, Column, Kind};
use crate::error::{Error, Place};
use crate::profile::Profile;
use crate::table::{Skipped, Table};
use crate::time::{DECIMALS, Time, decimals_of};

/// Rows between two calls of a watch, at least.
pub(crate) const WATCHED: u64 = 4096;

impl Table {
    /// Reads all that is left and counts: kinds, ranges, gaps and times.
    ///
    /// # Errors
    /// As [`read`](Self::read), but cells of values are counted, not refused.
    pub fn survey(self) -> Result<Survey, Error> {
        self.survey_watched(&mut |_| true)
    }

    /// As [`survey`](Self::survey). `watch` is called with the number of rows now and then; the rows behind are not counted if it returns
    /// `false`.
    ///
    /// # Errors
    /// As [`survey`](Self::survey).
    pub fn survey_watched(mut self, watch: &mut dyn FnMut(u64) -> bool) -> Result<Survey, Error> {
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            return self.survey_arrow(watch);
        }
        let mut next = 0;
        let mut survey = Survey {
            columns: Profile::of_columns(self.columns.len()),
            ..Survey::default()
        };
        for (profile, column) in survey.columns.iter_mut().zip(&self.columns) {
            profile.meaning = self.dialect.meaning_of(column);
        }
        let mut batch = Batch::default();
        self.selected.clear();
        loop {
            self.plain_survey(&mut survey)?;
            if survey.rows > next {
                next = survey.rows + WATCHED;
                if !watch(survey.rows) {
                    break;
                }
            }
            batch.reset(std::iter::empty());
            if self.read_rows(&mut batch, 1, false)? == 0 {
                break;
            }
            survey.rows += 1;
            let place = self.place();
            for (i, profile) in survey.columns.iter_mut().enumerate() {
                profile.add(self.row.cell_text(i), place, self.syntax, &self.gaps[i], self.dialect.strip_units);
            }
            if let Some(time) = batch.times.first() {
                survey.times.add(*time);
            }
        }
        for profile in &mut survey.columns {
            profile.settle();
            if let Some((place, _)) = &mut profile.first_text {
                *place = self.own_place(*place);
            }
        }
        survey.skipped = self.skipped;
        Ok(survey)
    }

    /// Counts rows as long as they are plain and lie in the buffer.
    fn plain_survey(&mut self, survey: &mut Survey) -> Result<(), Error> {
        let Some(scanner) = self.scanner.as_mut() else {
            return Ok(());
        };
        let strips = self.dialect.strip_units;
        let (before, bytes) = self.rows.buffered()?;
        let (mut used, mut lines) = (0, 0);
        loop {
            let line = &bytes[used..];
            let Some(length) = scanner.line(line) else {
                break;
            };
            // The only column of the time, if its cell is a time in a usual spelling.
            let mut written = None;
            if let Some((columns, clock)) = &self.time {
                let time = match columns.as_slice() {
                    [column] => match clock.quick(scanner.cells[*column].bytes(line)) {
                        Some(time) => {
                            written = Some(*column).filter(|_| clock.is_written());
                            Ok(time)
                        }
                        None => clock.parse(scanner.cells[*column].text(line)),
                    },
                    several => {
                        let cells: Vec<&str> = several.iter().map(|i| scanner.cells[*i].text(line)).collect();
                        clock.of_parts(&cells)
                    }
                };
                let Ok(time) = time else {
                    break;
                };
                survey.times.add(time);
            }
            (used, lines) = (used + length, lines + 1);
            let place = Place {
                line: before + lines,
                row: self.count + lines,
            };
            for (i, profile) in survey.columns.iter_mut().enumerate() {
                let (cell, gaps) = (scanner.cells[i], &self.gaps[i]);
                let bytes = cell.bytes(line);
                let is_time = || {
                    let clock = self.clocks[i].as_ref().filter(|clock| clock.is_written());
                    written == Some(i) || clock.is_some_and(|clock| clock.quick(bytes).is_some())
                };
                match cell.number {
                    Some((value, decimals)) => profile.add_number(value, decimals, bytes, gaps),
                    None if is_time() => profile.add_written_time(bytes, gaps),
                    None => profile.add(cell.text(line), place, self.syntax, gaps, strips),
                }
            }
        }
        survey.rows += lines;
        self.count += lines;
        self.rows.consume(used, lines);
        Ok(())
    }
}

/// Counts over all rows of a table.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Survey {
    /// Number of rows.
    pub rows: u64,
    /// Counts of each column.
    pub columns: Vec<Profile>,
    /// Counts of the times.
    pub times: Times,
    /// Lines that were left out.
    pub skipped: Skipped,
}

impl Survey {
    /// The kind of a column over all rows; types that a file states are kept.
    pub fn kind(&self, column: &Column, profile: &Profile) -> Kind {
        match (column.kind, profile.kind()) {
            (Kind::Time, Kind::Number) => Kind::Time,
            (_, kind) => kind,
        }
    }
}

/// Counts over the times of rows.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Times {
    /// Decimals of a second that the finest one needs.
    pub decimals: u8,
    /// The first and the last in the order of rows.
    pub ends: Option<(Time, Time)>,
    /// Rows that are before the row above.
    pub backward: u64,
    /// Rows at the time of the row above.
    pub repeated: u64,
    /// The smallest and the largest step forward, in seconds.
    pub steps: Option<(f64, f64)>,
    /// The last step, in attoseconds, which is often the next one too.
    step: i128,
}

impl Times {
    pub(crate) fn add(&mut self, time: Time) {
        // Few times need more decimals than those before.
        let fraction = time.fraction();
        if !fraction.is_multiple_of(10_u64.pow(u32::from(DECIMALS - self.decimals))) {
            self.decimals = decimals_of(fraction);
        }
        let Some((first, last)) = self.ends else {
            self.ends = Some((time, time));
            return;
        };
        self.ends = Some((first, time));
        if time > last && time.0 - last.0 == self.step {
            return;
        }
        let step = time.seconds_since(last);
        self.step = time.0 - last.0;
        if time == last {
            self.repeated += 1;
        } else if step < 0.0 {
            self.backward += 1;
        } else {
            let (low, high) = self.steps.unwrap_or((step, step));
            self.steps = Some((low.min(step), high.max(step)));
        }
    }
}
