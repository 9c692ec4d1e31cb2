//! A table as rows of a recording: ticks, cells as doubles, units. What no double holds is refused with the cell's place.

use crate::error::Failure;
use crate::source::{Batch, Source};
use crate::{times, words};
use fewbits_record::{Integers, TimeBase};
use fewbits_table::{Cells, Kind, Scale, Table, Time, names};

/// Number of rows per batch.
const ROWS: usize = 512;

/// Distance of the origins that are chosen by a first row.
const COARSE: i64 = 1 << 52;

/// The unit of a column of a table, or the list of its words; empty if words are too long for a unit.
pub fn unit(table: &Table, column: usize) -> String {
    match table.columns().get(column).map(|column| (column.kind, &column.unit)) {
        Some((Kind::Words, _)) => words::unit(table.words(column)),
        Some((Kind::Time, _)) => match table.scale(column) {
            Some(Scale::Seconds) => "s".to_owned(),
            _ => "s since 1970".to_owned(),
        },
        Some((_, unit)) => unit.clone(),
        None => String::new(),
    }
}

/// States the words and the whole numbers of the selected columns as the columns of a recording have them, so that cells are the numbers that it has for them.
/// `batch`: rows that were read before.
///
/// # Errors
/// If a row of the batch has a word that the recording has not, or at another place.
pub fn use_words(
    table: &mut Table,
    batch: &fewbits_table::Batch,
    columns: &[&fewbits_record::Column],
) -> Result<(), fewbits_table::Error> {
    let selected = table.selected().to_vec();
    for (i, (column, recorded)) in selected.into_iter().zip(columns).enumerate() {
        if recorded.integers().is_some() {
            table.expect_integers(column);
        }
        let Some(words) = words::of(recorded.unit()) else {
            continue;
        };
        let known = table.words(column);
        if let Some(Cells::Words(cells)) = batch.columns.get(i) {
            let is_other = |index: &usize| known.get(*index) != words.get(*index);
            let found =
                |(row, index): (usize, &Option<u32>)| Some((row, index.map(|index| index as usize).filter(is_other)?));
            if let Some((row, index)) = cells.iter().enumerate().find_map(found) {
                let cell = known.get(index).cloned().unwrap_or_default();
                let mend = "mend the cell, or leave the row out with --skip-bad";
                let column = &table.columns()[column].name;
                return Err(refused(batch, row, column, cell, "is none of the words of the column", mend));
            }
        }
        table.fix_words(column, words);
    }
    Ok(())
}

/// The refusal of a time of a row.
pub fn time_refused(
    table: &Table,
    batch: &fewbits_table::Batch,
    row: usize,
    time: Time,
    (problem, mend): times::Problem,
) -> fewbits_table::Error {
    let (column, scale) = match table.time() {
        Some((columns, scale)) => (columns.first().copied(), scale),
        None => (None, Scale::Seconds),
    };
    let name = column
        .and_then(|column| table.columns().get(column))
        .map(|column| column.name.as_str());
    refused(batch, row, name.unwrap_or_default(), time.shown(scale, time.decimals()), problem, mend)
}

/// The refusal of a cell in this row of a batch.
fn refused(
    batch: &fewbits_table::Batch,
    row: usize,
    column: &str,
    cell: String,
    problem: &'static str,
    mend: &str,
) -> fewbits_table::Error {
    fewbits_table::Error::Cell {
        place: batch.places.get(row).copied().unwrap_or_default(),
        column: column.to_owned(),
        cell,
        problem,
        mend: mend.to_owned(),
    }
}

/// The number that codes of a column of whole numbers count from: the smallest one, if the table was surveyed, or a
/// multiple of `2^52` below that of the first row, which a source that starts anew has again. `None`
/// if the selected column at this index has other cells.
pub fn origin(
    table: &Table,
    survey: Option<&fewbits_table::Survey>,
    batch: &fewbits_table::Batch,
    index: usize,
) -> Option<i64> {
    let column = *table.selected().get(index)?;
    if table.columns().get(column)?.kind != Kind::Integer {
        return None;
    }
    let least = survey.and_then(|survey| survey.columns.get(column)?.whole_range());
    let first = match batch.columns.get(index) {
        Some(Cells::Integers(cells)) => cells.iter().flatten().next().copied(),
        _ => None,
    };
    let below = |number: i64| number - number.rem_euclid(COARSE);
    Some(least.map(|range| range.0).or(first.map(below)).unwrap_or(0))
}

/// The cell of a selected column as a double: the code of a whole number if the recording's column has these.
///
/// # Errors
/// If no double holds it, it is a time of a table whose rows have no time, or it is no whole number, as the recording expects.
pub fn cell(
    table: &Table,
    batch: &fewbits_table::Batch,
    index: usize,
    row: usize,
    integers: Option<Integers>,
) -> Result<Option<f64>, fewbits_table::Error> {
    let cells = &batch.columns[index];
    if let Some(integers) = integers {
        if let Cells::Integers(cells) = cells {
            return Ok(cells[row].map(|number| integers.code(number)));
        }
        let refused = |cell: String| {
            let problem = "is no whole number of 64 bits, as all others of the recording's column";
            let mend = "mend the cell, or pack the table into a recording of its own";
            refused(batch, row, &table.columns()[table.selected()[index]].name, cell, problem, mend)
        };
        return match cells.number(row).map_err(refused)? {
            None => Ok(None),
            Some(number) => integers
                .code_of(number)
                .map(Some)
                .ok_or_else(|| refused(number.to_string())),
        };
    }
    let has_time = !batch.times.is_empty();
    if let Cells::Times(times) = cells
        && let Some(time) = times[row].filter(|_| !has_time)
    {
        return Err(cell_refused(table, batch, index, row, time.shown(Scale::Local, time.decimals())));
    }
    cells
        .number(row)
        .map_err(|text| cell_refused(table, batch, index, row, text))
}

fn cell_refused(
    table: &Table,
    batch: &fewbits_table::Batch,
    index: usize,
    row: usize,
    text: String,
) -> fewbits_table::Error {
    let column = table
        .selected()
        .get(index)
        .and_then(|column| table.columns().get(*column));
    let (kind, name) = column.map_or((Kind::Number, ""), |column| (column.kind, column.name.as_str()));
    let (problem, mend) = match kind {
        Kind::Time if batch.times.is_empty() => (
            "is a time",
            "if this is the time of the row, add --time exact; otherwise leave the column out with --without",
        ),
        Kind::Time => ("is a time, and its seconds are no double", "leave the column out with --without"),
        _ => (
            "is a whole number of more than 53 bits, and the rows before have numbers that are none",
            "pack a file instead of a pipe, or into a recording of its own; or leave the column out with --without",
        ),
    };
    let mend = mend.replace("--without", &format!("--without {}", names::as_argument([name])));
    refused(batch, row, name, text, problem, &mend)
}

/// Rows of the selected columns of a table.
pub struct TableRows {
    table: Table,
    base: TimeBase,
    batch: fewbits_table::Batch,
}

impl TableRows {
    /// Rows with ticks of this base. A table without a time has none.
    pub fn new(table: Table, base: TimeBase) -> Self {
        Self {
            table,
            base,
            batch: fewbits_table::Batch::default(),
        }
    }

    /// The table.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// At most `limit` rows; `None` if there are none.
    ///
    /// # Errors
    /// If a row cannot be read, or has what no tick or double holds.
    pub fn take(&mut self, limit: usize) -> Result<Option<Batch>, fewbits_table::Error> {
        if self.table.read(&mut self.batch, limit)? == 0 {
            return Ok(None);
        }
        let batch = &self.batch;
        let tick = |(row, time): (usize, &Time)| {
            times::of_row(*time, self.base).map_err(|problem| time_refused(&self.table, batch, row, *time, problem))
        };
        let ticks: Vec<Option<i64>> = batch.times.iter().enumerate().map(tick).collect::<Result<_, _>>()?;
        let cells = |index: usize| match &batch.columns[index] {
            Cells::Numbers(cells) => Ok(cells.clone()),
            _ => (0..batch.rows)
                .map(|row| cell(&self.table, batch, index, row, None))
                .collect(),
        };
        let columns = (0..batch.columns.len()).map(cells).collect::<Result<_, _>>()?;
        // Without a column of times there are no ticks, whatever the base is.
        let ticks: Option<Vec<i64>> = ticks.into_iter().collect();
        Ok(Some(Batch {
            ticks: ticks.filter(|ticks| !ticks.is_empty()),
            columns,
        }))
    }
}

impl Source for TableRows {
    fn next_batch(&mut self) -> Result<Option<Batch>, Failure> {
        Ok(self.take(ROWS)?)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use fewbits_table::Dialect;
    use std::io::Cursor;

    fn taken(text: &str, base: TimeBase) -> Result<Batch, fewbits_table::Error> {
        let mut table = Table::open(Cursor::new(text.to_owned()), &Dialect::default())?;
        table.find_time()?;
        TableRows::new(table, base).take(100).map(Option::unwrap)
    }

    #[test]
    fn ticks_and_cells() {
        let text = "time,x,on\n2024-03-05T00:00:00.5Z,1.5,true\n2024-03-05T00:00:01Z,,false\n";
        let base = times::base(Scale::Utc, None, Some(1), 0);
        let batch = taken(text, base).unwrap();
        assert_eq!(batch.ticks, Some(vec![1_709_596_800_500, 1_709_596_801_000]));
        assert_eq!(batch.columns, [vec![Some(1.5), None], vec![Some(1.0), Some(0.0)]]);
        assert_eq!(taken(text, TimeBase::Numbered).unwrap().ticks, None);
    }

    #[test]
    fn what_no_tick_or_double_holds_is_refused_with_its_place() {
        let base = times::base(Scale::Seconds, None, Some(0), 0);
        for (text, part) in [
            ("time,x\n0,1\n1.5,2\n", "line 3 (row 2), column `time`: `1.5` has more decimals than a tick"),
            ("time,x\n0,9007199254740993\n", "line 2 (row 1), column `x`: `9007199254740993` is a whole number"),
        ] {
            let message = taken(text, base).unwrap_err().to_string();
            assert!(message.starts_with(part), "{message}");
        }
    }
}
