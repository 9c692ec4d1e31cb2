//! A table, read into memory as `fewbits pack` reads it: the same times, the same cells, the same refusals.

use crate::known::{Found, FoundTime, Known, ROWS, Rows};
use crate::writing::words_of;
use crate::{recording, text};
use bytes::Bytes;
use fewbits_recipes::{Batch, table as recipe, times};
use fewbits_record::TimeBase;
use fewbits_table::{Column, Dialect, Error, Kind, Profile, Scale, Survey, Table, Time};
use serde::Deserialize;
use std::io::Cursor;

/// The first bytes of a Parquet file, and of a recording.
const PARQUET: &[u8] = b"PAR1";
const RECORDING: &[u8] = b"\x8bfew";

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
            Kind::Integer => "whole numbers of more than 53 bits",
            Kind::Words if recipe::unit(table, *i).is_empty() => "too many different words",
            _ => return None,
        };
        Some((column.name.clone(), why.to_owned()))
    };
    table.selected().iter().filter_map(why).collect()
}

fn of_table(mut table: Table, survey: &Survey, said: &Said, left_out: Vec<(String, String)>) -> Result<Rows, Error> {
    let selected = table.selected().to_vec();
    let units: Vec<String> = selected.iter().map(|i| recipe::unit(&table, *i)).collect();
    for (column, unit) in selected.iter().zip(&units) {
        if let Some(words) = words_of(unit) {
            table.fix_words(*column, words);
        }
    }
    let time = match table.time() {
        Some((_, scale)) => {
            let first = survey.times.ends.map(|ends| ends.0);
            times::base(scale, first, Some(survey.times.decimals), said.tolerance)
        }
        None => TimeBase::Numbered,
    };
    let mut rows = Batch {
        ticks: (time != TimeBase::Numbered).then(Vec::new),
        columns: vec![Vec::new(); selected.len()],
    };
    let mut source = recipe::TableRows::new(table, time);
    while let Some(batch) = source.take(ROWS)? {
        if let (Some(all), Some(ticks)) = (&mut rows.ticks, batch.ticks) {
            all.extend(ticks);
        }
        for (all, cells) in rows.columns.iter_mut().zip(batch.columns) {
            all.extend(cells);
        }
    }
    let table = source.table();
    let known = selected.iter().zip(units).zip(&rows.columns).map(|((i, unit), cells)| {
        let (column, profile) = (&table.columns()[*i], &survey.columns[*i]);
        known(column, unit, profile, cells)
    });
    let columns: Vec<Known> = known.collect();
    let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
    Ok(Rows {
        columns,
        time,
        time_name: times::name(table, &names),
        found: found(table, survey, said, left_out),
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
