//! Tables within frames: Markdown, boxes drawn around cells, LaTeX, whole lines in quotes, sequences of JSON.
//!
//! A reader makes each line of a frame a line of cells alone, and each rule a blank line. Everything behind it sees a plain table whose lines
//! keep their numbers.

use crate::dialect::Dialect;
use crate::head::Head;
use crate::lines::MAX_LINE;
use crate::names::is_one_of;
use crate::{guess, number};
use std::io::{BufRead, Cursor, Read};

/// What stands around the cells of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Frame {
    /// `| a | b |`, also with rules of `+---+---+`.
    Bars,
    /// The same, drawn with the characters of boxes.
    Boxes,
    /// `a & b \\`.
    Latex,
    /// `"a,""b"""`: each line is one cell in quotes that holds all cells.
    Quotes,
    /// Objects of JSON, each behind a separator of records.
    Records,
}

const ALL: [Frame; 5] = [Frame::Bars, Frame::Boxes, Frame::Latex, Frame::Quotes, Frame::Records];
/// The separator of records of RFC 7464.
const RECORD: char = '\u{1e}';
/// Names of types that programs write below the names of columns.
const TYPES: &str = "i8|i16|i32|i64|u8|u16|u32|u64|f32|f64|str|bool|int8|int16|int32|int64|float|double|varchar|boolean|date|\
    timestamp|time|cat";

/// The frame of the first lines; `None` if they have none, or the user said another delimiter.
pub(crate) fn find(head: &Head, said: &Dialect) -> Option<Frame> {
    let lines: Vec<&str> = head.filled_lines().collect();
    let is_said = |frame: &Frame| match (&said.delimiter, frame.delimiter()) {
        (Some(said), Some(own)) => said == own,
        _ => true,
    };
    ALL.into_iter().filter(is_said).find(|frame| frame.holds(&lines))
}

impl Frame {
    /// What the format is called.
    pub(crate) fn format(self) -> &'static str {
        match self {
            Self::Bars => "table between bars",
            Self::Boxes => "table in boxes",
            Self::Latex => "LaTeX",
            Self::Quotes => "lines in quotes",
            Self::Records => "JSON sequence",
        }
    }

    /// What separates cells within the frame.
    pub(crate) fn delimiter(self) -> Option<&'static str> {
        match self {
            Self::Bars | Self::Boxes => Some("|"),
            Self::Latex => Some("&"),
            Self::Quotes | Self::Records => None,
        }
    }

    /// Whether nearly all lines from the first of a frame on have it.
    fn holds(self, lines: &[&str]) -> bool {
        let Some(first) = lines.iter().position(|line| self.has(line)) else {
            return false;
        };
        let lines = &lines[first..];
        let rows: Vec<&&str> = lines
            .iter()
            .filter(|line| self.has(line) && !self.plain(line).is_empty())
            .collect();
        let rules = lines.iter().filter(|line| self.plain(line).is_empty()).count();
        let count = |line: &str| {
            self.delimiter()
                .map_or(1, |mark| self.plain(line).matches(mark).count())
        };
        let are_alike = || rows.iter().filter(|row| count(row) == count(rows[0])).count() * 10 >= rows.len() * 9;
        let is_whole = rows.len() >= 2 && 10 * (rows.len() + rules) >= 8 * lines.len() && are_alike();
        is_whole
            && match self {
                Self::Quotes => first == 0 && self.are_tables(&rows),
                Self::Records => first == 0,
                _ => count(rows[0]) > 0 || rules > 0,
            }
    }

    /// Whether a line stands in the frame.
    fn has(self, line: &str) -> bool {
        match self {
            Self::Bars => line.len() > 2 && line.starts_with('|') && line.ends_with('|') && !self.is_rule(line),
            Self::Boxes => line.chars().count() > 2 && line.starts_with(is_upright) && line.ends_with(is_upright),
            Self::Latex => line.contains('&') && line.contains(r"\\"),
            Self::Quotes => {
                let inner = line.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
                inner.is_some_and(|inner| inner.contains([',', ';', '\t']) && !inner.replace("\"\"", "").contains('"'))
            }
            Self::Records => line.starts_with(RECORD),
        }
    }

    /// Whether a line is a rule or a command, without cells.
    fn is_rule(self, line: &str) -> bool {
        match self {
            Self::Bars => {
                line.starts_with(['|', '+']) && line.contains(['-', '=']) && line.chars().all(|c| "|+-=: ".contains(c))
            }
            Self::Boxes => line.chars().all(|c| is_drawn(c) || c == ' '),
            Self::Latex => line.starts_with(['\\', '%', '}']) && !line.contains('&'),
            Self::Quotes | Self::Records => false,
        }
    }

    /// Whether lines in quotes hold a table: each has as many marks between cells as the first, and every later one a number or a time.
    fn are_tables(self, rows: &[&&str]) -> bool {
        let texts: Vec<String> = rows.iter().map(|line| self.plain(line)).collect();
        let is_value = |cell: &str| {
            let cell = cell.trim().trim_matches('"');
            number::read(cell.as_bytes(), number::Syntax::default()).is_ok() || guess::looks_like_time(cell)
        };
        [',', ';', '\t'].iter().any(|mark| {
            let count = texts[0].matches(*mark).count();
            count > 0
                && texts.iter().all(|text| text.matches(*mark).count() == count)
                && texts[1..].iter().all(|text| text.split(*mark).any(is_value))
        })
    }

    /// The cells of a line, with the delimiter between them; the line as it is if it stands in no frame.
    fn plain(self, line: &str) -> String {
        let text = line.trim();
        if self.is_rule(text) {
            return String::new();
        }
        if !self.has(text) {
            return line.to_owned();
        }
        match self {
            Self::Bars => bare(text[1..text.len() - 1].split('|')),
            Self::Boxes => {
                let inner = text.trim_start_matches(is_upright).trim_end_matches(is_upright);
                bare(inner.split(is_between))
            }
            Self::Latex => {
                let row = text.rfind(r"\\").map_or(text, |end| &text[..end]);
                let row = [r"\hline", r"\toprule", r"\midrule"]
                    .iter()
                    .fold(row, |row, command| row.trim_start().trim_start_matches(command));
                row.replace(r"\%", "%").replace(r"\_", "_").replace('$', "")
            }
            Self::Quotes => text[1..text.len() - 1].replace("\"\"", "\""),
            Self::Records => text.trim_start_matches(RECORD).to_owned(),
        }
    }
}

/// Cells between bars, without marks of bold type and of code; nothing if they are the types of columns.
fn bare<'a>(cells: impl Iterator<Item = &'a str>) -> String {
    let marked = |cell: &'a str| {
        let cell = cell.trim();
        ["**", "`"]
            .iter()
            .find_map(|mark| cell.strip_prefix(mark)?.strip_suffix(mark))
            .unwrap_or(cell)
    };
    let cells: Vec<&str> = cells.map(marked).collect();
    let is_type = |cell: &&str| is_one_of(TYPES, cell.split('[').next().unwrap_or(cell));
    if cells.iter().all(|cell| *cell == "---") || cells.iter().all(is_type) {
        return String::new();
    }
    cells.join("|")
}

fn is_upright(c: char) -> bool {
    matches!(c, '│' | '┃' | '║')
}

fn is_between(c: char) -> bool {
    is_upright(c) || c == '┆'
}

fn is_drawn(c: char) -> bool {
    ('\u{2500}'..='\u{257f}').contains(&c)
}

/// Lines of a frame as lines of cells.
pub(crate) struct Framed {
    source: Box<dyn BufRead + Send>,
    frame: Frame,
    /// The last byte of lines.
    end: u8,
    /// Lines of cells that are not handed out yet, from `at` on.
    lines: Vec<u8>,
    at: usize,
}

impl Framed {
    /// A reader of the bytes that were read, and of those behind them.
    pub(crate) fn new(head: &Head, rest: Box<dyn BufRead + Send>, frame: Frame) -> Self {
        let (first, end) = (head.bytes.as_slice(), head.end);
        let whole = first.iter().rposition(|c| *c == end).map_or(0, |last| last + 1);
        let (lines, begun) = first.split_at(whole);
        Self {
            lines: lines
                .split_inclusive(|c| *c == end)
                .flat_map(|line| plain(frame, line))
                .collect(),
            source: Box::new(Cursor::new(begun.to_vec()).chain(rest)),
            frame,
            end,
            at: 0,
        }
    }
}

/// A line with its end. What is no text is left as it is, and refused by those that read it.
fn plain(frame: Frame, line: &[u8]) -> Vec<u8> {
    let end = line
        .iter()
        .rposition(|c| !matches!(c, b'\r' | b'\n'))
        .map_or(0, |last| last + 1);
    match std::str::from_utf8(&line[..end]) {
        Ok(text) => [frame.plain(text).as_bytes(), &line[end..]].concat(),
        Err(_) => line.to_vec(),
    }
}

impl Read for Framed {
    fn read(&mut self, target: &mut [u8]) -> std::io::Result<usize> {
        if self.at == self.lines.len() {
            let mut line = Vec::new();
            self.source
                .by_ref()
                .take(MAX_LINE as u64)
                .read_until(self.end, &mut line)?;
            (self.lines, self.at) = (plain(self.frame, &line), 0);
        }
        let count = target.len().min(self.lines.len() - self.at);
        target[..count].copy_from_slice(&self.lines[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}
