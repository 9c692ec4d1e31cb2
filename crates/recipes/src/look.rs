//! How a table is understood: dialect, columns, kinds, units, times, gaps, ranges, and what looks wrong.

use crate::error::Error;
use crate::source::{Watch, report};
use fewbits_table::{Column, Kind, Profile, Scale, Survey, Table, Time, printable};
use serde::Serialize;

/// What was understood of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Look {
    /// Name of a format that was recognised.
    pub format: Option<String>,
    /// The options of the command line that say how the table is written.
    pub options: String,
    /// Number of rows.
    pub rows: u64,
    /// The times of rows, if the table has any.
    pub time: Option<LookTime>,
    /// All columns, those of the time too.
    pub columns: Vec<LookColumn>,
    /// The options that make a column of each sensor, if rows look like single readings of several sensors.
    pub long: Option<String>,
    /// Lines that cannot be read.
    pub lines_left_out: u64,
    /// What is wrong with the first of them.
    pub faults: Vec<String>,
    /// Lines that repeat the names or the lines around them.
    pub repeated_lines: u64,
    /// Rows without any cell.
    pub blank_rows: u64,
}

/// What was understood of the times of rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LookTime {
    /// Names of the columns that give the time.
    pub columns: Vec<String>,
    /// What times are measured from.
    pub scale: Scale,
    /// Unit or format of times that are numbers, as `--time-format` says it.
    pub format: Option<String>,
    /// The first time.
    pub from: Option<String>,
    /// The last time.
    pub to: Option<String>,
    /// Decimals of a second that the finest time needs.
    pub decimals: u8,
    /// The smallest step forward, in seconds.
    pub smallest_step: Option<f64>,
    /// The largest step forward, in seconds.
    pub largest_step: Option<f64>,
    /// Rows that are before the row above.
    pub backward: u64,
    /// Rows at the time of the row above.
    pub repeated: u64,
}

/// A number of a column: whole ones are exact, also beyond doubles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Number {
    /// A whole number of a column of [`Kind::Integer`].
    Whole(i64),
    /// A double.
    Double(f64),
}

/// What was understood of a column.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LookColumn {
    /// Its name, which no other column has.
    pub name: String,
    /// Its name as the file has it.
    pub own_name: String,
    /// Its unit; empty if the table states none.
    pub unit: String,
    /// The kind of its cells.
    pub kind: Kind,
    /// Cells that are no gaps.
    pub values: u64,
    /// Gaps.
    pub gaps: u64,
    /// Spellings of gaps that are not empty cells.
    pub gap_spellings: Vec<String>,
    /// Smallest number.
    pub min: Option<Number>,
    /// Largest number.
    pub max: Option<Number>,
    /// Largest number of decimals.
    pub decimals: u8,
    /// Words, if it is a column of words.
    pub words: Vec<String>,
    /// Cells that are neither gaps nor of the column's kind.
    pub suspicious: u64,
    /// The first of them, with its place.
    pub first_suspicious: Option<String>,
    /// A value that few cells have and that makes most of the range.
    pub sentinel: Option<f64>,
    /// Cells that have it.
    pub sentinel_cells: u64,
    /// A cell of digits whose zeros in front are lost, since the column is one of numbers.
    pub lost_zeros: Option<String>,
}

/// Looks at a table whose time was chosen, if it has any: reads all rows and counts. `watch` is called as rows are read.
///
/// # Errors
/// If the table cannot be read, or `watch` breaks.
pub fn look(table: Table, watch: &mut Watch<'_>) -> Result<Look, Error> {
    let (columns, dialect) = (table.columns().to_vec(), table.dialect().clone());
    let scale = table.time().map(|(_, scale)| scale);
    let long = table.readings().map(|readings| readings.as_options());
    let mut stopped = Ok(());
    let survey = table.survey_watched(&mut |rows| {
        stopped = report(watch, rows);
        stopped.is_ok()
    })?;
    stopped?;
    let times = &survey.times;
    let time = scale.map(|scale| {
        let shown = |time: Time| time.shown(scale, times.decimals);
        LookTime {
            columns: dialect.time_column.clone(),
            scale,
            format: dialect.time_format.clone(),
            from: times.ends.map(|ends| shown(ends.0)),
            to: times.ends.map(|ends| shown(ends.1)),
            decimals: times.decimals,
            smallest_step: times.steps.map(|steps| steps.0),
            largest_step: times.steps.map(|steps| steps.1),
            backward: times.backward,
            repeated: times.repeated,
        }
    });
    Ok(Look {
        format: dialect.format.clone(),
        options: dialect.as_options(),
        rows: survey.rows,
        time,
        columns: columns
            .iter()
            .zip(&survey.columns)
            .map(|(known, profile)| column(known, profile, &survey, dialect.time_column.contains(&known.name)))
            .collect(),
        long,
        lines_left_out: survey.skipped.bad,
        faults: survey.skipped.faults.clone(),
        repeated_lines: survey.skipped.repeated,
        blank_rows: survey.skipped.blank,
    })
}

fn column(column: &Column, profile: &Profile, survey: &Survey, is_time: bool) -> LookColumn {
    // Cells of the time that are none are lines that cannot be read.
    let suspicious = if is_time { 0 } else { profile.suspicious() };
    let first = profile.first_text.as_ref().filter(|_| suspicious > 0);
    let sentinel = profile.sentinel();
    let kind = survey.kind(column, profile);
    let words = match kind {
        Kind::Words | Kind::Boolean => profile.words.keys().cloned().collect(),
        _ => Vec::new(),
    };
    let spellings = profile.missing.keys().filter(|word| !word.is_empty());
    let (min, max) = match (profile.whole_range(), profile.range) {
        (Some((min, max)), _) => (Some(Number::Whole(min)), Some(Number::Whole(max))),
        (None, Some((min, max))) => (Some(Number::Double(min)), Some(Number::Double(max))),
        (None, None) => (None, None),
    };
    LookColumn {
        name: column.name.clone(),
        own_name: column.own_name.clone(),
        unit: column.unit.clone(),
        kind,
        values: profile.values(),
        gaps: profile.gaps(),
        gap_spellings: spellings.cloned().collect(),
        min,
        max,
        decimals: profile.decimals,
        words,
        suspicious,
        first_suspicious: first.map(|(place, cell)| format!("{place}: `{}`", printable(cell))),
        sentinel: sentinel.map(|sentinel| sentinel.value),
        sentinel_cells: sentinel.map_or(0, |sentinel| sentinel.count),
        lost_zeros: profile.lost_zeros().map(str::to_owned).filter(|_| !is_time),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use fewbits_table::Dialect;
    use std::io::Cursor;
    use std::ops::ControlFlow;

    fn table(text: &str) -> Table {
        let mut table = Table::open(Cursor::new(text.to_owned()), &Dialect::default()).unwrap();
        table.find_time().unwrap();
        table
    }

    #[test]
    fn whole_numbers_beyond_doubles_are_shown_exactly() {
        let text = "time,id\n0,9007199254740993\n1,-5\n2,9223372036854775807\n";
        let look = look(table(text), &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(look.columns[1].kind, Kind::Integer);
        assert_eq!(
            (look.columns[1].min, look.columns[1].max),
            (Some(Number::Whole(-5)), Some(Number::Whole(i64::MAX)))
        );
        assert_eq!(look.time.unwrap().to.as_deref(), Some("2"));
    }

    #[test]
    fn a_watch_stops_it() {
        let text = (0..20_000).fold("time,x\n".to_owned(), |text, i| text + &format!("{i},{i}\n"));
        let mut calls = 0;
        let stopped = look(table(&text), &mut |_| {
            calls += 1;
            ControlFlow::Break(())
        });
        assert!(matches!(stopped, Err(Error::Stopped)) && calls == 1);
    }
}
