//! `fewbits look`: how a table is understood, before anything is done with it.

use crate::arguments::LookOptions;
use crate::error::Error;
use crate::input;
use crate::numbers::exact;
use crate::{Ending, output, say};
use fewbits_table::{Column, Dialect, Kind, Profile, Scale, Survey, Time};
use serde::Serialize;
use std::fmt::Write;

/// Words of a column that are shown.
const SHOWN: usize = 8;

#[derive(Serialize)]
struct Look<'a> {
    format: Option<&'a str>,
    options: String,
    rows: u64,
    time: Option<LookTime<'a>>,
    columns: Vec<LookColumn<'a>>,
    lines_left_out: u64,
    faults: &'a [String],
    repeated_lines: u64,
    blank_rows: u64,
}

#[derive(Serialize)]
struct LookTime<'a> {
    columns: &'a [String],
    scale: Scale,
    from: Option<String>,
    to: Option<String>,
    decimals: u8,
    smallest_step: Option<f64>,
    largest_step: Option<f64>,
    backward: u64,
    repeated: u64,
}

#[derive(Serialize)]
struct LookColumn<'a> {
    name: &'a str,
    own_name: &'a str,
    unit: &'a str,
    kind: Kind,
    values: u64,
    gaps: u64,
    /// Spellings of gaps that are not empty cells.
    gap_spellings: Vec<&'a str>,
    min: Option<f64>,
    max: Option<f64>,
    decimals: u8,
    words: Vec<&'a str>,
    suspicious: u64,
    first_suspicious: Option<String>,
    /// A value that few cells have and that makes most of the range.
    sentinel: Option<f64>,
    sentinel_cells: u64,
}

/// Runs the task.
pub(crate) fn run(options: &LookOptions) -> Result<Ending, Error> {
    let mut table_options = options.table.clone();
    // All faults are shown, none stops.
    table_options.dialect.skip_bad = u64::MAX;
    let (columns, mut dialect, scale, survey) = input::look(&table_options)?;
    dialect.skip_bad = options.table.dialect.skip_bad;
    if options.toml {
        return output::print(&dialect.to_toml()).map(|()| Ending::Good);
    }
    let look = look(&columns, &dialect, scale, &survey);
    if options.json {
        output::json(&look)?;
    } else {
        output::print(&text(&look))?;
    }
    Ok(Ending::Good)
}

fn look<'a>(columns: &'a [Column], dialect: &'a Dialect, scale: Option<Scale>, survey: &'a Survey) -> Look<'a> {
    let times = &survey.times;
    let time = scale.map(|scale| {
        let shown = |time: Time| time.shown(scale, times.decimals);
        LookTime {
            columns: &dialect.time_column,
            scale,
            from: times.ends.map(|ends| shown(ends.0)),
            to: times.ends.map(|ends| shown(ends.1)),
            decimals: times.decimals,
            smallest_step: times.steps.map(|steps| steps.0),
            largest_step: times.steps.map(|steps| steps.1),
            backward: times.backward,
            repeated: times.repeated,
        }
    });
    Look {
        format: dialect.format.as_deref(),
        options: dialect.as_options(),
        rows: survey.rows,
        time,
        columns: columns
            .iter()
            .zip(&survey.columns)
            .map(|(column, profile)| look_column(column, profile))
            .collect(),
        lines_left_out: survey.skipped.bad,
        faults: &survey.skipped.faults,
        repeated_lines: survey.skipped.repeated,
        blank_rows: survey.skipped.blank,
    }
}

fn look_column<'a>(column: &'a Column, profile: &'a Profile) -> LookColumn<'a> {
    let suspicious = profile.suspicious();
    let first = profile.first_text.as_ref().filter(|_| suspicious > 0);
    let sentinel = profile.sentinel();
    let words = match column.kind {
        Kind::Words | Kind::Boolean => profile.words.keys().map(String::as_str).collect(),
        _ => Vec::new(),
    };
    LookColumn {
        name: &column.name,
        own_name: &column.own_name,
        unit: &column.unit,
        kind: column.kind,
        values: profile.values(),
        gaps: profile.gaps(),
        gap_spellings: profile
            .missing
            .keys()
            .map(String::as_str)
            .filter(|word| !word.is_empty())
            .collect(),
        min: profile.range.map(|range| range.0),
        max: profile.range.map(|range| range.1),
        decimals: profile.decimals,
        words,
        suspicious,
        first_suspicious: first.map(|(place, cell)| format!("{place}: `{}`", fewbits_table::printable(cell))),
        sentinel: sentinel.map(|sentinel| sentinel.value),
        sentinel_cells: sentinel.map_or(0, |sentinel| sentinel.count),
    }
}

/// What was understood, for people. Writing to a string cannot fail.
fn text(look: &Look<'_>) -> String {
    let mut text = String::new();
    let format = look.format.map(|format| format!("{format}; ")).unwrap_or_default();
    let _ = writeln!(text, "{} rows; {format}read as {}", look.rows, look.options);
    match &look.time {
        None => text += "time: none\n",
        Some(time) => {
            let what = match time.scale {
                Scale::Utc => "UTC",
                Scale::Local => "local time, its zone is not known (--time-zone says it)",
                _ => "seconds",
            };
            let names = say::name(&time.columns.join(", ")).into_owned();
            let (from, to) = (time.from.as_deref().unwrap_or("-"), time.to.as_deref().unwrap_or("-"));
            let _ = writeln!(text, "time: {names}; {what}; {from} to {to}, {} decimals", time.decimals);
            if let (Some(low), Some(high)) = (time.smallest_step, time.largest_step) {
                let _ = writeln!(text, "  steps of {} to {} s", exact(low), exact(high));
            }
            if time.backward > 0 || time.repeated > 0 {
                let _ = writeln!(
                    text,
                    "  {} rows are before the row above, {} at the same time",
                    time.backward, time.repeated
                );
            }
        }
    }
    for column in &look.columns {
        let unit = if column.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", say::name(column.unit))
        };
        let name = say::name(column.name);
        let _ = write!(text, "{name}{unit}: {}", column.kind);
        match (column.min, column.max, column.kind) {
            (Some(min), Some(max), Kind::Number | Kind::Integer) => {
                let _ = write!(text, ", {} to {}", exact(min), exact(max));
            }
            _ if !column.words.is_empty() => {
                let words: Vec<String> = column
                    .words
                    .iter()
                    .take(SHOWN)
                    .map(|word| say::name(word).into_owned())
                    .collect();
                let more = if column.words.len() > SHOWN { ", ..." } else { "" };
                let _ = write!(text, " ({}{more})", words.join(", "));
            }
            _ => {}
        }
        if column.gaps > 0 {
            let _ = write!(text, ", {} gaps", column.gaps);
            if !column.gap_spellings.is_empty() {
                let _ = write!(text, " (also as {})", say::name(&column.gap_spellings.join(", ")));
            }
        }
        if column.own_name != column.name {
            let _ = write!(text, "; named `{}` in the file", say::name(column.own_name));
        }
        text.push('\n');
        if let Some(first) = &column.first_suspicious {
            let _ = writeln!(
                text,
                "  suspicious: {} cells that are no {}, first at {first}",
                column.suspicious, column.kind
            );
        }
        if let Some(value) = column.sentinel {
            let _ = writeln!(
                text,
                "  suspicious: {} in {} cells makes most of the range; if it means a gap, say --missing '{name}={}'",
                exact(value),
                column.sentinel_cells,
                exact(value)
            );
        }
    }
    if look.lines_left_out > 0 {
        let _ = writeln!(text, "{} lines cannot be read (--skip-bad {0} leaves them out):", look.lines_left_out);
        for fault in look.faults {
            let _ = writeln!(text, "  {}", say::name(fault));
        }
    }
    for (count, what) in [
        (look.repeated_lines, "lines repeat the names or lines around them"),
        (look.blank_rows, "rows have no cell"),
    ] {
        if count > 0 {
            let _ = writeln!(text, "{count} {what}: they are left out");
        }
    }
    text
}
