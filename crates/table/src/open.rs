//! Opening a table: from bytes to rows with a known dialect.

use crate::column::Column;
use crate::delimiter::other_mark;
use crate::detect::{self, Layout};
use crate::dialect::{Delimiter, Dialect};
use crate::error::{Error, Place};
use crate::framed::{self, Framed};
use crate::head::{self, Head};
use crate::json::{self, Keys, Pairs};
use crate::lines::{Lines, Row, Split};
use crate::profile::Profile;
use crate::rows::Rows;
use crate::table::Table;
use crate::{influx, known, labelled, logs, names, source};
use std::io::{BufRead, BufReader, Cursor, Read};

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
        let mut head = Head::read(&mut *reader)?;
        if let Some(frame) = framed::find(&head, said) {
            dialect.format.get_or_insert(frame.format().to_owned());
            if let Some(mark) = frame.delimiter() {
                dialect.delimiter.get_or_insert(mark.to_owned());
            }
            let framed = Framed::new(&head, reader, frame);
            reader = Box::new(BufReader::with_capacity(head::MAX_BYTES, framed));
            head = Head::read(&mut *reader)?;
        }
        if head.lines.is_empty() && head.bytes.len() >= head::MAX_BYTES {
            return Err(Error::line(
                1,
                format!("the first {} bytes have no end of a line", head.bytes.len()),
                "take some of the columns, as: cut -d, -f1-1000 FILE | fewbits ... -",
            ));
        }
        let first = head.bytes.iter().copied().find(|c| !c.is_ascii_whitespace());
        let is_object = first == Some(b'{') && said.delimiter.is_none();
        let coloured = head.filled_lines().filter(|line| line.contains("\u{1b}[")).count();
        if 2 * coloured > head.filled_lines().count() {
            return Err(Error::Format {
                what: "text with colours of a terminal",
                mend: "take them out: sed 's/\\x1b\\[[0-9;]*[A-Za-z]//g' FILE | fewbits ... -",
            });
        }
        if first == Some(b'[') && head.bytes.contains(&b'{') {
            return Err(Error::Format {
                what: "JSON, a list",
                mend: "make lines of its objects: jq -c '.[]' FILE | fewbits ... -",
            });
        }
        if first == Some(b'[')
            && said.delimiter.is_none()
            && head.bytes.iter().filter(|c| !c.is_ascii_whitespace()).nth(1) == Some(&b'[')
        {
            return Err(Error::Format {
                what: "JSON, a list of lists",
                mend: "make a table of it: jq -r '.[] | @csv' FILE | fewbits ... --no-header -",
            });
        }
        if first == Some(b'<') {
            return Err(logs::refusal(&head).unwrap_or(Error::Format {
                what: "a page of HTML, or XML",
                mend: "export the table as CSV",
            }));
        }
        let is_labelled = || {
            said.delimiter.is_none() && said.no_header.is_none() && said.skip.is_none() && labelled::is_labelled(&head)
        };
        let (rows, columns) = if is_object {
            of_json(&head, reader, &mut dialect)?
        } else if said.delimiter.is_none() && influx::has_topics(&head) {
            of_keys(&head, reader, &mut dialect, "JSON behind topics", influx::topic_pairs)?
        } else if is_labelled() {
            of_keys(&head, reader, &mut dialect, "names before cells", labelled::pairs)?
        } else if said.delimiter.is_none() && said.skip.is_none() && influx::is_protocol(&head) {
            of_keys(&head, reader, &mut dialect, "InfluxDB line protocol", influx::pairs)?
        } else {
            let is_open = said.no_header.is_none() && said.skip.is_none();
            if let Some(refused) = logs::sure_refusal(&head).filter(|_| is_open && said.delimiter.is_none()) {
                return Err(refused);
            }
            of_text(&head, reader, &mut dialect, said)
                .map_err(|error| logs::refusal(&head).filter(|_| is_open).unwrap_or(error))?
        };
        let profiles = first_profiles(&head, &rows, &columns, &dialect);
        Self::new(rows, dialect, columns, profiles)
    }
}

fn lines_of(head: &Head, reader: Box<dyn BufRead + Send>) -> Lines {
    Lines::new(Box::new(Cursor::new(head.bytes.clone()).chain(reader)), head.end)
}

fn of_json(head: &Head, reader: Box<dyn BufRead + Send>, dialect: &mut Dialect) -> Result<(Rows, Vec<Column>), Error> {
    let lines: Vec<_> = filled(head).collect();
    let Some((number, first)) = lines.first() else {
        return Err(Error::Empty);
    };
    match json::flattened(first, *number) {
        Ok(pairs) if lines.len() == 1 => json::check_alone(&pairs)?,
        Err(_) if *number == 1 => {
            return Err(Error::Format {
                what: "JSON that is not one object a line",
                mend: "make lines of its objects: jq -c . FILE | fewbits ... -",
            });
        }
        _ => {}
    }
    dialect.decimal = Some('.');
    of_keys(head, reader, dialect, "JSON lines", json::flattened)
}

/// Lines of the head with a text.
fn filled(head: &Head) -> impl Iterator<Item = &(u64, String)> {
    head.lines.iter().filter(|(_, line)| !line.trim().is_empty())
}

/// Rows of lines that name their cells.
fn of_keys(
    head: &Head,
    reader: Box<dyn BufRead + Send>,
    dialect: &mut Dialect,
    format: &str,
    pairs: Pairs,
) -> Result<(Rows, Vec<Column>), Error> {
    let mut keys: Vec<String> = Vec::new();
    for (key, _) in filled(head)
        .filter_map(|(number, line)| pairs(line, *number).ok())
        .flatten()
    {
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    if keys.is_empty() {
        return Err(Error::Format {
            what: "JSON without a value",
            mend: "give objects of values, one a line",
        });
    }
    dialect.format = Some(format.to_owned());
    dialect.decimal.get_or_insert('.');
    let columns = named(&keys, &[]);
    let rows = Rows {
        lines: lines_of(head, reader),
        split: Split {
            delimiter: Delimiter::Byte(b','),
            quote: b'"',
        },
        comment: Vec::new(),
        doubts_comments: false,
        keys: Some(Keys { keys, pairs }),
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
            if dialect.format.as_deref() == Some(known::IAGA) {
                names.pop_if(|last| last == "|");
            }
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
    let names_line = first_line.saturating_sub(1).max(1);
    let refused = |problem: &str, mend: &'static str| Err(Error::line(names_line, problem, mend));
    let has = |marks: &[char]| own_names.iter().any(|name| name.contains(marks));
    if dialect.encoding.is_none() && has(&['\u{fffd}']) {
        return refused(
            "the names are not text in UTF-8",
            "say how they are written, as --encoding latin1, windows-1251, shift_jis or gbk",
        );
    }
    if has(&['\u{85}', '\u{2028}', '\u{2029}']) {
        return refused(
            "lines end with U+0085, U+2028 or U+2029",
            "write ends of lines: perl -CSD -pe 's/[\\x{85}\\x{2028}\\x{2029}]/\\n/g' FILE | fewbits ... -",
        );
    }
    let lines: Vec<&str> = head.filled_lines().collect();
    if own_names.len() == 1
        && said.delimiter.is_none()
        && let Some(mark) = other_mark(&lines)
    {
        return Err(Error::line(
            names_line,
            format!("one column, and `{mark}` stands as often in each line as in that of the names"),
            "name what separates cells with --delimiter; or say --delimiter , if this is one column",
        ));
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
    let syntax = dialect.marks();
    let gaps: Vec<_> = columns
        .iter()
        .map(|column| dialect.missing_of(&column.name, &column.own_name))
        .collect();
    for (profile, column) in profiles.iter_mut().zip(columns) {
        profile.meaning = dialect.meaning_of(column);
    }
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
            Ok(Some(()))
                if (row.cells.len() >= columns.len() || dialect.short_rows) && !first.is_header_again(&row) =>
            {
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
