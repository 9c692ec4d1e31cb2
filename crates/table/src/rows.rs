//! Rows of a text with a known dialect.

use crate::dialect::{Delimiter, Dialect};
use crate::error::Error;
use crate::json::{self, Keys};
use crate::lines::{Line, Lines, Row, Split};
use crate::missing;
use crate::number;
use crate::plain::Scanner;
#[cfg(feature = "parquet")]
use std::io::Cursor;

/// The mark of UTF-8.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether a line is the number of rows that programs of databases write below them, as `(60 rows)` and `60 rows in set (0.01 sec)`.
fn is_row_count(text: &[u8]) -> bool {
    let bare = text.strip_prefix(b"(").unwrap_or(text);
    let digits = bare.iter().take_while(|c| c.is_ascii_digit()).count();
    if digits == 0 {
        return false;
    }
    let rest = &bare[digits..];
    let rest = rest.strip_prefix(b" rows").or(rest.strip_prefix(b" row"));
    rest.is_some_and(|rest| match bare.len() < text.len() {
        true => rest == b")",
        false => rest.starts_with(b" in set"),
    })
}

/// Rows of a text.
pub(crate) struct Rows {
    pub(crate) lines: Lines,
    pub(crate) split: Split,
    pub(crate) comment: Vec<u8>,
    /// Whether a comment with as many cells as a row is refused, because it may be one.
    pub(crate) doubts_comments: bool,
    /// Of lines that name their cells, as JSON does.
    pub(crate) keys: Option<Keys>,
    pub(crate) header: Vec<String>,
    /// Cells of the lines before the data.
    pub(crate) preamble: Vec<Vec<String>>,
}

impl Rows {
    /// No rows of text, for tables of another source.
    #[cfg(feature = "parquet")]
    pub(crate) fn none() -> Self {
        Self {
            lines: Lines::new(Box::new(Cursor::new(Vec::new())), b'\n'),
            split: Split {
                delimiter: Delimiter::Byte(b','),
                quote: b'"',
            },
            comment: Vec::new(),
            doubts_comments: false,
            keys: None,
            header: Vec::new(),
            preamble: Vec::new(),
        }
    }

    /// Number of the last line.
    pub(crate) fn line(&self) -> u64 {
        self.lines.line()
    }

    /// Reads the next row. `None` after the last.
    pub(crate) fn next(&mut self, row: &mut Row) -> Result<Option<()>, Error> {
        loop {
            let Some(found) = self.lines.next(&mut row.text)? else {
                return Ok(None);
            };
            while row.text.starts_with(MARK) {
                // The mark of an encoding, where files were joined.
                row.text.drain(..MARK.len());
            }
            if !row.text.is_empty() && row.text.iter().all(|c| matches!(c, 0x1a | 0x0c)) {
                // The end of a file of DOS, and of a printed page.
                continue;
            }
            if is_row_count(&row.text) {
                continue;
            }
            if let Some(keys) = &self.keys {
                return json::row(keys, row, &found);
            }
            if !self.comment.is_empty() && row.text.starts_with(&self.comment) {
                self.check_comment(row, &found)?;
                continue;
            }
            self.split.complete(&mut self.lines, row, &found)?;
            return Ok(Some(()));
        }
    }

    fn check_comment(&self, row: &mut Row, found: &Line) -> Result<(), Error> {
        if self.doubts_comments
            && self.header.len() > 1
            && !self.split.split(row)
            && row.cells.len() == self.header.len()
        {
            let (Line::Text(line) | Line::TooLong(line)) = *found;
            return Err(Error::line(
                line,
                "a comment with as many cells as a row",
                "say --comment '#' if it is one, or --comment '' if it is a row",
            ));
        }
        Ok(())
    }

    /// What splits plain lines; `None` if there are none.
    pub(crate) fn scanner(&self, syntax: number::Syntax, columns: usize) -> Option<Scanner> {
        let Delimiter::Byte(delimiter) = self.split.delimiter else {
            return None;
        };
        let first_name = self.header.first().map_or("", String::as_str);
        let marks = (delimiter, self.split.quote);
        let scanner = Scanner::new(marks, syntax, &self.comment, first_name, columns);
        scanner.filter(|_| self.keys.is_none() && self.lines.end() == b'\n')
    }

    /// Bytes that are there, from the beginning of a line on, and the number of the line before.
    pub(crate) fn buffered(&mut self) -> Result<(u64, &[u8]), Error> {
        self.lines.buffered()
    }

    /// Takes so many bytes of [`buffered`](Self::buffered), which are so many lines.
    pub(crate) fn consume(&mut self, bytes: usize, lines: u64) {
        self.lines.consume(bytes, lines);
    }

    pub(crate) fn is_header_again(&self, row: &Row) -> bool {
        self.header.len() == row.cells.len()
            && self.header.len() > 1
            && self
                .header
                .iter()
                .enumerate()
                .all(|(i, name)| row.cell(i) == name.as_bytes())
    }

    /// Whether a row has the names in another order, as where a file of another program was joined.
    pub(crate) fn has_names_moved(&self, row: &Row) -> bool {
        let sorted = |mut names: Vec<String>| {
            names.sort_unstable();
            names
        };
        let length = self.header.len();
        length > 1 && row.cells.len() == length && sorted(row.texts()) == sorted(self.header.clone())
    }

    /// Whether a row is another line of names: it begins with the first name, and all cells are words.
    pub(crate) fn begins_another_table(&self, row: &Row) -> bool {
        let is_name = |i: usize| {
            let text = row.cell_text(i);
            text.starts_with(char::is_alphabetic) && !missing::is_usual(text, true) && text.parse::<f64>().is_err()
        };
        let is_first = |name: &String| !name.is_empty() && row.cell(0) == name.as_bytes();
        row.cells.len() > 1 && (0..row.cells.len()).all(is_name) && self.header.first().is_some_and(is_first)
    }

    /// Whether a row is one of the lines before the data, as in files that were joined.
    pub(crate) fn is_preamble(&self, row: &Row) -> bool {
        !row.cells.is_empty() && !row.is_blank() && self.preamble.contains(&row.texts())
    }

    /// Refuses a row that has not a cell for each column. Empty cells behind the last are tolerated.
    pub(crate) fn check_length(&self, row: &Row, columns: usize, dialect: &Dialect) -> Result<(), Error> {
        let count = row.cells.len();
        let is_good = count == columns
            || (count > columns && (columns..count).all(|i| row.cell(i).is_empty()))
            || (count < columns && dialect.short_rows)
            || (columns == 1 && count == 0);
        if is_good {
            return Ok(());
        }
        let is_time = |i: &usize| {
            let (front, behind) = (row.cell(*i), row.cell(*i + 1));
            let is_digits = |text: &[u8]| !text.is_empty() && text.iter().all(u8::is_ascii_digit);
            let seconds = front.len().checked_sub(3).map(|at| &front[at..]);
            seconds.is_some_and(|end| end[0] == b':' && is_digits(&end[1..]))
                && behind.len() % 3 == 0
                && is_digits(behind)
        };
        if count == columns + 1 && (0..columns).any(|i| is_time(&i)) {
            return Err(Error::line(
                row.line,
                format!("{count} cells instead of {columns}, and a comma behind seconds"),
                "write a point before their decimals: sed -E 's/(:[0-9]{2}),([0-9]{3})/\\1.\\2/' FILE | fewbits ... -",
            ));
        }
        let s = if count == 1 { "" } else { "s" };
        Err(Error::line(
            row.line,
            format!("{count} cell{s} instead of {columns}"),
            if count < columns {
                "mend the row, leave such rows out with --skip-bad, take what they lack as gaps with --short-rows, or say what separates \
                 cells with --delimiter"
            } else {
                "mend the row, leave such rows out with --skip-bad, or say what separates cells with --delimiter"
            },
        ))
    }
}
