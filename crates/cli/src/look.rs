//! `fewbits look`: how a table is understood, before anything is done with it.

use crate::arguments::LookOptions;
use crate::error::Error;
use crate::numbers::exact;
use crate::{Ending, opening, output, say};
use fewbits_recipes::look::{Look, Number, look};
use fewbits_table::{Kind, Scale, names};
use std::fmt::Write;
use std::ops::ControlFlow;

/// Words of a column that are shown.
const SHOWN: usize = 8;

/// Runs the task.
pub(crate) fn run(options: &LookOptions) -> Result<Ending, Error> {
    let mut table_options = options.table.clone();
    // All faults are shown, none stops.
    table_options.dialect.skip_bad = u64::MAX;
    let table = opening::with_time(&table_options)?;
    let mut dialect = table.dialect().clone();
    dialect.skip_bad = options.table.dialect.skip_bad;
    if options.toml {
        return output::print(&dialect.to_toml()).map(|()| Ending::Good);
    }
    let mut go = |_| ControlFlow::Continue(());
    let mut look = look(table, &mut go).map_err(Error::recipe(opening::name_of(&options.table)))?;
    look.options = dialect.as_options();
    if let Some(by) = &options.table.by {
        look.options += &format!(" --by '{by}'");
    }
    if options.json {
        output::json(&look)?;
    } else {
        output::print(&text(&look))?;
    }
    Ok(Ending::Good)
}

fn number(number: Number) -> String {
    match number {
        Number::Whole(whole) => whole.to_string(),
        Number::Double(number) => exact(number),
    }
}

/// The word for a unit of times.
fn unit_named(format: &str) -> Option<&'static str> {
    Some(match format {
        "s" => "seconds",
        "ms" => "milliseconds",
        "us" => "microseconds",
        "ns" => "nanoseconds",
        "min" => "minutes",
        "h" => "hours",
        "d" => "days",
        _ => return None,
    })
}

/// What was understood, for people. Writing to a string cannot fail.
fn text(look: &Look) -> String {
    let mut text = String::new();
    let format = look
        .format
        .as_ref()
        .map(|format| format!("{format}; "))
        .unwrap_or_default();
    let _ = writeln!(text, "{} rows; {format}read as {}", look.rows, look.options);
    match &look.time {
        None => text += "time: none\n",
        Some(time) => {
            let what = match time.scale {
                Scale::Utc => "UTC",
                Scale::Local => "local time, its zone is not known (--time-zone says it)",
                _ => "seconds",
            };
            let what = match time.format.as_deref().and_then(unit_named) {
                Some(unit) => format!("{what}, from numbers of {unit}"),
                None => what.to_owned(),
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
            format!(" [{}]", say::name(&column.unit))
        };
        let name = say::name(&column.name);
        let _ = write!(text, "{name}{unit}: {}", column.kind);
        match (column.min, column.max, column.kind) {
            (Some(min), Some(max), Kind::Number | Kind::Integer) => {
                let _ = write!(text, ", {} to {}", number(min), number(max));
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
                if column.kind == Kind::Words && fewbits_recipes::words::unit(&column.words).is_empty() {
                    let _ = write!(text, "; too long for a recording, say --without {}", names::as_argument([&name]));
                }
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
            let _ = write!(text, "; named `{}` in the file", say::name(&column.own_name));
        }
        text.push('\n');
        if let Some(first) = &column.first_suspicious {
            let _ = writeln!(
                text,
                "  suspicious: {} cells that are no {}, first at {first}",
                column.suspicious, column.kind
            );
            if column.suspicious == column.values {
                let _ =
                    writeln!(text, "  all of its cells: if it is text, say --without {}", names::as_argument([&name]));
            }
        }
        if let Some(cell) = &column.lost_zeros {
            let _ = writeln!(
                text,
                "  `{cell}` is taken for a number, without its zeros in front: --words {} keeps up to 256 different texts",
                names::as_argument([&name])
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
    if let Some(options) = &look.long {
        let _ =
            writeln!(text, "each row may be one reading of a sensor: {} makes a column of each", say::name(options));
    }
    if look.lines_left_out > 0 {
        let _ = writeln!(text, "{} lines cannot be read (--skip-bad {0} leaves them out):", look.lines_left_out);
        for fault in &look.faults {
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
