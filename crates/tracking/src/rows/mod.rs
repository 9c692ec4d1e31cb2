//! Rows of a table as instants, in the order of time, which can be looked at before they are used.
//!
//! | file | what it holds |
//! |---|---|
//! | `instant` | what the sensors reported at one time |
//! | `correction`, `transform` | corrections of values; roots and logarithms of them |
//! | `late` | rows that come late |
//! | `samples`, `rhythm` | what sensors measured and did not send; silence where a report was due |

pub(crate) mod correction;
pub(crate) mod instant;
pub(crate) mod late;
pub(crate) mod rhythm;
pub(crate) mod samples;
pub(crate) mod transform;

use crate::error::{Error, Failure};
use crate::first::again::Again;
use crate::first::held::Held;
use correction::{Correction, correct};
use instant::{Instant, Qualifier, Reports};
use late::Late;
use samples::Samples;
use std::collections::VecDeque;
use transform::Transform;

/// A source of rows.
pub trait Rows {
    /// The next row, in the order of time unless [`RowOptions::late`] is above 0; `None` at the end.
    ///
    /// # Errors
    /// If it cannot be read.
    fn next(&mut self) -> Result<Option<Instant>, Failure>;

    /// Names of the sensors so far.
    fn names(&self) -> &[String];

    /// Whether rows come one by one, so that none is waited for without need.
    fn is_live(&self) -> bool {
        false
    }

    /// What was found of the columns, a line each.
    fn found(&self) -> &[String] {
        &[]
    }

    /// What is to be said of the cells behind the last row, a line each.
    fn told(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Rows that are there.
#[derive(Debug, Clone)]
pub struct Listed<I> {
    names: Vec<String>,
    rows: I,
}

impl<I: Iterator<Item = Instant>> Rows for Listed<I> {
    fn next(&mut self) -> Result<Option<Instant>, Failure> {
        Ok(self.rows.next())
    }

    fn names(&self) -> &[String] {
        &self.names
    }
}

/// How rows become instants.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RowOptions {
    /// Each row is a report by itself: an instant may have several rows.
    pub single_reports: bool,
    /// A sensor that does not report at an instant has an empty cell there, though each row is a report.
    pub filled: bool,
    /// Seconds by which a row may be late. It waits so long for earlier ones.
    pub late: f64,
    /// Seconds between measurements of sensors that send some of them.
    pub sampled: Option<f64>,
    /// Rows have no times: they are numbered, and count as a second apart.
    pub numbered: bool,
    /// What is corrected in the values of sensors.
    pub corrections: Vec<Correction>,
    /// What is made of the values.
    pub transform: Option<Transform>,
}

/// Rows as instants.
pub struct Instants<R> {
    source: R,
    options: RowOptions,
    /// Number of rows that were dropped because they repeat one of the same time.
    copies: u64,
    /// Time and cells of the last row.
    before: Option<(f64, Reports)>,
    /// Rows that were read ahead.
    ahead: VecDeque<Instant>,
    /// The row after an instant that has several rows.
    pending: Option<Instant>,
    /// Rows that wait for those that are late.
    late: Late,
    /// Measurements between rows.
    samples: Option<Samples>,
    /// Reports that come again a little later.
    again: Again,
    /// What is left out of rows because it only repeats.
    held: Option<Held>,
}

impl<I: Iterator<Item = Instant>> Instants<Listed<I>> {
    /// Instants of rows that are there, in the order of time, with the names of their sensors.
    pub fn listed<N: Into<String>>(
        names: impl IntoIterator<Item = N>,
        rows: impl IntoIterator<Item = Instant, IntoIter = I>,
    ) -> Self {
        let source = Listed {
            names: names.into_iter().map(Into::into).collect(),
            rows: rows.into_iter(),
        };
        Self::new(source, RowOptions::default())
    }
}

impl<R: Rows> Instants<R> {
    /// Instants of the rows of a source.
    pub fn new(source: R, options: RowOptions) -> Self {
        Self {
            source,
            copies: 0,
            before: None,
            ahead: VecDeque::new(),
            pending: None,
            late: Late::new(options.late),
            samples: options.sampled.map(Samples::new),
            again: Again::default(),
            held: None,
            options,
        }
    }

    /// The source.
    pub fn source(&self) -> &R {
        &self.source
    }

    /// How rows become instants.
    pub fn options(&self) -> &RowOptions {
        &self.options
    }

    /// Corrects the values of all rows to come, and takes their transform. None was read yet.
    pub fn corrected(mut self, corrections: Vec<Correction>, transform: Option<Transform>) -> Self {
        (self.options.corrections, self.options.transform) = (corrections, transform);
        self
    }

    /// Names of the sensors so far.
    pub fn names(&self) -> &[String] {
        self.source.names()
    }

    /// Number of rows, or single reports, that said the same again and were dropped.
    pub fn copies(&self) -> u64 {
        self.copies
    }

    /// What was left out of rows, or is strange in them, a line each.
    pub(crate) fn told(&self) -> Vec<String> {
        let mut lines = self.again.hints(self.names());
        let held = self.held.iter().flat_map(|held| held.hints(self.names()));
        lines.extend(held);
        lines.extend(self.source.told());
        lines
    }

    /// Reads up to `count` instants without consuming them; fewer at the end.
    ///
    /// # Errors
    /// As [`next`](Self::next).
    pub fn peek(&mut self, count: usize) -> Result<&VecDeque<Instant>, Error> {
        while self.ahead.len() < count {
            match self.read_new()? {
                Some(instant) => self.ahead.push_back(instant),
                None => break,
            }
        }
        Ok(&self.ahead)
    }

    /// The next instant; `None` at the end.
    ///
    /// # Errors
    /// If the source fails, a row comes later than was said, or a value has no transform.
    #[expect(
        clippy::should_implement_trait,
        reason = "an iterator of results would go on behind an error"
    )]
    pub fn next(&mut self) -> Result<Option<Instant>, Error> {
        match self.ahead.pop_front() {
            Some(instant) => Ok(Some(instant)),
            None => self.read_new(),
        }
    }

    /// Leaves repetitions of columns that hold their values out of the rows that were read ahead and of all that follow. The sensors.
    pub(crate) fn leave_out_repetitions(&mut self) -> Vec<usize> {
        self.held = Some(Held::begin(&mut self.ahead, self.source.names().len()));
        self.held.iter().flat_map(Held::sensors).collect()
    }

    /// The same of reports that come again a little later.
    pub(crate) fn leave_out_again(&mut self) {
        self.again = Again::of(&self.ahead, self.source.names().len());
        self.ahead.iter_mut().for_each(|row| self.again.leave_out(row));
    }

    /// The same of repetitions alone, from so many first rows.
    pub(crate) fn leave_out_old(&mut self, count: usize) -> Result<Vec<usize>, Error> {
        self.peek(count)?;
        let held = Held::of_repetitions(&mut self.ahead, self.source.names().len());
        let found: Vec<usize> = held.sensors().collect();
        self.held = Some(held).filter(|_| !found.is_empty());
        Ok(found)
    }

    fn read_new(&mut self) -> Result<Option<Instant>, Error> {
        let mut found = self.read_with_samples()?;
        if let Some(row) = &mut found {
            self.again.leave_out(row);
            self.held.iter_mut().for_each(|held| held.leave_out(row));
        }
        Ok(found)
    }

    /// Whether instants without a row are among those that are read.
    pub(crate) fn has_samples(&self) -> bool {
        self.samples.is_some()
    }

    fn read_with_samples(&mut self) -> Result<Option<Instant>, Error> {
        let Some(mut samples) = self.samples.take() else {
            return self.read();
        };
        let mut found = samples.next();
        if found.is_none()
            && let Some(instant) = self.read()?
        {
            samples.add(instant);
            found = samples.next();
        }
        self.samples = Some(samples);
        Ok(found)
    }

    fn read(&mut self) -> Result<Option<Instant>, Error> {
        let Some(mut instant) = self
            .pending
            .take()
            .map_or_else(|| self.read_row(), |row| Ok(Some(row)))?
        else {
            return Ok(None);
        };
        // Rows of one time are one instant, if each row is a report.
        while self.options.single_reports {
            match self.read_row()? {
                Some(row) if row.seconds == instant.seconds => {
                    // A message that is delivered twice is one report.
                    if row.reports.iter().all(|report| instant.reports.contains(report)) {
                        self.copies += 1;
                    } else {
                        instant.reports.extend(row.reports);
                        instant.qualifiers.extend(row.qualifiers);
                    }
                }
                row => {
                    self.pending = row;
                    break;
                }
            }
        }
        if self.options.single_reports && self.options.filled {
            for sensor in 0..self.source.names().len() {
                if instant.reports.iter().all(|(other, _)| *other != sensor) {
                    instant.reports.push((sensor, None));
                    instant.qualifiers.push(Qualifier::default());
                }
            }
        }
        Ok(Some(instant))
    }

    /// The next row that is not a copy of the one before.
    fn read_row(&mut self) -> Result<Option<Instant>, Error> {
        loop {
            let row = self.read_sorted_row()?;
            let is_copy = !self.options.numbered
                && row
                    .as_ref()
                    .is_some_and(|row| self.before.as_ref() == Some(&(row.seconds, row.reports.clone())));
            if is_copy {
                self.copies += 1;
                continue;
            }
            self.before = row.as_ref().map(|row| (row.seconds, row.reports.clone()));
            return Ok(row);
        }
    }

    /// The next row in the order of time, if rows may be late.
    fn read_sorted_row(&mut self) -> Result<Option<Instant>, Error> {
        if !self.late.is_waiting() {
            return self.read_any_row();
        }
        loop {
            if let Some(found) = self.late.pop() {
                return found.map(Some).map_err(|row| Error::Content {
                    row: row.row,
                    problem: format!(
                        "time {} is before that of a row that was used: a longer --late takes it in, as --late {}s",
                        row.time,
                        self.late.lateness(&row).ceil()
                    ),
                });
            }
            match self.read_any_row()? {
                Some(row) => self.late.push(row),
                None if self.late.end() => return Ok(None),
                None => {}
            }
        }
    }

    fn read_any_row(&mut self) -> Result<Option<Instant>, Error> {
        let Some(mut instant) = self.source.next().map_err(Error::Source)? else {
            return Ok(None);
        };
        let names = self.source.names();
        correct(&self.options.corrections, &mut instant.reports, names, instant.seconds);
        if let Some(transform) = self.options.transform {
            let row = instant.row;
            let wrong = |problem| Error::Content { row, problem };
            transform.apply(&mut instant.reports, names).map_err(wrong)?;
        }
        Ok(Some(instant))
    }
}
