//! A table, read into memory as `fewbits pack` reads it: the same times, the same cells, the same refusals.

use crate::known::{Found, FoundTime, Known, ROWS, Rows};
use crate::writing::words_of;
use crate::{recording, text};
use bytes::Bytes;
use fewbits_recipes::Batch;
use fewbits_record::{TimeBase, TimeFormat};
use fewbits_table::{Column, Dialect, Error, Kind, Profile, Scale, Survey, Table, Time};
use serde::Deserialize;
use std::io::Cursor;

/// The first bytes of a Parquet file, and of a recording.
const PARQUET: &[u8] = b"PAR1";
const RECORDING: &[u8] = b"\x8bfew";
/// Decimals of a second that the finest tick has where times may be off.
const NANOSECONDS: u8 = 9;
/// Largest length of a unit, in which words are listed.
const MAX_UNIT: usize = 1024;

/// What the user says of a table; the rest is detected.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Said {
    pub(crate) dialect: Dialect,
    /// Columns that are left out.
    pub(crate) without: Vec<String>,
    /// How far times may be off, in nanoseconds.
    pub(crate) tolerance: u64,
    /// Whether rows are numbered although the table has times.
    pub(crate) numbered: bool,
}

/// Reads bytes of any of the known kinds.
pub(crate) fn read(bytes: Vec<u8>, said: &Said) -> Result<Rows, String> {
    let bytes = Bytes::from(bytes);
    if bytes.starts_with(RECORDING) {
        return recording::read(bytes);
    }
    if bytes.starts_with(PARQUET) {
        return Err("a Parquet file, which this page does not read: save the table as CSV, or use the command `fewbits` built with the \
                    feature `parquet`"
            .to_owned());
    }
    let mut left_out = Vec::new();
    if said.numbered {
        // A column of times is no column of numbers.
        let table = with_time(&bytes, said).map_err(text)?;
        let names = table
            .time()
            .map(|(columns, _)| columns.iter().map(|i| table.columns()[*i].name.clone()));
        left_out.extend(names.into_iter().flatten().map(|name| (name, "the time".to_owned())));
    }
    let open = || match said.numbered {
        true => opened(
            &bytes,
            &Dialect {
                time_column: Vec::new(),
                ..said.dialect.clone()
            },
        ),
        false => with_time(&bytes, said),
    };
    let survey = open().and_then(Table::survey).map_err(text)?;
    let unfit = open().map(|mut table| {
        table.use_survey(&survey);
        unfit(&table)
    });
    left_out.extend(unfit.map_err(text)?);
    left_out.retain(|(name, _)| !said.without.contains(name));
    let mut table = open().map_err(text)?;
    let out = said.without.iter().chain(left_out.iter().map(|(name, _)| name));
    table.leave_out(&out.collect::<Vec<_>>()).map_err(text)?;
    if !table.is_plain() {
        table.use_survey(&survey);
    }
    of_table(table, &survey, said, left_out).map_err(text)
}

fn opened(bytes: &Bytes, dialect: &Dialect) -> Result<Table, Error> {
    Table::open(Cursor::new(bytes.clone()), dialect)
}

/// A table with the time that the user said, or that it certainly has.
fn with_time(bytes: &Bytes, said: &Said) -> Result<Table, Error> {
    let mut table = opened(bytes, &said.dialect)?;
    if table.time().is_none() {
        table.find_certain_time()?;
    }
    table.allow_inexact_times(said.tolerance);
    Ok(table)
}

/// Selected columns that no recording can hold, and why.
fn unfit(table: &Table) -> Vec<(String, String)> {
    let why = |i: &usize| {
        let column = &table.columns()[*i];
        let why = match column.kind {
            Kind::Text => "text",
            Kind::Words if unit_of(table, *i).is_empty() => "too many different words",
            _ => return None,
        };
        Some((column.name.clone(), why.to_owned()))
    };
    table.selected().iter().filter_map(why).collect()
}

/// The unit of a column, or the list of its words.
fn unit_of(table: &Table, column: usize) -> String {
    match table.columns()[column].kind {
        Kind::Words => {
            let quoted = table
                .words(column)
                .iter()
                .map(|word| format!("\"{}\"", word.replace('"', "\"\"")));
            let unit = format!("words: {}", quoted.collect::<Vec<_>>().join(","));
            if table.words(column).is_empty() || unit.len() > MAX_UNIT {
                String::new()
            } else {
                unit
            }
        }
        Kind::Time => "s since 1970".to_owned(),
        _ => table.columns()[column].unit.clone(),
    }
}

fn refused(
    table: &Table,
    column: usize,
    place: fewbits_table::Batch,
    row: usize,
    cell: String,
    (problem, mend): (&'static str, &str),
) -> Error {
    Error::Cell {
        place: place.places[row],
        column: table.columns()[column].name.clone(),
        cell,
        problem,
        mend: mend.to_owned(),
    }
}

fn of_table(mut table: Table, survey: &Survey, said: &Said, left_out: Vec<(String, String)>) -> Result<Rows, Error> {
    let selected = table.selected().to_vec();
    let units: Vec<String> = selected.iter().map(|i| unit_of(&table, *i)).collect();
    for (column, unit) in selected.iter().zip(&units) {
        if let Some(words) = words_of(unit) {
            table.fix_words(*column, words);
        }
    }
    let time = time_base(&table, survey, said);
    let mut rows = Batch {
        ticks: (time != TimeBase::Numbered).then(Vec::new),
        columns: vec![Vec::new(); selected.len()],
    };
    let mut batch = fewbits_table::Batch::default();
    while table.read(&mut batch, ROWS)? > 0 {
        if let (
            Some(ticks),
            TimeBase::Clock {
                decimals, tolerance, ..
            },
        ) = (&mut rows.ticks, time)
        {
            for (row, found) in batch.times.iter().enumerate() {
                let wrong = match found.ticks(decimals) {
                    Some((tick, is_whole)) if is_whole || tolerance > 0 => {
                        ticks.push(tick);
                        continue;
                    }
                    Some(_) => (
                        "has more decimals than a tick",
                        "allow an error of times, as --time ±1us, or write fewer decimals",
                    ),
                    None => (
                        "does not fit ticks of 64 bits: it is too large, or times have too many decimals",
                        "allow an error of times, as --time ±1us",
                    ),
                };
                let (columns, scale) = table.time().unwrap_or((&[0], Scale::Seconds));
                let (column, cell) = (columns[0], found.shown(scale, found.decimals()));
                return Err(refused(&table, column, batch, row, cell, wrong));
            }
        }
        for (i, column) in selected.iter().enumerate() {
            rows.columns[i].reserve(batch.rows);
            for row in 0..batch.rows {
                match batch.columns[i].number(row) {
                    Ok(cell) => rows.columns[i].push(cell),
                    Err(cell) => {
                        let problem = match table.columns()[*column].kind {
                            Kind::Time => "is a time, and its seconds are no double",
                            _ => "is a whole number of more than 53 bits, which no double holds",
                        };
                        let wrong = (problem, "leave the column out with --without");
                        return Err(refused(&table, *column, batch, row, cell, wrong));
                    }
                }
            }
        }
    }
    let known = selected.iter().zip(units).zip(&rows.columns).map(|((i, unit), cells)| {
        let (column, profile) = (&table.columns()[*i], &survey.columns[*i]);
        known(column, unit, profile, cells)
    });
    Ok(Rows {
        columns: known.collect(),
        time,
        found: found(&table, survey, said, left_out),
        batch: rows,
    })
}

fn known(column: &Column, unit: String, profile: &Profile, cells: &[Option<f64>]) -> Known {
    let sentinel = profile
        .sentinel()
        .filter(|_| matches!(column.kind, Kind::Number | Kind::Integer));
    let samples = cells.iter().flatten().count();
    Known {
        name: column.name.clone(),
        words: words_of(&unit),
        unit,
        kind: match column.kind {
            Kind::Number => "number",
            Kind::Integer => "integer",
            Kind::Boolean => "boolean",
            Kind::Words => "words",
            Kind::Time => "time",
            _ => "text",
        },
        samples,
        gaps: cells.len() - samples,
        min: profile.range.map(|range| range.0),
        max: profile.range.map(|range| range.1),
        sentinel: sentinel.map(|sentinel| sentinel.value),
        sentinel_cells: sentinel.map_or(0, |sentinel| sentinel.count),
        period: None,
    }
}

/// The time base of `fewbits pack --time`: ticks as fine as the finest time of the table, or as 64 bits allow.
fn time_base(table: &Table, survey: &Survey, said: &Said) -> TimeBase {
    let Some((_, scale)) = table.time() else {
        return TimeBase::Numbered;
    };
    let format = match scale {
        Scale::Utc => TimeFormat::Utc,
        Scale::Local => TimeFormat::Local,
        _ => TimeFormat::Seconds,
    };
    let decimals = match (format, said.tolerance) {
        (TimeFormat::Seconds, 0) => survey.times.decimals.min(18),
        (_, 0) => survey.times.decimals.next_multiple_of(3).min(18),
        _ => {
            let first = survey.times.ends.map(|ends| ends.0);
            let is_small = |tick: i64| tick.abs() < i64::MAX / 4;
            let fits = |decimals: &u8| {
                first.is_none_or(|first: Time| first.ticks(*decimals).is_some_and(|(tick, _)| is_small(tick)))
            };
            (0..=NANOSECONDS).rev().find(fits).unwrap_or(0)
        }
    };
    TimeBase::Clock {
        decimals,
        // One tick of the tolerance is reserved for decimals beyond a tick, which are cut off.
        tolerance: (said.tolerance / 10_u64.pow(u32::from(NANOSECONDS.saturating_sub(decimals)))).saturating_sub(1),
        format,
    }
}

fn found(table: &Table, survey: &Survey, said: &Said, left_out: Vec<(String, String)>) -> Found {
    let time = table.time().map(|(columns, scale)| {
        let shown = |time: Time| time.shown(scale, survey.times.decimals);
        let ends = survey.times.ends.map(|(from, to)| (shown(from), shown(to)));
        let (from, to) = ends.unwrap_or_default();
        FoundTime {
            columns: columns.iter().map(|i| table.columns()[*i].name.clone()).collect(),
            scale: match scale {
                Scale::Utc => "UTC",
                Scale::Local => "local time of an unknown zone",
                _ => "seconds",
            },
            from,
            to,
        }
    });
    let skipped = &survey.skipped;
    let mut lines: Vec<String> = skipped.faults.clone();
    for (count, what) in [
        (skipped.repeated, "lines that repeat the names or the lines around them"),
        (skipped.blank, "rows without a cell"),
    ] {
        if count > 0 {
            lines.push(format!("{count} {what}"));
        }
    }
    Found {
        format: table.dialect().format.clone().unwrap_or_default(),
        dialect: table.dialect().as_options(),
        options: said.dialect.as_options(),
        time,
        left_out,
        skipped: lines,
    }
}
