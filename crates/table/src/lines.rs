//! Lines of text as rows of cells. One bad line costs one line: a quote that does not close is the fault of its own line.
//!
//! The crate `csv` splits a stream, not lines: after an odd quote it takes the rest of the file as one cell, and it knows no comments of
//! several characters and no runs of spaces. A test compares this file with it on random tables.

use crate::dialect::Delimiter;
use crate::error::Error;
use std::collections::VecDeque;
use std::io::{BufRead, Read};

/// Largest length of a line, and of a row with quoted line ends, in bytes.
pub(crate) const MAX_LINE: usize = 1 << 20;
/// Largest number of lines of a row.
pub(crate) const MAX_ROW_LINES: usize = 64;

/// Lines of a text.
pub(crate) struct Lines {
    reader: Box<dyn BufRead + Send>,
    /// Lines that were read ahead, with their numbers.
    queue: VecDeque<(u64, Vec<u8>)>,
    /// Number of the last line that was taken from the reader.
    line: u64,
    /// The last byte of lines.
    end: u8,
}

/// A line as it was read.
#[derive(Debug, PartialEq)]
pub(crate) enum Line {
    /// Its number; the text is in the caller's buffer.
    Text(u64),
    /// It was longer than a line may be.
    TooLong(u64),
}

impl Lines {
    pub(crate) fn new(reader: Box<dyn BufRead + Send>, end: u8) -> Self {
        Self {
            reader,
            queue: VecDeque::new(),
            line: 0,
            end,
        }
    }

    /// Reads the next line into `text`, without its end. `None` after the last.
    pub(crate) fn next(&mut self, text: &mut Vec<u8>) -> Result<Option<Line>, Error> {
        if let Some((line, queued)) = self.queue.pop_front() {
            *text = queued;
            return Ok(Some(Line::Text(line)));
        }
        text.clear();
        let count = self.reader.by_ref().take(MAX_LINE as u64).read_until(self.end, text)?;
        if count == 0 {
            return Ok(None);
        }
        self.line += 1;
        if text.last() != Some(&self.end) && count == MAX_LINE {
            let mut rest = Vec::new();
            while !rest.ends_with(&[self.end]) {
                rest.clear();
                if self
                    .reader
                    .by_ref()
                    .take(MAX_LINE as u64)
                    .read_until(self.end, &mut rest)?
                    == 0
                {
                    break;
                }
            }
            text.truncate(80);
            return Ok(Some(Line::TooLong(self.line)));
        }
        while matches!(text.last(), Some(b'\n' | b'\r')) {
            text.pop();
        }
        if self.end == b'\n' && text.contains(&b'\r') {
            // Ends of lines of several systems in one file.
            let first = self.line;
            let parts = text.split(|c| *c == b'\r').map(<[u8]>::to_vec);
            self.queue.extend((first..).zip(parts));
            self.line = self.queue.back().map_or(first, |(line, _)| *line);
            return self.next(text);
        }
        Ok(Some(Line::Text(self.line)))
    }

    /// Puts lines back, in front of all others.
    pub(crate) fn put_back(&mut self, lines: Vec<(u64, Vec<u8>)>) {
        for line in lines.into_iter().rev() {
            self.queue.push_front(line);
        }
    }

    /// The last byte of lines.
    pub(crate) fn end(&self) -> u8 {
        self.end
    }

    /// Bytes that are there, from the beginning of a line on, and the number of the line before; none if lines were read ahead.
    pub(crate) fn buffered(&mut self) -> Result<(u64, &[u8]), Error> {
        if !self.queue.is_empty() {
            return Ok((self.line, &[]));
        }
        match self.reader.fill_buf() {
            Ok(bytes) => Ok((self.line, bytes)),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => Ok((self.line, &[])),
            Err(error) => Err(error.into()),
        }
    }

    /// Takes so many bytes of [`buffered`](Self::buffered), which are so many lines.
    pub(crate) fn consume(&mut self, bytes: usize, lines: u64) {
        self.reader.consume(bytes);
        self.line += lines;
    }

    /// Number of the line before the next.
    pub(crate) fn line(&self) -> u64 {
        self.queue.front().map_or(self.line, |(line, _)| line.saturating_sub(1))
    }
}

/// A row as text: cells as places in one buffer.
#[derive(Debug, Default, Clone)]
pub(crate) struct Row {
    pub(crate) line: u64,
    pub(crate) text: Vec<u8>,
    pub(crate) cells: Vec<(u32, u32)>,
}

impl Row {
    /// A trimmed cell; empty if the row is too short.
    #[inline]
    pub(crate) fn cell(&self, column: usize) -> &[u8] {
        self.cells
            .get(column)
            .map_or(b"", |(from, to)| &self.text[*from as usize..*to as usize])
    }

    /// As [`cell`](Self::cell). Rows are checked to be UTF-8.
    pub(crate) fn cell_text(&self, column: usize) -> &str {
        std::str::from_utf8(self.cell(column)).unwrap_or_default()
    }

    pub(crate) fn is_blank(&self) -> bool {
        self.cells.iter().all(|(from, to)| from == to)
    }

    pub(crate) fn texts(&self) -> Vec<String> {
        (0..self.cells.len()).map(|i| self.cell_text(i).to_owned()).collect()
    }

    fn push_trimmed(&mut self, from: usize, to: usize) {
        let text = &self.text[from..to];
        let before = text.iter().take_while(|c| matches!(c, b' ' | b'\t')).count();
        let text = &text[before..];
        let behind = text.iter().rev().take_while(|c| matches!(c, b' ' | b'\t')).count();
        self.cells
            .push(((from + before) as u32, (from + before + text.len() - behind) as u32));
    }
}

/// How lines are split.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Split {
    pub(crate) delimiter: Delimiter,
    pub(crate) quote: u8,
}

impl Split {
    /// Splits the text of `row` into cells. Returns whether a quote is still open at its end.
    pub(crate) fn split(&self, row: &mut Row) -> bool {
        row.cells.clear();
        if row.text.contains(&self.quote) {
            return self.split_quoted(row);
        }
        match self.delimiter {
            Delimiter::Byte(delimiter) => {
                let (mut from, length) = (0, row.text.len());
                for at in 0..length {
                    if row.text[at] == delimiter {
                        row.push_trimmed(from, at);
                        from = at + 1;
                    }
                }
                row.push_trimmed(from, length);
            }
            Delimiter::Spaces => {
                let mut from = None;
                for at in 0..=row.text.len() {
                    let is_space = row.text.get(at).is_none_or(|c| matches!(c, b' ' | b'\t'));
                    match (from, is_space) {
                        (None, false) => from = Some(at),
                        (Some(begin), true) => {
                            row.cells.push((begin as u32, at as u32));
                            from = None;
                        }
                        _ => {}
                    }
                }
            }
        }
        false
    }

    fn split_quoted(&self, row: &mut Row) -> bool {
        let text = std::mem::take(&mut row.text);
        let is_end = |c: u8| match self.delimiter {
            Delimiter::Byte(delimiter) => c == delimiter,
            Delimiter::Spaces => matches!(c, b' ' | b'\t'),
        };
        let is_space = |c: u8| matches!(c, b' ' | b'\t') && !matches!(self.delimiter, Delimiter::Byte(d) if d == c);
        let mut at = 0;
        loop {
            while at < text.len() && is_space(text[at]) {
                at += 1;
            }
            if self.delimiter == Delimiter::Spaces && at == text.len() {
                break;
            }
            let from = row.text.len();
            if text.get(at) == Some(&self.quote) {
                at += 1;
                let mut is_inner = false;
                loop {
                    match (text.get(at), text.get(at + 1)) {
                        // A quote behind a backslash, as of MySQL; but `"C:\dir\"` ends with one.
                        (Some(b'\\'), Some(c))
                            if *c == self.quote
                                && (is_inner || text.get(at + 2).is_some_and(|c| !is_end(*c) && *c != self.quote)) =>
                        {
                            row.text.push(self.quote);
                            is_inner = !is_inner;
                            at += 2;
                        }
                        (None, _) => {
                            row.text = text;
                            return true;
                        }
                        (Some(c), Some(d)) if *c == self.quote && *d == self.quote => {
                            row.text.push(self.quote);
                            at += 2;
                        }
                        (Some(c), _) if *c == self.quote => {
                            at += 1;
                            break;
                        }
                        (Some(c), _) => {
                            row.text.push(*c);
                            at += 1;
                        }
                    }
                }
            }
            // What stands behind a closed quote belongs to the cell, as in other readers.
            while at < text.len() && !is_end(text[at]) {
                row.text.push(text[at]);
                at += 1;
            }
            let to = row.text.len();
            row.push_trimmed(from, to);
            if at >= text.len() {
                break;
            }
            at += 1;
            if at == text.len() && self.delimiter != Delimiter::Spaces {
                row.cells.push((to as u32, to as u32));
                break;
            }
        }
        false
    }

    /// Splits a line that was read into `row.text`, with further lines if a quote is open at its end.
    pub(crate) fn complete(&self, lines: &mut Lines, row: &mut Row, found: &Line) -> Result<(), Error> {
        row.cells.clear();
        match found {
            Line::TooLong(line) => return Err(too_long(*line)),
            Line::Text(line) => row.line = *line,
        }
        if self.split(row) {
            self.join(lines, row)?;
        }
        check_text(row)
    }

    /// Adds lines until the quote is closed. If none closes it, they are put back and the first one is refused.
    fn join(&self, lines: &mut Lines, row: &mut Row) -> Result<(), Error> {
        let mut whole = std::mem::take(&mut row.text);
        let mut taken = Vec::new();
        while taken.len() < MAX_ROW_LINES && whole.len() < MAX_LINE {
            let mut next = Vec::new();
            let Some(Line::Text(line)) = lines.next(&mut next)? else {
                break;
            };
            whole.push(b'\n');
            whole.extend_from_slice(&next);
            taken.push((line, next));
            row.text.clone_from(&whole);
            if !self.split(row) {
                return Ok(());
            }
        }
        lines.put_back(taken);
        row.text.clear();
        row.cells.clear();
        Err(Error::line(
            row.line,
            "a quote does not close",
            "close it, leave the line out with --skip-bad, or say the mark with --quote",
        ))
    }
}

fn too_long(line: u64) -> Error {
    Error::line(
        line,
        format!("longer than {MAX_LINE} bytes"),
        "this is no table of text, or its lines do not end; leave the line out with --skip-bad",
    )
}

fn check_text(row: &Row) -> Result<(), Error> {
    if row.text.is_ascii() {
        return Ok(());
    }
    match std::str::from_utf8(&row.text) {
        Ok(_) => Ok(()),
        Err(error) => Err(Error::line(
            row.line,
            format!("byte {} is not text in UTF-8", error.valid_up_to() + 1),
            "say how it is written, as --encoding latin1, windows-1251, shift_jis or gbk",
        )),
    }
}
