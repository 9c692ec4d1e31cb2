//! Opening a table: from bytes to rows with a known dialect.

use crate::column::Column;
use crate::detect::{self, Layout};
use crate::dialect::{Delimiter, Dialect};
use crate::error::{Error, Place};
use crate::head::Head;
use crate::lines::{Line, Lines, Row, Split};
use crate::plain::Scanner;
use crate::profile::Profile;
use crate::table::Table;
use crate::{json, known, names, number, source};
use std::io::{BufRead, Cursor, Read};

/// The mark of UTF-8.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Rows of a text.
pub(crate) struct Rows {
    lines: Lines,
    split: Split,
    comment: Vec<u8>,
    /// Whether a comment with as many cells as a row is refused, because it may be one.
    doubts_comments: bool,
    /// Keys of objects, if lines are JSON, and whether others are ignored.
    keys: Option<Vec<String>>,
    header: Vec<String>,
    /// Cells of the lines before the data.
    preamble: Vec<Vec<String>>,
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
            if row.text.starts_with(MARK) {
                // The mark of an encoding, where files were joined.
                row.text.drain(..MARK.len());
            }
            if !row.text.is_empty() && row.text.iter().all(|c| matches!(c, 0x1a | 0x0c)) {
                // The end of a file of DOS, and of a printed page.
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
            return Err(Error::Line {
                place: Place { line, row: 0 },
                problem: "a comment with as many cells as a row".to_owned(),
                mend: "say --comment '#' if it is one, or --comment '' if it is a row",
            });
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
        let s = if count == 1 { "" } else { "s" };
        Err(Error::Line {
            place: Place { line: row.line, row: 0 },
            problem: format!("{count} cell{s} instead of {columns}"),
            mend: if count < columns {
                "mend the row, leave such rows out with --skip-bad, take what they lack as gaps with --short-rows, or say what separates \
                 cells with --delimiter"
            } else {
                "mend the row, leave such rows out with --skip-bad, or say what separates cells with --delimiter"
            },
        })
    }
}

impl Table {
    /// Opens a table of text: CSV and its relatives, or lines of JSON; plain, or packed if the features `gzip` and `zstd` are on. What
    /// `said` leaves open is detected from the first lines. All columns are selected; [`set_time`](Self::set_time) or
    /// [`find_time`](Self::find_time) takes the time out of them.
    ///
    /// # Errors
    /// If the source cannot be read, is no table of text, has no line of names, or `said` has settings that do not go together.
    pub fn open(source: impl Read + Send + 'static, said: &Dialect) -> Result<Self, Error> {
        let mut dialect = said.clone().checked()?;
        let (mut reader, encoding) = source::text(Box::new(source), said.encoding.as_deref())?;
        dialect.encoding = dialect.encoding.or(encoding);
        let head = Head::read(&mut *reader)?;
        let first = head.bytes.iter().copied().find(|c| !c.is_ascii_whitespace());
        let is_object = first == Some(b'{') && said.delimiter.is_none();
        if first == Some(b'[') && head.bytes.contains(&b'{') {
            return Err(Error::Format {
                what: "JSON, a list",
                mend: "make lines of its objects: jq -c '.[]' FILE | fewbits ... -",
            });
        }
        if first == Some(b'<') {
            return Err(Error::Format {
                what: "a page of HTML, or XML",
                mend: "export the table as CSV",
            });
        }
        let (rows, columns) = if is_object {
            of_json(&head, reader, &mut dialect)?
        } else {
            of_text(&head, reader, &mut dialect, said)?
        };
        let profiles = first_profiles(&head, &rows, &columns, &dialect);
        Self::new(rows, dialect, columns, profiles)
    }
}

fn lines_of(head: &Head, reader: Box<dyn BufRead + Send>) -> Lines {
    Lines::new(Box::new(Cursor::new(head.bytes.clone()).chain(reader)), head.end)
}

fn of_json(head: &Head, reader: Box<dyn BufRead + Send>, dialect: &mut Dialect) -> Result<(Rows, Vec<Column>), Error> {
    let mut keys: Vec<String> = Vec::new();
    let lines = || head.lines.iter().filter(|(_, line)| !line.trim().is_empty());
    for (number, line) in lines() {
        let pairs = match json::flattened(line, *number) {
            Ok(pairs) if lines().nth(1).is_none() => json::alone(pairs)?,
            Ok(pairs) => pairs,
            Err(_) if *number > 1 => continue,
            Err(_) => {
                return Err(Error::Format {
                    what: "JSON that is not one object a line",
                    mend: "make lines of its objects: jq -c . FILE | fewbits ... -",
                });
            }
        };
        for (key, _) in pairs {
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
    }
    dialect.format = Some("JSON lines".to_owned());
    dialect.decimal = Some('.');
    let columns = named(&keys, &[]);
    let rows = Rows {
        lines: lines_of(head, reader),
        split: Split {
            delimiter: Delimiter::Byte(b','),
            quote: b'"',
        },
        comment: Vec::new(),
        doubts_comments: false,
        keys: Some(keys),
        header: Vec::new(),
        preamble: Vec::new(),
    };
    Ok((rows, columns))
}

fn of_text(
    head: &Head,
    reader: Box<dyn BufRead + Send>,
    dialect: &mut Dialect,
    said: &Dialect,
) -> Result<(Rows, Vec<Column>), Error> {
    if head.lines.iter().all(|(_, line)| line.trim().is_empty()) {
        return Err(Error::Empty);
    }
    let Layout {
        names,
        units,
        first_line,
    } = detect::detect(head, dialect)?;
    let delimiter = Delimiter::parse(dialect.delimiter.as_deref().unwrap_or(","))?;
    let split = Split {
        delimiter,
        quote: dialect.quote.map_or(b'"', |mark| mark as u32 as u8),
    };
    let comment = dialect.comment.clone().unwrap_or_default();
    let mut rows = Rows {
        lines: lines_of(head, reader),
        split,
        doubts_comments: said.comment.is_none() && dialect.format.is_none(),
        comment: comment.into_bytes(),
        keys: None,
        header: Vec::new(),
        preamble: Vec::new(),
    };
    // Lines before the data, as their cells.
    let mut row = Row::default();
    while rows.lines.line() + 1 < first_line {
        let Some(found) = rows.lines.next(&mut row.text)? else {
            break;
        };
        if split.complete(&mut rows.lines, &mut row, &found).is_ok() {
            rows.preamble.push(row.texts());
        }
    }
    let width = || {
        let widths = head
            .lines
            .iter()
            .filter(|(number, _)| *number >= first_line)
            .map(|(_, line)| {
                let mut row = Row {
                    text: line.as_bytes().to_vec(),
                    ..Row::default()
                };
                split.split(&mut row);
                (0..row.cells.len())
                    .rev()
                    .find(|i| !row.cell(*i).is_empty())
                    .map_or(0, |last| last + 1)
            });
        widths.collect::<Vec<usize>>()
    };
    let own_names = match names {
        Some((_, mut names)) => {
            // Behind the last name, cells may be empty in all rows.
            let widths = width();
            while names.last().is_some_and(String::is_empty)
                && names.len() > 1
                && widths.iter().all(|width| *width < names.len())
            {
                names.pop();
            }
            names
        }
        None if dialect.no_header == Some(true) => {
            let mut widths = width();
            widths.sort_unstable();
            let width = widths.get(widths.len() / 2).copied().unwrap_or(0);
            known::names(dialect.format.as_deref().unwrap_or(""), &head.lines, width)
        }
        None => Vec::new(),
    };
    if own_names.is_empty() {
        return Err(Error::Empty);
    }
    if dialect.encoding.is_none() && own_names.iter().any(|name| name.contains('\u{fffd}')) {
        return Err(Error::Line {
            place: Place {
                line: first_line.saturating_sub(1).max(1),
                row: 0,
            },
            problem: "the names are not text in UTF-8".to_owned(),
            mend: "say how they are written, as --encoding latin1",
        });
    }
    rows.header.clone_from(&own_names);
    let columns = named(&own_names, &units);
    Ok((rows, columns))
}

fn named(own_names: &[String], units: &[String]) -> Vec<Column> {
    let names = names::distinct(own_names);
    let column = |(i, name): (usize, String)| Column {
        name,
        own_name: own_names[i].clone(),
        unit: units
            .get(i)
            .map(|unit| unit.trim_matches(['(', ')', '[', ']']).to_owned())
            .unwrap_or_default(),
        kind: crate::Kind::Number,
    };
    names.into_iter().enumerate().map(column).collect()
}

/// Profiles of the columns over the whole lines of the head.
fn first_profiles(head: &Head, rows: &Rows, columns: &[Column], dialect: &Dialect) -> Vec<Profile> {
    let mut profiles = Profile::of_columns(columns.len());
    let byte = |mark: char| mark as u32 as u8;
    let syntax = number::Syntax {
        decimal: dialect.decimal.map_or(b'.', byte),
        thousands: dialect.thousands.map(byte),
    };
    let gaps: Vec<_> = columns
        .iter()
        .map(|column| dialect.missing_of(&column.name, &column.own_name))
        .collect();
    let from = rows.lines.line();
    let whole = head.lines.iter().filter(|(number, _)| *number > from);
    let text = whole
        .flat_map(|(_, line)| line.bytes().chain([head.end]))
        .collect::<Vec<u8>>();
    let mut first = Rows {
        lines: Lines::new(Box::new(Cursor::new(text)), head.end),
        split: rows.split,
        comment: rows.comment.clone(),
        doubts_comments: false,
        keys: rows.keys.clone(),
        header: rows.header.clone(),
        preamble: Vec::new(),
    };
    let mut row = Row::default();
    loop {
        match first.next(&mut row) {
            Ok(None) => break,
            Ok(Some(())) if row.cells.len() >= columns.len() && !first.is_header_again(&row) => {
                let place = Place {
                    line: from + row.line,
                    row: 0,
                };
                for (i, profile) in profiles.iter_mut().enumerate() {
                    profile.add(row.cell_text(i), place, syntax, &gaps[i], dialect.strip_units);
                }
            }
            _ => {}
        }
    }
    profiles.iter_mut().for_each(Profile::settle);
    profiles
}
