//! `fewbits verify`: checks a recording against its table and error bounds.

use crate::arguments::{TableOptions, VerifyOptions};
use crate::continuing::{check_clock, own_tolerance};
use crate::error::Error;
use crate::files::is_regular;
use crate::input::Table;
use crate::opening::day_order;
use crate::rows::TableRows;
use crate::{Ending, clock, numbers, output, recording, say};
use fewbits_recipes::names;
use fewbits_recipes::unpack::shown as shown_cell;
use fewbits_recipes::verify::{CellFailure, Verdict, verify as recipe, verify_by_time};
use fewbits_record::{Schema, TimeBase};
use serde::Serialize;
use std::fmt::Write;
use std::ops::ControlFlow;

/// The verdict with failures as text.
#[derive(Serialize)]
struct Shown<'a> {
    rows: u64,
    times_checked: bool,
    ticks_failed: u64,
    missing_rows: u64,
    extra_rows: u64,
    /// Whether rows with the same time were compared, and not those with the same number.
    by_time: bool,
    damage: Option<&'a str>,
    /// Whether the recording has its end.
    finished: bool,
    holds: bool,
    columns: Vec<ShownColumn<'a>>,
    not_compared: &'a [String],
    #[serde(skip)]
    has_time: bool,
}

#[derive(Serialize)]
struct ShownColumn<'a> {
    name: &'a str,
    bound: &'a str,
    largest_error: f64,
    mean_error: f64,
    failed: u64,
    first_failures: Vec<String>,
}

/// Names by which a column of times is known.
const TIME_NAMES: [&str; 6] = ["time", "timestamp", "datetime", "date", "seconds", "t"];

/// Index among all names of a table of the likeliest column of times of those that the recording has not.
fn time_column(all: &[String], schema: &Schema) -> Option<usize> {
    if schema.time() == TimeBase::Numbered {
        return None;
    }
    // A name that stands once more in the table than in the recording is left over too.
    let of_recording = |name: &str| schema.columns().iter().filter(|column| column.name() == name).count();
    let of_table = |name: &str| all.iter().filter(|known| *known == name).count();
    let left_over: Vec<usize> = (0..all.len())
        .filter(|i| of_table(&all[*i]) > of_recording(&all[*i]))
        .collect();
    let is_time = |i: &&usize| TIME_NAMES.contains(&all[**i].to_lowercase().as_str());
    let likeliest = left_over.iter().find(is_time).or(left_over.first());
    likeliest.copied()
}

/// Chooses the columns of the table that the recording has, by name. Returns the index in the recording of each.
fn matched(table: &mut Table, options: &TableOptions, schema: &Schema) -> Result<Vec<usize>, Error> {
    let (all, file) = (table.names.clone(), table.file().to_owned());
    let time = time_column(&all, schema);
    // Of a long table, some names are those of its own columns.
    let is_own = |name: &&str| options.by.is_none() || schema.position(name).is_ok();
    // A name by number, as `#3`, is that of the table's column.
    let own = |name: &str| match all.iter().any(|known| known == name) {
        true => name.to_owned(),
        false => fewbits_table::names::numbered(name)
            .and_then(|index| all.get(index).cloned())
            .unwrap_or_else(|| name.to_owned()),
    };
    let of_table = |names: &[String]| names.iter().map(|name| own(name)).collect::<Vec<_>>();
    let (asked, left_out) = (of_table(&options.columns), of_table(&options.without()));
    let asked: Vec<&str> = asked.iter().map(String::as_str).filter(is_own).collect();
    let (mut columns, mut matches) = (Vec::new(), Vec::new());
    for (index, column) in schema.columns().iter().enumerate() {
        let name = column.name();
        let is_asked = asked.is_empty() || asked.contains(&name);
        if !is_asked || left_out.iter().any(|out| out == name) {
            continue;
        }
        let found = (0..all.len()).find(|i| all[*i] == name && Some(*i) != time && !columns.contains(i));
        let Some(found) = found else {
            return Err(Error::no_column(&file, name, &all));
        };
        columns.push(found);
        matches.push(index);
    }
    if let Some(name) = asked.iter().find(|name| schema.position(name).is_err()) {
        let names: Vec<&str> = schema.columns().iter().map(fewbits_record::Column::name).collect();
        let problem = format!("--columns: the recording has no column `{name}`, there are {}", names::shown(&names));
        return Err(Error::content(&file, problem));
    }
    // A wide table begins with its time.
    let list = options
        .by
        .as_ref()
        .map_or(options.time_column.as_deref(), |_| Some("#1"));
    table.choose(list, time, &columns, schema.time())?;
    if options.by.is_none() {
        table.learn_with_time(options, Some(own_tolerance(schema.time())))?;
    }
    let recorded: Vec<&fewbits_record::Column> = matches.iter().map(|index| &schema.columns()[*index]).collect();
    table.use_words(&recorded)?;
    Ok(matches)
}

/// The table with the columns that the recording has, and the index there of each.
fn opened(options: &TableOptions, schema: &Schema) -> Result<(Table, Vec<usize>), Error> {
    let mut table = Table::open(&match options.by {
        // Columns of the long table are chosen here.
        Some(_) => TableOptions {
            time: None,
            ..options.clone()
        },
        // Columns are chosen by the recording's.
        None => TableOptions {
            time: None,
            time_column: None,
            columns: Vec::new(),
            without: None,
            ..options.clone()
        },
    })?;
    let matches = matched(&mut table, options, schema)?;
    Ok((table, matches))
}

/// Runs the task.
pub(crate) fn run(options: &VerifyOptions) -> Result<Ending, Error> {
    let file = options.packed.display().to_string();
    let mut playback = recording::open(&options.packed)?;
    let schema = playback.schema().clone();
    let again = || match opened(&options.table, &schema) {
        Err(Error::Refusal { file, source }) if source.is_day_or_month() => match day_order(&options.table)? {
            Some(said) => opened(&said, &schema),
            None => Err(Error::Refusal { file, source }),
        },
        other => other,
    };
    let (mut table, matches) = again()?;
    let begin = playback.ticks().map_err(Error::recording(&file))?.map(|ticks| ticks.0);
    let mend = "name the table that the recording was made of, with the options of pack";
    check_clock(&mut table, schema.time(), begin, &file, mend)?;
    let mut rows = TableRows::new(table, schema.time());
    let mut go = |_| ControlFlow::Continue(());
    let mut verdict = recipe(&mut playback, &mut rows, &matches, &mut go).map_err(Error::recipe(&file))?;
    // Behind a lost row, the rows of one number are those of different times.
    let has_lost = verdict.missing_rows > 0 || verdict.extra_rows > 0 || verdict.damage.is_some();
    let mut by_time = false;
    if has_lost && verdict.times_checked && is_regular(&options.table.file) {
        let (table, matches) = again()?;
        let mut rows = TableRows::new(table, schema.time());
        let found = verify_by_time(&mut playback, &mut rows, &matches, &mut go).map_err(Error::recipe(&file))?;
        by_time = found.is_some();
        verdict = found.unwrap_or(verdict);
    }
    let verdict = shown(&verdict, &schema, playback.is_finished(), by_time);
    if options.json {
        output::json(&verdict)?;
    } else {
        output::print(&text(&verdict))?;
    }
    Ok(if verdict.holds { Ending::Good } else { Ending::Failed })
}

fn failure(failure: &CellFailure, schema: &Schema, name: &str) -> String {
    let column = schema.position(name).map(|i| &schema.columns()[i]);
    let told = |cell: Option<f64>| match (cell, &column) {
        (None, _) => "a gap".to_owned(),
        (Some(value), Ok(column)) => shown_cell(column, value),
        (Some(value), Err(_)) => value.to_string(),
    };
    let (sample, restored) = (told(failure.sample), told(failure.restored));
    format!(
        "row {} (tick {}): {sample} was restored as {restored}",
        failure.row,
        clock::shown(failure.tick, schema.time())
    )
}

fn shown<'a>(verdict: &'a Verdict, schema: &Schema, finished: bool, by_time: bool) -> Shown<'a> {
    let columns = verdict.columns.iter().map(|column| ShownColumn {
        name: &column.name,
        bound: &column.bound,
        largest_error: column.largest_error,
        mean_error: column.mean_error,
        failed: column.failed,
        first_failures: column
            .first_failures
            .iter()
            .map(|one| failure(one, schema, &column.name))
            .collect(),
    });
    Shown {
        rows: verdict.rows,
        times_checked: verdict.times_checked,
        ticks_failed: verdict.ticks_failed,
        missing_rows: verdict.missing_rows,
        extra_rows: verdict.extra_rows,
        by_time,
        damage: verdict.damage.as_deref(),
        finished,
        holds: verdict.holds,
        columns: columns.collect(),
        not_compared: &verdict.not_compared,
        has_time: schema.time() != TimeBase::Numbered,
    }
}

/// The verdict for people. Writing to a string cannot fail.
fn text(verdict: &Shown<'_>) -> String {
    let mut text = String::new();
    for column in &verdict.columns {
        let state = match column.failed {
            0 => "holds".to_owned(),
            failed => format!("FAILS in {failed} rows"),
        };
        let (largest, mean) = (numbers::short(column.largest_error), numbers::short(column.mean_error));
        let (name, bound) = (say::name(column.name), column.bound);
        let _ = writeln!(text, "{name}: {bound} {state}, largest error {largest}, mean {mean}");
        for failure in &column.first_failures {
            let _ = writeln!(text, "  {failure}");
        }
        if column
            .first_failures
            .iter()
            .any(|failure| failure.ends_with("restored as a gap"))
        {
            let _ = writeln!(text, "  if such cells mean gaps, name them with --missing, as for pack");
        }
    }
    if verdict.ticks_failed > 0 {
        let _ = writeln!(text, "time: FAILS in {} rows", verdict.ticks_failed);
    }
    if verdict.has_time && !verdict.times_checked {
        let _ = writeln!(text, "time: not compared, name the table's column with --time-column");
    }
    if let Some(damage) = verdict.damage {
        let behind = if verdict.by_time {
            ""
        } else {
            "; nothing was compared behind them"
        };
        let _ = writeln!(text, "{damage}{behind}");
    }
    if verdict.by_time {
        let _ = writeln!(text, "rows with the same time were compared, as rows are missing");
    }
    if verdict.missing_rows > 0 {
        let end = if verdict.by_time { "" } else { " at the end" };
        let _ = writeln!(text, "{} rows are missing{end}", verdict.missing_rows);
    }
    if verdict.extra_rows > 0 {
        let _ = match verdict.by_time {
            true => writeln!(text, "{} rows of the recording are not in the table", verdict.extra_rows),
            false => writeln!(text, "the recording has more rows than the table, at least {}", verdict.extra_rows),
        };
    }
    if !verdict.not_compared.is_empty() {
        let _ = writeln!(text, "not compared: {}", say::name(&names::shown(verdict.not_compared)));
    }
    let all = match verdict.not_compared.is_empty() {
        true => "all promises hold".to_owned(),
        false => format!("the promises of {} columns hold", verdict.columns.len()),
    };
    let is_kept = verdict.ticks_failed == 0 && verdict.columns.iter().all(|column| column.failed == 0);
    let all = match (verdict.holds, verdict.by_time && is_kept) {
        (true, _) => &all,
        (false, true) => "their promises hold, others are missing",
        (false, false) => "promises FAIL",
    };
    let _ = writeln!(text, "{} rows: {all}", verdict.rows);
    text
}
