//! Counts over all rows of a table.

use crate::column::{Batch, Column, Kind};
use crate::error::Error;
use crate::profile::Profile;
use crate::table::{Skipped, Table};
use crate::time::Time;

impl Table {
    /// Reads all that is left and counts: kinds, ranges, gaps and times.
    ///
    /// # Errors
    /// As [`read`](Self::read), but cells of values are counted, not refused.
    pub fn survey(mut self) -> Result<Survey, Error> {
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            return self.survey_arrow();
        }
        let mut survey = Survey {
            columns: vec![Profile::default(); self.columns.len()],
            ..Survey::default()
        };
        let mut batch = Batch::default();
        self.selected.clear();
        loop {
            match self.read(&mut batch, 1) {
                Ok(0) => break,
                Ok(_) => {}
                Err(error) => return Err(error),
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
        survey.skipped = self.skipped;
        Ok(survey)
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
}

impl Times {
    pub(crate) fn add(&mut self, time: Time) {
        self.decimals = self.decimals.max(time.decimals());
        let Some((first, last)) = self.ends else {
            self.ends = Some((time, time));
            return;
        };
        self.ends = Some((first, time));
        let step = time.seconds_since(last);
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
