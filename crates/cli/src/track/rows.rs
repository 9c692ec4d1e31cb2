//! Conversion of rows of a table to instants: what each sensor reported at one time.

use super::columns::{Finds, Kind, Roles};
use super::own_columns::OwnColumns;
use super::seconds::Seconds;
use super::target::OfTarget;
use crate::arguments::TableOptions;
use crate::clock;
use crate::error::Error;
use crate::files::is_regular;
use crate::input::Table;
use fewbits_record::TimeBase;
use fewbits_tracking::{Failure, Instant, RowOptions, Rows};

/// Smallest number of seconds that is proposed for rows that come late.
const LATE: f64 = 60.0;
/// Seconds by which clocks are set back in autumn.
const HOUR: f64 = 3600.0;
/// Seconds by which no row is late: a clock is wrong.
const FOREVER: f64 = 30.0 * 86_400.0;
/// A pause is told if it is longer than that, and longer than so many of the longest one before.
const PAUSES: f64 = 100.0;

/// A table whose rows are instants.
pub(super) struct TableRows {
    table: Table,
    base: TimeBase,
    is_long: bool,
    /// What was found of its columns.
    pub(super) roles: Roles,
    /// Whether cells may be limits, as `<0.25`.
    pub(super) has_limits: bool,
    own: OwnColumns,
    seconds: Seconds,
    last: f64,
    /// Seconds from the row before to the last.
    step: f64,
    /// The longest such time so far.
    longest: f64,
    /// The first row behind a long pause, its time and the days of the pause.
    pause: Option<(u64, String, f64)>,
    next_number: i64,
    /// Names of the sensors so far.
    names: Vec<String>,
    /// Whether rows may be late.
    may_be_late: bool,
    /// The rows that are taken, if not all are.
    only: Option<OfTarget>,
}

/// The instants of a table.
pub(super) type Instants = fewbits_tracking::Instants<TableRows>;

/// Opens a table. `only`: the rows that are taken, if not all are.
pub(super) fn open(options: &TableOptions, kind: &Kind, only: Option<OfTarget>) -> Result<Instants, Error> {
    let rows = TableRows {
        only,
        ..TableRows::open(options, kind)?
    };
    let options = RowOptions {
        single_reports: rows.is_long,
        filled: kind.is_filled,
        late: kind.late,
        sampled: kind.sampled,
        numbered: !rows.has_time(),
        ..RowOptions::default()
    };
    Ok(Instants::new(rows, options))
}

impl TableRows {
    fn open(options: &TableOptions, kind: &Kind) -> Result<Self, Error> {
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
        table.require_numbers(|_| true)?;
        let base = table.time_base(&table_options, None)?;
        if table.is_at_end()? {
            return Err(Error::empty(table.file(), "rows"));
        }
        Ok(Self {
            names: if roles.by.is_some() { Vec::new() } else { sensors },
            is_long: roles.by.is_some(),
            roles,
            has_limits,
            own,
            seconds: Seconds::new(base, table.is_of_day()),
            table,
            base,
            last: 0.0,
            step: 0.0,
            longest: 0.0,
            pause: None,
            next_number: 0,
            may_be_late: kind.late > 0.0,
            only: None,
        })
    }

    /// The name of the table in messages.
    pub(super) fn file(&self) -> &str {
        self.table.file()
    }

    /// What was made of accuracies that are none, and of numbers that stand for gaps, a line each.
    fn strange_accuracies(&self) -> Vec<String> {
        let name = self.roles.any_accuracy().map_or("", String::as_str);
        let [unknown, void] = self.own.strange;
        let mut lines = Vec::new();
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

    fn read(&mut self) -> Result<Option<Instant>, Error> {
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
        let may_be_late = self.may_be_late;
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
            } else if matches!(self.base, TimeBase::Clock { .. }) && self.last - seconds > FOREVER {
                let days = ((self.last - seconds) / 86_400.0).round();
                format!(
                    "{above}, by {days} days: a clock that was reset, as to 1970 at a restart, or that was wrong in the row above; correct these times \
                     or take the rows out; --late would wait that long with every row"
                )
            } else {
                let late = self.latest(seconds).ceil().max(LATE);
                format!("{above}: sort the rows by time, or say how late rows may be, as --late {late}s")
            };
            return Err(Error::content(self.file(), problem));
        }
        self.step = seconds - self.last;
        let is_pause = self.step > FOREVER && self.step > PAUSES * self.longest && self.longest > 0.0;
        if is_pause && matches!(self.base, TimeBase::Clock { .. }) && self.pause.is_none() {
            self.pause = Some((row, time.clone(), (self.step / 86_400.0).round()));
        }
        self.longest = self.longest.max(self.step);
        self.last = seconds;
        let limit = |place: usize| self.table.limit(place).filter(|_| self.has_limits);
        let qualifier = |place: &usize| self.own.qualifier(*place, &cells, limit(*place));
        let qualifiers = self.own.sensors.iter().map(qualifier).collect();
        let cells = self.own.values(&cells).into_iter();
        let reports = if self.is_long {
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

impl Rows for TableRows {
    fn next(&mut self) -> Result<Option<Instant>, Failure> {
        Ok(self.read()?)
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    /// [`Table::is_live`].
    fn is_live(&self) -> bool {
        self.table.is_live()
    }

    fn found(&self) -> &[String] {
        &self.roles.told
    }

    fn told(&self) -> Vec<String> {
        let mut lines = self.strange_accuracies();
        lines.extend(self.own.hints(&self.table.names));
        lines.extend(self.pause.iter().map(|(row, time, days)| {
            format!(
                "row {row}, of {time}, is {days} days after the row above, as behind a clock that was not yet set: if the times before are wrong, take \
                 those rows out"
            )
        }));
        lines
    }
}
