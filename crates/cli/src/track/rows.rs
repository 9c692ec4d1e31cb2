//! Conversion of rows of a table to instants: what each sensor reported at one time.

use super::applied::{Correction, correct};
use super::columns::{Finds, Kind, Roles};
use super::held::Held;
use super::instant::{Instant, Qualifier, Reports};
use super::late::Late;
use super::own_columns::OwnColumns;
use super::samples::Samples;
use super::seconds::Seconds;
use super::target::OfTarget;
use super::transform::Transform;
use crate::arguments::TableOptions;
use crate::clock;
use crate::error::Error;
use crate::files::is_regular;
use crate::input::Table;
use fewbits_record::TimeBase;
use std::collections::VecDeque;

/// Smallest number of seconds that is proposed for rows that come late.
const LATE: f64 = 60.0;
/// Seconds by which clocks are set back in autumn.
const HOUR: f64 = 3600.0;

/// A table as instants.
pub(super) struct Instants {
    table: Table,
    base: TimeBase,
    is_long: bool,
    /// What was found of its columns.
    pub(super) roles: Roles,
    /// Whether a sensor that does not report at an instant has an empty cell there, though each row is a report.
    pub(super) is_filled: bool,
    /// Whether cells may be limits, as `<0.25`.
    pub(super) has_limits: bool,
    own: OwnColumns,
    seconds: Seconds,
    last: f64,
    /// Seconds from the row before to the last.
    step: f64,
    next_number: i64,
    /// Names of the sensors so far.
    pub(super) names: Vec<String>,
    /// Number of rows that were dropped because they repeat one of the same time.
    pub(super) copies: u64,
    /// What is corrected in the values of a sensor.
    corrections: Vec<Correction>,
    transform: Option<Transform>,
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
    /// What is left out of rows because it only repeats.
    held: Option<Held>,
    /// The rows that are taken, if not all are.
    pub(super) only: Option<OfTarget>,
}

impl Instants {
    pub(super) fn open(options: &TableOptions, kind: &Kind) -> Result<Self, Error> {
        let mut chosen = options.clone();
        // Each row is a report by itself: an instant may have several of one sensor.
        chosen.by = None;
        if !chosen.columns.is_empty() {
            chosen.columns.extend(kind.columns().cloned());
        }
        let table_options = TableOptions {
            // Only differences of times matter, so decimals beyond a nanosecond can be dropped.
            time: options.time.clone().or(Some("±2ns".to_owned())),
            ..chosen.clone()
        };
        let mut table = Table::open_with_time(&chosen, 2)?;
        let roles = Roles::find(&table, kind, chosen.columns.is_empty());
        if let Some((options, kind)) = roles.narrowed(options, kind).filter(|_| is_regular(&options.file)) {
            let mut open = Self::open(&options, &kind)?;
            open.roles.told = roles.told;
            return Ok(open);
        }
        if let Some(name) = &roles.by {
            table = table.with_labels(name)?;
        }
        let own =
            OwnColumns::find((&table.names, table.file()), kind.threshold.as_ref(), roles.accuracy.as_ref(), |name| {
                roles.accuracy_of(name)
            })?;
        let sensors: Vec<String> = own.sensors.iter().map(|i| table.names[*i].clone()).collect();
        if roles.by.is_some() && sensors.len() != 1 {
            let names = sensors.join(", ");
            let expected = "one column of values is expected beside time and --by, name it with --columns";
            return Err(Error::content(table.file(), format_args!("columns {names}: {expected}")));
        }
        if sensors.is_empty() {
            return Err(Error::empty(table.file(), "columns of values"));
        }
        let has_limits = table.take_limits();
        let is_levels = kind.finds == Finds::Levels && chosen.columns.is_empty();
        if let Some(hint) = roles.hint(&table).or_else(|| roles.mixed(&table).filter(|_| is_levels)) {
            return Err(Error::content(table.file(), hint));
        }
        table.require_numbers()?;
        let base = table.time_base(&table_options, None)?;
        if table.is_at_end()? {
            return Err(Error::empty(table.file(), "rows"));
        }
        Ok(Self {
            names: if roles.by.is_some() { Vec::new() } else { sensors },
            is_long: roles.by.is_some(),
            roles,
            has_limits,
            is_filled: kind.is_filled,
            own,
            seconds: Seconds::new(base, table.is_of_day()),
            table,
            base,
            last: 0.0,
            step: 0.0,
            next_number: 0,
            copies: 0,
            corrections: Vec::new(),
            transform: None,
            before: None,
            ahead: VecDeque::new(),
            pending: None,
            late: Late::new(kind.late),
            samples: kind.sampled.map(Samples::new),
            held: None,
            only: None,
        })
    }

    /// The same rows with corrected values, or functions of them.
    pub(super) fn corrected(self, corrections: Vec<Correction>, transform: Option<Transform>) -> Self {
        Self {
            corrections,
            transform,
            ..self
        }
    }

    /// The name of the table in messages.
    pub(super) fn file(&self) -> &str {
        self.table.file()
    }

    /// Whether rows may come one by one: [`Table::is_live`].
    pub(super) fn is_live(&self) -> bool {
        self.table.is_live()
    }

    /// What was made of accuracies that are none, and of numbers that stand for gaps, a line each.
    pub(super) fn strange_accuracies(&self) -> Vec<String> {
        let name = self.roles.any_accuracy().map_or("", String::as_str);
        let [unknown, void] = self.own.strange;
        let mut lines: Vec<String> = self.held.iter().flat_map(|held| held.hints(&self.names)).collect();
        if unknown > 0 {
            lines.push(format!(
                "{name} is 0 or below in {unknown} rows: their values have the noise of the sensor; if it marks values that are void, leave those \
                 rows out"
            ));
        }
        if void > 0 {
            lines.push(format!("{name} is infinite in {void} rows, whose values are left out"));
        }
        lines
    }

    /// Whether rows have times.
    pub(super) fn has_time(&self) -> bool {
        self.base != TimeBase::Numbered
    }

    /// Reads up to `count` instants without consuming them.
    pub(super) fn peek(&mut self, count: usize) -> Result<&VecDeque<Instant>, Error> {
        while self.ahead.len() < count {
            match self.read_new()? {
                Some(instant) => self.ahead.push_back(instant),
                None => break,
            }
        }
        Ok(&self.ahead)
    }

    /// The next instant.
    pub(super) fn next(&mut self) -> Result<Option<Instant>, Error> {
        match self.ahead.pop_front() {
            Some(instant) => Ok(Some(instant)),
            None => self.read_new(),
        }
    }

    /// Leaves repetitions of columns that hold their values out of the rows that were read ahead and of all that follow. The sensors.
    pub(super) fn leave_out_repetitions(&mut self) -> Vec<usize> {
        self.held = Some(Held::begin(&mut self.ahead, self.names.len()));
        self.held.iter().flat_map(Held::sensors).collect()
    }

    /// The same of repetitions alone, from so many first rows.
    pub(super) fn leave_out_old(&mut self, count: usize) -> Result<Vec<usize>, Error> {
        self.peek(count)?;
        let held = Held::of_repetitions(&mut self.ahead, self.names.len());
        let found: Vec<usize> = held.sensors().collect();
        self.held = Some(held).filter(|_| !found.is_empty());
        Ok(found)
    }

    fn read_new(&mut self) -> Result<Option<Instant>, Error> {
        let mut found = self.read_with_samples()?;
        if let (Some(held), Some(row)) = (&mut self.held, &mut found) {
            held.leave_out(row);
        }
        Ok(found)
    }

    /// Whether instants without a row are among those that are read.
    pub(super) fn has_samples(&self) -> bool {
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
        while self.is_long {
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
        if self.is_long && self.is_filled {
            for sensor in 0..self.names.len() {
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
            let is_copy = self.has_time()
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
                return found.map(Some).map_err(|row| {
                    let problem = format!(
                        "row {}: time {} is before that of a row that was used: a longer --late takes it in, as --late {}s",
                        row.row,
                        row.time,
                        self.late.lateness(&row).ceil()
                    );
                    Error::content(self.file(), problem)
                });
            }
            match self.read_any_row()? {
                Some(row) => self.late.push(row),
                None if self.late.end() => return Ok(None),
                None => {}
            }
        }
    }

    /// How late the latest row is, of one at this time and those that follow it. The rest of a pipe is not waited for.
    fn latest(&mut self, seconds: f64) -> f64 {
        let (mut newest, mut latest) = (self.last, self.last - seconds);
        if self.file() != "-" {
            while let Ok(Some((Some(tick), _))) = self.table.next(self.base) {
                let seconds = self.seconds.since_first(tick);
                newest = newest.max(seconds);
                latest = latest.max(newest - seconds);
            }
        }
        latest
    }

    fn read_any_row(&mut self) -> Result<Option<Instant>, Error> {
        let (tick, cells, row) = loop {
            let Some((tick, cells)) = self.table.next(self.base)? else {
                return Ok(None);
            };
            let tick = tick.unwrap_or(self.next_number);
            self.next_number = tick.wrapping_add(1);
            let row = self.table.row();
            if self.only.as_ref().is_none_or(|only| only.has(row)) {
                break (tick, cells, row);
            }
        };
        let may_be_late = self.late.is_waiting();
        let (tick, seconds) = self.seconds.of(tick, may_be_late, row, self.table.file());
        let time = clock::shown(tick, self.base);
        if seconds < self.last && !may_be_late {
            let above = format!("row {row}: time {time} is before that of the row above");
            let is_set_back = matches!(self.base, TimeBase::Clock { .. })
                && (self.last - seconds + self.step - HOUR).abs() <= 0.5 * self.step.min(HOUR);
            let problem = if is_set_back {
                format!(
                    "{above}: if the clock was set back by an hour, as in autumn, write times with their difference from UTC, as 2026-10-25T02:00:00+01:00; \
                     --late would mix the rows of both hours"
                )
            } else {
                let late = self.latest(seconds).ceil().max(LATE);
                format!("{above}: sort the rows by time, or say how late rows may be, as --late {late}s")
            };
            return Err(Error::content(self.file(), problem));
        }
        self.step = seconds - self.last;
        self.last = seconds;
        let limit = |place: usize| self.table.limit(place).filter(|_| self.has_limits);
        let qualifier = |place: &usize| self.own.qualifier(*place, &cells, limit(*place));
        let qualifiers = self.own.sensors.iter().map(qualifier).collect();
        let cells = self.own.values(&cells).into_iter();
        let mut reports: Reports = if self.is_long {
            let label = self.table.label();
            let known = self.names.iter().position(|name| name == label);
            let sensor = known.unwrap_or_else(|| {
                self.names.push(label.to_owned());
                self.names.len() - 1
            });
            cells.map(|(_, cell)| (sensor, cell)).collect()
        } else {
            cells.enumerate().map(|(sensor, (_, cell))| (sensor, cell)).collect()
        };
        correct(&self.corrections, &mut reports, &self.names, seconds);
        if let Some(transform) = self.transform {
            let wrong = |problem| Error::content(self.file(), format_args!("row {row}: {problem}"));
            transform.apply(&mut reports, &self.names).map_err(wrong)?;
        }
        Ok(Some(Instant {
            seconds,
            time,
            row,
            is_row: true,
            qualifiers,
            reports,
        }))
    }
}
