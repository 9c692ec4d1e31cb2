//! Reading: rows of text become cells of columns.

use crate::cell::{Meaning, push_cell};
use crate::column::{Batch, Cells, Kind};
use crate::dialect::Delimiter;
use crate::error::{Error, Place, printable};
use crate::guess::looks_like_time;
use crate::missing;
use crate::names;
use crate::number::{self, Number};
use crate::table::Table;

/// Largest number of lines that were left out and whose faults are kept.
const MAX_FAULTS: usize = 10;
/// Several curves in one file.
const BLOCK: &str = "a further block of rows begins here, behind two blank lines";

impl Table {
    /// Reads at most `limit` rows into `batch`. Returns how many there were; 0 after the last. Of a live source, a call with a limit of 1
    /// waits for no more than one row.
    ///
    /// # Errors
    /// If a line or a cell cannot be read and no more may be left out. Rows before it are handed out first. After an error in one line,
    /// reading goes on behind it.
    pub fn read(&mut self, batch: &mut Batch, limit: usize) -> Result<usize, Error> {
        batch.reset(self.selected.iter().map(|i| self.columns[*i].kind));
        self.read_rows(batch, limit, true)?;
        if !self.own_lines.is_empty() {
            batch.places = batch.places.iter().map(|place| self.own_place(*place)).collect();
        }
        Ok(batch.rows)
    }

    /// As [`read`](Self::read); `takes_plain`: whether plain lines are split where they lie.
    pub(crate) fn read_rows(&mut self, batch: &mut Batch, limit: usize, takes_plain: bool) -> Result<usize, Error> {
        if let Some(error) = self.late_error.take() {
            return Err(error);
        }
        while batch.rows < limit {
            let plain = if takes_plain {
                self.plain_rows(batch, limit)
            } else {
                Ok(())
            };
            let outcome = match plain {
                Ok(()) if batch.rows == limit => break,
                Ok(()) => self.next_into(batch),
                Err(error) => Err(error),
            };
            let mut error = match outcome {
                Ok(true) => continue,
                Ok(false) => break,
                Err(error) => self.placed(error),
            };
            batch.cut();
            let is_of_row = error.place().is_some();
            let is_moved = is_of_row && self.rows.has_names_moved(&self.row);
            if is_moved {
                // Cells behind this line are those of other columns, so that it is not left out.
                error = Error::Line {
                    place: self.own_place(self.place()),
                    problem: "the names stand in another order than in the first line".to_owned(),
                    mend: "make a file of its own of this line and all behind it",
                };
            }
            let is_block = matches!(&error, Error::Line { problem, .. } if problem == BLOCK);
            let is_other = is_of_row && !is_moved && !is_block && self.rows.begins_another_table(&self.row);
            if is_other {
                error = Error::Line {
                    place: self.own_place(self.place()),
                    problem: "another line of names: a further table begins here".to_owned(),
                    mend: "make a file of its own of this line and all behind it",
                };
            }
            if is_of_row && self.rows.is_preamble(&self.row) {
                self.skipped.repeated += 1;
            } else if is_of_row && !is_moved && !is_other && !is_block && self.skipped.bad < self.dialect.skip_bad {
                self.skip(&error);
            } else if batch.rows > 0 {
                self.late_error = Some(error);
                break;
            } else {
                return Err(error);
            }
        }
        Ok(batch.rows)
    }

    /// Reads rows as long as they are plain and lie in the buffer.
    fn plain_rows(&mut self, batch: &mut Batch, limit: usize) -> Result<(), Error> {
        let Some(scanner) = self.scanner.as_mut().filter(|_| self.label.is_none()) else {
            return Ok(());
        };
        let (before, bytes) = self.rows.buffered()?;
        let (mut used, mut lines) = (0, 0);
        while batch.rows < limit {
            let line = &bytes[used..];
            let Some(length) = scanner.line(line) else {
                break;
            };
            let mut is_taken = true;
            if let Some((columns, clock)) = &self.time {
                let time = match columns.as_slice() {
                    [column] => match clock.quick(scanner.cells[*column].bytes(line)) {
                        Some(time) => Ok(time),
                        None => clock.parse(scanner.cells[*column].text(line)),
                    },
                    several => {
                        let cells: Vec<&str> = several.iter().map(|i| scanner.cells[*i].text(line)).collect();
                        clock.of_parts(&cells)
                    }
                };
                match time {
                    Ok(time) => batch.times.push(time),
                    Err(_) => is_taken = false,
                }
            }
            for (i, column) in self.selected.iter().enumerate() {
                let cell = scanner.cells[*column];
                let gaps = &self.gaps[*column];
                match (&mut batch.columns[i], cell.number) {
                    (Cells::Numbers(numbers), Some((value, _))) if !self.dialect.strip_units => {
                        numbers.push(Some(value).filter(|_| !gaps.has_numbers() || !gaps.has_number(value)));
                    }
                    (Cells::Numbers(numbers), None) if cell.is_empty() => numbers.push(None),
                    (cells, _) => {
                        let meaning = Meaning {
                            syntax: self.syntax,
                            gaps,
                            strips: self.dialect.strip_units,
                            clock: self.clocks[*column].as_ref(),
                            kind: self.columns[*column].kind,
                            unit: self.profiles[*column].unit.as_deref(),
                        };
                        is_taken &= push_cell(cells, cell.text(line), &meaning, &mut self.words[*column]).is_ok();
                    }
                }
            }
            if !is_taken {
                // Read anew by itself, so that an error has its place.
                batch.cut();
                break;
            }
            (used, lines) = (used + length, lines + 1);
            batch.places.push(Place {
                line: before + lines,
                row: self.count + lines,
            });
            batch.rows += 1;
        }
        self.count += lines;
        self.rows.consume(used, lines);
        Ok(())
    }

    /// Reads the next row into `batch`. Returns whether there was one.
    fn next_into(&mut self, batch: &mut Batch) -> Result<bool, Error> {
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            return self.next_arrow(batch);
        }
        if !self.next_row()? {
            return Ok(false);
        }
        self.push(batch).map(|()| true)
    }

    fn skip(&mut self, error: &Error) {
        self.skipped.bad += 1;
        if self.skipped.faults.len() < MAX_FAULTS {
            self.skipped.faults.push(error.to_string());
        }
    }

    /// An error of a line with the number of its row.
    fn placed(&self, mut error: Error) -> Error {
        let has_nul = self.row.text.contains(&0);
        match &mut error {
            Error::Line { place, problem, mend } => {
                place.row = self.count;
                if has_nul {
                    "NUL bytes, as after a loss of power".clone_into(problem);
                    *mend = "leave such lines out with --skip-bad";
                }
            }
            Error::Cell { problem, mend, .. } if has_nul => {
                *problem = "has NUL bytes, as after a loss of power";
                "leave such lines out with --skip-bad".clone_into(mend);
            }
            _ => {}
        }
        const MARKS: [(&[u8], &str); 4] = [
            (b"//", "if such lines are comments, say --comment //"),
            (b"%", "if such lines are comments, say --comment %"),
            (b";", "if such lines are comments, say --comment ';'"),
            (b"!", "if such lines are comments, say --comment !"),
        ];
        let said = MARKS.iter().find(|(mark, _)| self.row.cell(0).starts_with(mark));
        match (&mut error, said) {
            (Error::Line { mend, .. }, Some((_, said))) => *mend = said,
            (Error::Cell { mend, .. }, Some((_, said))) => (*said).clone_into(mend),
            _ => {}
        }
        if let Error::Line { place, .. } | Error::Cell { place, .. } = &mut error {
            *place = self.own_place(*place);
        }
        error
    }

    /// Reads the next row that is not blank into `self.row`.
    fn next_row(&mut self) -> Result<bool, Error> {
        // Blocks of rows behind two blank lines, as of gnuplot, are several curves.
        let has_blocks = self.rows.split.delimiter == Delimiter::Spaces && self.rows.keys.is_none();
        let mut blanks = 0;
        loop {
            self.row.text.clear();
            self.row.cells.clear();
            let found = self.rows.next(&mut self.row);
            if !matches!(found, Ok(None)) {
                self.count += 1;
            }
            if found?.is_none() {
                return Ok(false);
            }
            if self.row.is_blank()
                && (self.row.cells.len() <= 1 || self.time.is_some())
                && (self.columns.len() > 1 || self.time.is_some())
            {
                self.count -= 1;
                blanks += 1;
                self.skipped.blank += u64::from(self.row.cells.len() > 1);
                continue;
            }
            if self.rows.is_header_again(&self.row) {
                self.count -= 1;
                self.skipped.repeated += 1;
                continue;
            }
            if has_blocks {
                let next = self.row.cell_text(0).parse::<f64>().ok();
                let before = std::mem::replace(&mut self.first_number, next);
                let goes_back = before.zip(next).is_some_and(|(before, next)| next < before);
                if blanks < 2 || !goes_back {
                    return Ok(true);
                }
                return Err(Error::line(
                    self.row.line,
                    BLOCK,
                    "make a file of each block, as: awk 'BEGIN {RS = \"\\n\\n\\n+\"} NR == 1' FILE | fewbits ... -",
                ));
            }
            return Ok(true);
        }
    }

    pub(crate) fn place(&self) -> Place {
        Place {
            line: self.row.line,
            row: self.count,
        }
    }

    fn push(&mut self, batch: &mut Batch) -> Result<(), Error> {
        self.rows.check_length(&self.row, self.columns.len(), &self.dialect)?;
        if let Some((columns, clock)) = &self.time {
            let time = match columns.as_slice() {
                [column] => match self.row.cell_text(*column) {
                    "" => {
                        Err(("is no time: the cell is empty", "mend the row, or leave such rows out with --skip-bad"))
                    }
                    text => clock.parse(text),
                },
                several => clock.of_parts(&several.iter().map(|i| self.row.cell_text(*i)).collect::<Vec<_>>()),
            };
            let time = time.map_err(|(problem, mend)| {
                let text = columns
                    .iter()
                    .map(|i| self.row.cell_text(*i))
                    .collect::<Vec<_>>()
                    .join(" ");
                self.refused(columns[0], &text, problem, mend.to_owned())
            })?;
            batch.times.push(time);
        }
        for (i, column) in self.selected.iter().enumerate() {
            let cell = self.row.cell(*column);
            if let Cells::Numbers(numbers) = &mut batch.columns[i] {
                // The usual cases, without a copy.
                if cell.is_empty() {
                    numbers.push(None);
                    continue;
                }
                if let (false, Ok(Number::Double(value, _))) =
                    (self.dialect.strip_units, number::parse(cell, self.syntax))
                {
                    let gaps = &self.gaps[*column];
                    numbers.push(Some(value).filter(|_| !gaps.has_numbers() || !gaps.has_number(value)));
                    continue;
                }
            }
            let pushed = push_cell(
                &mut batch.columns[i],
                self.row.cell_text(*column),
                &Meaning {
                    syntax: self.syntax,
                    gaps: &self.gaps[*column],
                    strips: self.dialect.strip_units,
                    clock: self.clocks[*column].as_ref(),
                    kind: self.columns[*column].kind,
                    unit: self.profiles[*column].unit.as_deref(),
                },
                &mut self.words[*column],
            );
            let Err((problem, mend)) = pushed else { continue };
            if !self.push_limit(batch, i, *column) {
                return Err(self.cell_refused(*column, problem, mend));
            }
        }
        batch.places.push(self.place());
        batch.rows += 1;
        Ok(())
    }

    fn refused(&self, column: usize, cell: &str, problem: &'static str, mend: String) -> Error {
        Error::Cell {
            place: self.place(),
            column: printable(&self.columns[column].name),
            cell: printable(cell),
            problem,
            mend,
        }
    }

    fn cell_refused(&self, column: usize, problem: &'static str, mend: &'static str) -> Error {
        let cell = self.row.cell_text(column);
        let is_one_column =
            self.columns.len() == 1 && cell.contains([';', '\t', '|', ' ']) && problem == number::NO_NUMBER;
        let mend = if is_one_column {
            "name what separates cells with --delimiter"
        } else if problem == number::NO_NUMBER && looks_like_time(cell) && self.time.is_none() {
            "if this is the time of the row, add --time exact"
        } else {
            mend
        };
        if let Some(mend) = self.readings_mend(column, mend) {
            return self.refused(column, cell, problem, mend);
        }
        // Other columns of the row that are none of numbers either are left out with the same option.
        let is_other = |other: &&usize| {
            **other == column
                || (problem == number::NO_NUMBER
                    && self.columns[**other].kind == Kind::Number
                    && self.is_no_number(**other))
        };
        let names = self
            .selected
            .iter()
            .filter(is_other)
            .map(|i| printable(&self.columns[*i].name));
        let own = names::as_argument([printable(&self.columns[column].name)]);
        let mend = mend.replace("--without", &format!("--without {}", names::as_argument(names)));
        let mend = mend.replace("--words", &format!("--words {own}"));
        self.refused(column, cell, problem, mend)
    }

    /// Whether a cell of the row is neither a number nor a gap.
    fn is_no_number(&self, column: usize) -> bool {
        let (text, gaps) = (self.row.cell_text(column), &self.gaps[column]);
        !missing::is_usual(text, true) && !gaps.has_text(text) && number::parse(text.as_bytes(), self.syntax).is_err()
    }
}
