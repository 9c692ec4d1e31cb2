//! Which columns of a table give the time.

use crate::clock;
use crate::column::Kind;
use crate::error::{Error, Place, printable};
use crate::guess;
use crate::interval;
use crate::names;
use crate::parts;
use crate::sample::Refused;
use crate::table::Table;
use crate::time::Scale;
#[cfg(feature = "parquet")]
use crate::time::Unit;
#[cfg(feature = "parquet")]
use crate::written::Clock;
use crate::written::Syntax;

impl Table {
    /// Takes the times of rows from these columns, which are then no columns of values.
    ///
    /// # Errors
    /// If there is no such column, or its cells are no times.
    pub fn set_time<S: AsRef<str>>(&mut self, names: &[S]) -> Result<(), Error> {
        let columns: Vec<usize> = names
            .iter()
            .map(|name| self.position(name.as_ref()))
            .collect::<Result<_, _>>()?;
        self.set_time_columns(columns)
    }

    /// Takes the times of rows from the columns whose cells or names say so. Returns whether there are such columns.
    ///
    /// # Errors
    /// If the cells are no times, or may have the day or the month first.
    pub fn find_time(&mut self) -> Result<bool, Error> {
        self.find(false)
    }

    /// As [`find_time`](Self::find_time), but a column of numbers is the time only if its whole name says so: `time`, not `idle_time`.
    ///
    /// # Errors
    /// As [`find_time`](Self::find_time).
    pub fn find_certain_time(&mut self) -> Result<bool, Error> {
        self.find(true)
    }

    fn find(&mut self, is_certain: bool) -> Result<bool, Error> {
        let samples: Vec<&[String]> = self.profiles.iter().map(|profile| profile.sample.as_slice()).collect();
        match clock::guess(&self.columns, &samples, &self.dialect, is_certain) {
            Some(mut columns) => {
                if let ([date], Some(clock)) =
                    (columns.as_slice(), clock::shared_date(&self.columns, &samples, &columns))
                {
                    let names = [*date, clock].map(|i| names::quoted(&printable(&self.columns[i].name)));
                    let problem = "is a date that rows share, and another column may have the time of day";
                    let mut error = self.time_refused(&columns, samples[*date], Refused::Cell(0, (problem, "")));
                    if let Error::Cell { mend, .. } = &mut error {
                        *mend = format!(
                            "say --time-column {}, or --time-column {} for the date alone",
                            names.join(","),
                            names[0]
                        );
                    }
                    return Err(error);
                }
                if let Some(twin) = self.twin(&columns) {
                    return Err(twin);
                }
                columns.extend(parts::half_behind(&samples, &columns));
                columns.extend(parts::parts_behind(&self.columns, &samples, &columns));
                self.set_time_columns(columns).map(|()| true)
            }
            None => match parts::seconds_and_parts(&self.columns, &samples) {
                Some(columns) => self.set_time_columns(columns).map(|()| true),
                None => Ok(false),
            },
        }
    }

    /// The refusal of two tables side by side that have times of their own, which differ.
    fn twin(&self, time: &[usize]) -> Option<Error> {
        let [time] = time else { return None };
        let (own, sample) = (&self.columns[*time], &self.profiles[*time].sample);
        let increases = |cells: &[String]| {
            let numbers: Vec<f64> = cells.iter().filter_map(|cell| cell.parse().ok()).collect();
            numbers.len() == cells.len() && numbers.len() > 1 && numbers.is_sorted_by(|a, b| a < b)
        };
        let is_gap = |i: usize| self.columns[i].own_name.is_empty() && self.profiles[i].values() == 0;
        let is_twin = |i: &usize| {
            let (column, other) = (&self.columns[*i], &self.profiles[*i].sample);
            let is_named = column.own_name.eq_ignore_ascii_case(&own.own_name);
            column.kind == own.kind
                && ((is_named && !own.own_name.is_empty()) || (column.kind == Kind::Time && (*time..*i).any(is_gap)))
                && other.iter().zip(sample).any(|(a, b)| a != b)
                && (column.kind == Kind::Time || increases(other))
        };
        let twin = (time + 1..self.columns.len()).find(is_twin)?;
        let name = |i: usize| names::quoted(&printable(&self.columns[i].name));
        let problem = "is the time of one of two tables that stand side by side, and the other has other times";
        let mut error = self.time_refused(&[*time], sample, Refused::Cell(0, (problem, "")));
        if let Error::Cell { mend, .. } = &mut error {
            *mend = format!(
                "make a table of each, as: cut -d, -f1-{} FILE | fewbits ... -; or say --time-column {}, and --columns for those of that time",
                twin,
                name(*time)
            );
        }
        Some(error)
    }

    /// As [`find_time`](Self::find_time), or takes the first column if its numbers increase.
    ///
    /// # Errors
    /// As [`find_time`](Self::find_time), or if the first column is none of times.
    pub fn require_time(&mut self) -> Result<(), Error> {
        if self.find(false)? {
            return Ok(());
        }
        let sample = self.profiles.first().map_or(&[][..], |profile| &profile.sample);
        let numbers: Vec<f64> = sample.iter().filter_map(|cell| cell.parse().ok()).collect();
        let is_still = numbers.len() > 2 && numbers.iter().all(|x| *x == numbers[0]);
        if numbers.len() == sample.len() && (is_still || guess::goes_back(sample)) {
            return Err(Error::NoTime {
                column: printable(&self.columns[0].name),
            });
        }
        self.set_time_columns(vec![0])
    }

    fn set_time_columns(&mut self, columns: Vec<usize>) -> Result<(), Error> {
        #[cfg(feature = "parquet")]
        if let (Some(rows), [column]) = (&self.arrow, columns.as_slice())
            && let Some(scale) = rows.scale(*column)
        {
            let zone = self
                .dialect
                .time_zone
                .as_deref()
                .filter(|_| scale == Scale::Local)
                .and_then(crate::written::zone);
            let scale = if zone.is_some() { Scale::Utc } else { scale };
            self.dialect.time_column = vec![self.columns[*column].name.clone()];
            self.selected.retain(|other| other != column);
            let clock = Clock::new(Syntax::Number(Unit::Seconds), scale);
            self.time = Some((columns, Clock { zone, ..clock }));
            return Ok(());
        }
        let own = |i: &usize| {
            let column = &self.columns[*i];
            // A row of units states that of the times.
            match interval::of_name(&format!("t [{}]", column.unit)) {
                Some(_) if columns.len() == 1 => format!("{} [{}]", column.own_name, column.unit),
                _ => column.own_name.clone(),
            }
        };
        let own: Vec<String> = columns.iter().map(own).collect();
        let mut own: Vec<&str> = own.iter().map(String::as_str).collect();
        // Parts of a second stand behind the time that is read from the columns before them.
        let decimals = own.last().and_then(|name| parts::decimals_named(name));
        let are_parts = |decimals: &u8| {
            let cells = &self.profiles[columns[columns.len() - 1]].sample;
            columns.len() > 1
                && cells
                    .iter()
                    .all(|cell| parts::parts_of_second(cell, *decimals).is_some())
        };
        let decimals = decimals.filter(are_parts);
        let whole = &columns[..columns.len() - usize::from(decimals.is_some())];
        own.truncate(whole.len());
        let length = columns
            .iter()
            .map(|i| self.profiles[*i].sample.len())
            .min()
            .unwrap_or(0);
        let joined = |row: usize| {
            let cells: Vec<&str> = whole.iter().map(|i| self.profiles[*i].sample[row].as_str()).collect();
            parts::joined(&cells)
        };
        let sample: Vec<String> = (0..length).map(joined).collect();
        let are_hours = match whole {
            [date, hour] => parts::are_hours(&self.profiles[*date].sample, &self.profiles[*hour].sample),
            _ => None,
        };
        let found = clock::clock(&own, &sample, are_hours, &mut self.dialect);
        let mut found = found.map_err(|refused| self.time_refused(whole, &sample, refused))?;
        found.parts_behind = decimals;
        self.dialect.time_column = columns.iter().map(|i| self.columns[*i].name.clone()).collect();
        self.selected.retain(|column| !columns.contains(column));
        self.time = Some((columns, found));
        Ok(())
    }

    /// Why these columns are no time: their cells, joined, are the sample.
    fn time_refused(&self, columns: &[usize], sample: &[String], refused: Refused) -> Error {
        let (row, (problem, mend), is_order) = match refused {
            Refused::Option(error) => return error,
            Refused::Cell(row, problem) => (row, problem, false),
            Refused::Doubt(doubt) => (0, doubt.problem(), doubt.may_be_decided()),
        };
        let first_text = columns.first().and_then(|i| self.profiles[*i].first_text.as_ref());
        let first_row = Place {
            line: self.rows.line() + 1,
            row: 1,
        };
        let place = first_text.map_or(first_row, |(place, _)| *place);
        let names: Vec<String> = columns.iter().map(|i| printable(&self.columns[*i].name)).collect();
        let (column, text) = (names.join(", "), sample.get(row).map_or("", String::as_str));
        let is_split = self.columns.len() > 1 || !text.contains(|c: char| !c.is_alphanumeric() && !".-+/".contains(c));
        let mend = match is_split {
            true => mend.to_owned(),
            false => format!("name what separates cells with --delimiter; or {mend}"),
        };
        let cell = printable(text);
        if is_order {
            return Error::DayOrMonth {
                place,
                column,
                cell,
                problem,
                mend,
            };
        }
        Error::Cell {
            place,
            column,
            cell,
            problem,
            mend,
        }
    }

    /// Indices of the columns of the time, and what it is measured from.
    pub fn time(&self) -> Option<(&[usize], Scale)> {
        self.time
            .as_ref()
            .map(|(columns, clock)| (columns.as_slice(), clock.scale))
    }

    /// Whether times are those of a day, without a date, as `23:59`. Durations may be written alike.
    pub fn is_of_day(&self) -> bool {
        self.time
            .as_ref()
            .is_some_and(|(_, clock)| clock.syntax == Syntax::OfDay)
    }

    /// What the cells of a column of [`Kind::Time`](crate::Kind::Time) are measured from.
    pub fn scale(&self, column: usize) -> Option<Scale> {
        #[cfg(feature = "parquet")]
        if let Some(rows) = &self.arrow {
            return (column < self.columns.len()).then(|| rows.scale(column)).flatten();
        }
        self.clocks.get(column)?.as_ref().map(|clock| clock.scale)
    }

    /// The name of the only column of the time, without the unit if times are seconds that the column has in another unit: what a column of
    /// these seconds may be called. `None` if several columns give the time, or none.
    pub fn time_name(&self) -> Option<&str> {
        let (columns, clock) = self.time.as_ref()?;
        let [only] = columns.as_slice() else { return None };
        let name = self.columns.get(*only)?.name.as_str();
        match interval::of_name(name).filter(|(unit, _)| *unit != "s" && clock.scale == Scale::Seconds) {
            Some((_, "")) => Some("time"),
            Some((_, rest)) => Some(rest),
            None => Some(name),
        }
    }

    /// Lets times be off by so much: decimals beyond the 18th are cut if it is not 0, and a leap second becomes the next second if it is a
    /// second or more.
    pub fn allow_inexact_times(&mut self, nanoseconds: u64) {
        if let Some((_, clock)) = &mut self.time {
            clock.takes_leap_seconds = nanoseconds >= 1_000_000_000;
            clock.cuts = nanoseconds > 0;
        }
    }
}
