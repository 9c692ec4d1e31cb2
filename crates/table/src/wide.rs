//! Long tables, whose rows are single readings with the name of their sensor, as wide ones: a row per time, a column per sensor.

use crate::column::Batch;
use crate::dialect::Dialect;
use crate::error::{Error, Place};
use crate::table::Table;
use crate::time::{Scale, Time};
use std::collections::HashMap;
use std::io::Read;

/// Largest number of different names.
const MAX_NAMES: usize = 1 << 16;

/// A row of the long table.
struct Reading {
    time: Time,
    name: u32,
    line: u64,
    /// Where its cells begin in the text of all.
    from: usize,
}

/// The wide table as text, made line by line.
struct Lines {
    readings: Vec<Reading>,
    /// First readings of the rows, and the end of the last row.
    rows: Vec<usize>,
    next: usize,
    /// Cells of all readings; each ends with a NUL.
    text: String,
    names: usize,
    values: usize,
    scale: Scale,
    line: Vec<u8>,
    at: usize,
}

fn quoted(line: &mut Vec<u8>, cell: &str) {
    line.push(b'"');
    for byte in cell.bytes() {
        if byte == b'"' {
            line.push(b'"');
        }
        line.push(byte);
    }
    line.push(b'"');
}

impl Lines {
    /// Makes the line of the next row. Returns whether there is one.
    fn advance(&mut self) -> bool {
        let Some([from, to]) = self.rows.get(self.next..self.next + 2) else {
            return false;
        };
        self.next += 1;
        self.line.clear();
        self.at = 0;
        let readings = &self.readings[*from..*to];
        let time = readings[0].time;
        self.line.extend(time.shown(self.scale, time.decimals()).bytes());
        let mut filled: Vec<Option<&Reading>> = vec![None; self.names];
        for reading in readings {
            filled[reading.name as usize] = Some(reading);
        }
        for reading in filled {
            let Some(reading) = reading else {
                self.line.extend(std::iter::repeat_n(b',', self.values));
                continue;
            };
            for cell in self.text[reading.from..].split('\0').take(self.values) {
                self.line.push(b',');
                // Numbers are read faster without quotes.
                if cell.bytes().all(|c| c.is_ascii_digit() || matches!(c, b'-' | b'.')) {
                    self.line.extend(cell.bytes());
                } else {
                    quoted(&mut self.line, cell);
                }
            }
        }
        self.line.push(b'\n');
        true
    }
}

impl Read for Lines {
    fn read(&mut self, target: &mut [u8]) -> std::io::Result<usize> {
        let mut written = 0;
        while written < target.len() && (self.at < self.line.len() || self.advance()) {
            let count = (target.len() - written).min(self.line.len() - self.at);
            target[written..written + count].copy_from_slice(&self.line[self.at..self.at + count]);
            (written, self.at) = (written + count, self.at + count);
        }
        Ok(written)
    }
}

impl Table {
    /// The wide table of this long one. Its first column is the time. Then come, for each text of the column `by` in the order of its first
    /// row, a column of its values, named by the text; if several columns are selected, one for each, as `kitchen.temp`. Cells keep the
    /// text that they have here, so that each has a kind of its own. Rows of one time are one row; a second reading of one sensor at
    /// one time begins another row of that time. Rows are sorted by time if they are not. `missing`: spellings of gaps, as
    /// [`Dialect::missing`], where names are those of the wide table. All rows are held in memory.
    ///
    /// # Errors
    /// If there is no such column, no time was chosen, no other column is selected, there are more than 65,536 different names, or a row
    /// cannot be read.
    pub fn widened(mut self, by: &str, missing: &[String]) -> Result<Self, Error> {
        let refused = |expected: &str| Err(Error::option("--by", by, expected));
        self.set_label(by)?;
        let Some((columns, scale)) = self.time() else {
            return refused("a table whose rows have times: name their column with --time-column");
        };
        let time_names: Vec<&str> = columns.iter().map(|i| self.columns[*i].name.as_str()).collect();
        let time_name = time_names.join(",");
        self.values = std::mem::take(&mut self.selected);
        self.values.retain(|column| !columns_of(&self.time).contains(column));
        if self.values.is_empty() {
            return refused("the column of names beside one of values");
        }
        let (mut names, mut readings, mut text) = (Vec::<String>::new(), Vec::new(), String::new());
        let mut places = HashMap::<String, u32>::new();
        let mut batch = Batch::default();
        while self.read(&mut batch, 1)? == 1 {
            let (Some(time), Some(Place { line, .. })) = (batch.times.first(), batch.places.first()) else {
                continue;
            };
            let name = match places.get(self.label()) {
                Some(name) => *name,
                None if names.len() == MAX_NAMES => return refused("a column of at most 65536 different names"),
                None => {
                    let name = self.label().to_owned();
                    names.push(name.clone());
                    places.insert(name, names.len() as u32 - 1);
                    names.len() as u32 - 1
                }
            };
            readings.push(Reading {
                time: *time,
                name,
                line: *line,
                from: text.len(),
            });
            for column in &self.values {
                #[cfg(feature = "parquet")]
                if let Some(rows) = &self.arrow {
                    text.extend(rows.text(*column).chars().filter(|c| *c != '\0'));
                    text.push('\0');
                    continue;
                }
                text.extend(self.row.cell_text(*column).chars().filter(|c| *c != '\0'));
                text.push('\0');
            }
        }
        if !readings.is_sorted_by_key(|reading| reading.time) {
            readings.sort_by_key(|reading| reading.time);
        }
        self.wide(&time_name, scale, names, readings, text, missing)
    }

    fn wide(
        self,
        time_name: &str,
        scale: Scale,
        names: Vec<String>,
        readings: Vec<Reading>,
        text: String,
        missing: &[String],
    ) -> Result<Self, Error> {
        let (mut rows, mut seen) = (Vec::new(), vec![usize::MAX; names.len()]);
        let mut last = None;
        for (i, reading) in readings.iter().enumerate() {
            if last != Some(reading.time) || seen[reading.name as usize] == rows.len() {
                rows.push(i);
                last = Some(reading.time);
            }
            seen[reading.name as usize] = rows.len();
        }
        let own_lines: Vec<u64> = rows.iter().map(|row| readings[*row].line).collect();
        rows.push(readings.len());
        let mut header = Vec::new();
        quoted(&mut header, time_name);
        for name in &names {
            for value in &self.values {
                header.push(b',');
                match self.values.len() {
                    1 => quoted(&mut header, name),
                    _ => quoted(&mut header, &format!("{name}.{}", self.columns[*value].name)),
                }
            }
        }
        header.push(b'\n');
        let lines = Lines {
            readings,
            rows,
            next: 0,
            text,
            names: names.len(),
            values: self.values.len(),
            scale,
            line: header,
            at: 0,
        };
        let dialect = Dialect {
            format: self.dialect.format.clone(),
            encoding: None,
            delimiter: Some(",".to_owned()),
            quote: Some('"'),
            comment: Some(String::new()),
            skip: Some(0),
            no_header: Some(false),
            units_row: Some(false),
            skip_after_names: Some(0),
            missing: missing.to_vec(),
            time_column: Vec::new(),
            // Times are written anew: with a date, or as seconds.
            time_format: (scale == Scale::Seconds).then(|| "s".to_owned()),
            time_zone: None,
            ..self.dialect.clone()
        };
        let mut wide = Self::open(lines, &dialect)?;
        for (i, column) in wide.columns.iter_mut().enumerate().skip(1) {
            let value = self.values[(i - 1) % self.values.len()];
            column.unit.clone_from(&self.columns[value].unit);
        }
        wide.skipped = self.skipped;
        wide.own_lines = own_lines;
        wide.own_dialect = Some(self.dialect);
        Ok(wide)
    }

    /// The place with the line of the file that was opened.
    pub(crate) fn own_place(&self, place: Place) -> Place {
        let line = usize::try_from(place.row)
            .ok()
            .and_then(|row| self.own_lines.get(row.checked_sub(1)?));
        Place {
            line: line.copied().unwrap_or(place.line),
            ..place
        }
    }
}

fn columns_of(time: &Option<(Vec<usize>, crate::written::Clock)>) -> &[usize] {
    time.as_ref().map_or(&[], |(columns, _)| columns)
}
