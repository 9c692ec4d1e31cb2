//! Detection of a dialect from the first lines of a table.

use crate::delimiter::{cells, delimiter, modal, names_its_rows, splits_its_times};
use crate::dialect::{Delimiter, Dialect};
use crate::error::Error;
use crate::head::Head;
use crate::lines::{MAX_ROW_LINES, Split};
use crate::{above, guess, known, limits, marks, missing, number};

/// What a cell looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Look {
    Missing,
    Number,
    Time,
    Text,
}

fn look(cell: &str, decimal_comma: bool) -> Look {
    let syntax = number::Syntax {
        decimal: if decimal_comma { b',' } else { b'.' },
        thousands: None,
    };
    if missing::is_usual(cell, true) {
        Look::Missing
    } else if number::read(cell.as_bytes(), syntax) != Err(number::Fault::NoNumber)
        || limits::parse(cell, syntax).is_some()
    {
        // A number that no double holds is one all the same, not a name, and refused when it is read; as is a limit, `<0.25`.
        Look::Number
    } else if guess::looks_like_time(cell) {
        Look::Time
    } else {
        Look::Text
    }
}

/// What the first lines say beyond the dialect.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// Line number and cells of the names.
    pub(crate) names: Option<(u64, Vec<String>)>,
    /// Cells of the row of units.
    pub(crate) units: Vec<String>,
    /// The first line that may be data.
    pub(crate) first_line: u64,
}

/// Fills what is not said, and finds the line of names.
pub(crate) fn detect(head: &Head, dialect: &mut Dialect) -> Result<Layout, Error> {
    known::recognise(&head.lines, dialect);
    let mark = dialect
        .comment
        .get_or_insert_with(|| marks::of_comments(&head.lines).to_owned())
        .clone();
    let is_comment = |line: &str| !mark.is_empty() && line.starts_with(mark.as_str());
    let mut lines: Vec<(u64, &str)> = head
        .lines
        .iter()
        .map(|(number, line)| (*number, line.as_str()))
        .collect();
    let mut is_marked = false;
    if let Some((_, first)) = lines.first()
        && let Some(delimiter) = first.trim_matches([' ', '"', '\r']).strip_prefix("sep=")
    {
        dialect.delimiter.get_or_insert(delimiter.to_owned());
        // What stands behind it is looked at like any other table, unless the user counted the lines.
        if dialect.skip.is_none() {
            lines.remove(0);
            is_marked = true;
        }
    }
    let comments: Vec<(u64, &str)> = lines.iter().filter(|(_, line)| is_comment(line)).copied().collect();
    lines.retain(|(_, line)| !is_comment(line));
    // Lines that are skipped count without comments.
    if let Some(skip) = dialect.skip {
        lines.drain(..lines.len().min(usize::try_from(skip).unwrap_or(usize::MAX)));
    }
    let joined = joined(&lines);
    let lines: Vec<(u64, &str)> = joined.iter().map(|(number, line)| (*number, line.as_str())).collect();
    let filled: Vec<&str> = lines
        .iter()
        .map(|(_, line)| *line)
        .filter(|line| !line.trim().is_empty())
        .collect();
    if dialect.quote.is_none() {
        dialect.quote = Some(marks::quote(&filled));
    }
    let quote = dialect.quote.map_or(b'"', |mark| mark as u32 as u8);
    let delimiter = match &dialect.delimiter {
        Some(text) => Delimiter::parse(text)?,
        None => delimiter(&filled, quote),
    };
    dialect.delimiter = Some(delimiter.shown());
    let split = Split { delimiter, quote };
    let count = modal(&filled, split).0;
    let mut rows: Vec<(u64, Vec<String>)> = lines
        .iter()
        .map(|(number, line)| (*number, cells(line, split)))
        .filter(|(_, cells)| cells.len() > 1 || cells.iter().any(|cell| !cell.is_empty()))
        .collect();
    if names_its_rows(&filled, split) {
        // The names of rows have no name.
        rows[0].1.insert(0, String::new());
    }
    if let Some(at) = splits_its_times(&filled, split) {
        // A space stands between date and time of day, which have one name, and perhaps names of rows in front.
        let names = &mut rows[0].1;
        (0..at).for_each(|i| names.insert(i, String::new()));
        names.insert(at, "date".to_owned());
    }
    if let (None, Some(mark @ ('.' | ','))) = (dialect.decimal, dialect.thousands) {
        // One mark does not stand for both.
        dialect.decimal = Some(if mark == '.' { ',' } else { '.' });
    }
    if dialect.decimal.is_none() {
        let is_comma = delimiter != Delimiter::Byte(b',') && marks::has_decimal_commas(&rows);
        if let (false, None, Some((line, cell))) = (is_comma, dialect.thousands, marks::doubtful_groups(&rows)) {
            return Err(Error::line(
                line,
                format!("`{cell}` may have a point between groups of digits, or before decimals"),
                "say --thousands . (and --decimal ,) for groups, or --decimal . for decimals",
            ));
        }
        dialect.decimal = Some(if is_comma { ',' } else { '.' });
    }
    let lines_before = |number: u64| lines.iter().filter(|(line, _)| *line < number).count() as u64;
    let found = layout(&rows, &comments, count, split, dialect, &lines_before);
    if is_marked {
        *dialect.skip.get_or_insert(0) += 1;
    }
    found
}

/// Lines with those that follow within an open quote.
fn joined(lines: &[(u64, &str)]) -> Vec<(u64, String)> {
    let quotes = |line: &str| line.bytes().filter(|c| *c == b'"').count();
    let (mut rows, mut at) = (Vec::new(), 0);
    while at < lines.len() {
        let (number, first) = lines[at];
        let mut count = quotes(first);
        let limit = lines.len().min(at + 1 + MAX_ROW_LINES);
        let end = (at + 1..limit).find(|end| {
            let is_closed = count % 2 == 0;
            count += quotes(lines[*end].1);
            is_closed
        });
        // A quote that never closes is a mark like others.
        let end = if quotes(first) % 2 == 0 {
            at + 1
        } else {
            end.or((count % 2 == 0).then_some(limit)).unwrap_or(at + 1)
        };
        let text: Vec<&str> = lines[at..end].iter().map(|(_, line)| *line).collect();
        rows.push((number, text.join("\n")));
        at = end;
    }
    rows
}

/// Finds the line of names: the last one before the data that has no number, units not counted.
fn layout(
    rows: &[(u64, Vec<String>)],
    comments: &[(u64, &str)],
    count: usize,
    split: Split,
    dialect: &mut Dialect,
    lines_before: &dyn Fn(u64) -> u64,
) -> Result<Layout, Error> {
    let Some((first_number, first)) = rows.first() else {
        // Comments alone, or nothing.
        dialect.skip.get_or_insert(0);
        return Ok(Layout::default());
    };
    let comma = dialect.decimal == Some(',');
    let looks: Vec<Vec<Look>> = rows
        .iter()
        .map(|(_, cells)| cells.iter().map(|cell| look(cell, comma)).collect())
        .collect();
    // Columns of numbers or times in most of the later rows.
    let later = &looks[looks.len() / 2..];
    let is_measured = |column: usize| {
        let (mut yes, mut no) = (0, 0);
        for look in later.iter().filter_map(|row| row.get(column)) {
            match look {
                Look::Number | Look::Time => yes += 1,
                Look::Text => no += 1,
                Look::Missing => {}
            }
        }
        yes > no
    };
    let measured: Vec<usize> = (0..count).filter(|column| is_measured(*column)).collect();
    // A row has its time: one without is among the settings above the data, numbers or not.
    let is_timed = |column: &usize| {
        let times = later.iter().filter(|row| row.get(*column) == Some(&Look::Time)).count();
        5 * times >= 4 * later.len()
    };
    let timed: Vec<usize> = measured.iter().copied().filter(is_timed).collect();
    let is_data = |row: &Vec<Look>| {
        row.len() >= count
            && timed.iter().all(|column| row[*column] == Look::Time)
            && measured.iter().all(|column| row[*column] != Look::Text)
            && row.iter().any(|look| matches!(look, Look::Number | Look::Time))
    };
    let has_header_said = dialect.no_header == Some(false) || dialect.skip.is_some();
    if dialect.no_header == Some(true) {
        dialect.skip.get_or_insert(0);
        return Ok(Layout {
            first_line: *first_number,
            ..Layout::default()
        });
    }
    // Names may stand in the last comment before the data, or above one with units.
    let in_comment = || {
        let mark = dialect.comment.as_deref().unwrap_or("#");
        let texts = |line: &str| {
            let names = cells(line.trim_start_matches(mark).trim(), split);
            let is_name =
                |name: &String| look(name, comma) == Look::Text || missing::is_usual(name, true) && !name.is_empty();
            (names.len() == first.len() && names.iter().all(is_name)).then_some(names)
        };
        let before = comments.iter().rev().filter(|(number, _)| number < first_number);
        let mut before = before.filter(|(_, line)| !line.trim_start_matches(mark).trim().is_empty());
        let (number, line) = before.next()?;
        let names = texts(line)?;
        let above = before.next().and_then(|(number, line)| Some((*number, texts(line)?)));
        match above {
            Some((number, above)) if known::are_units(&names) => Some((number, above, names)),
            _ => Some((*number, names, Vec::new())),
        }
    };
    let in_comment = if looks.first().is_some_and(is_data) {
        in_comment()
    } else {
        None
    };
    if let Some((number, names, units)) = in_comment {
        dialect.skip.get_or_insert(0);
        dialect.no_header.get_or_insert(false);
        return Ok(Layout {
            names: Some((number, names)),
            units,
            first_line: *first_number,
        });
    }
    if has_header_said {
        return Ok(from_header(rows, 0, dialect));
    }
    let data = looks.iter().position(is_data);
    match data {
        Some(0) => Err(Error::line(
            *first_number,
            "there is no line of names: the first line is a row of numbers",
            "say --no-header if it is a row, or --skip 0 if these are the names",
        )),
        Some(data) => {
            let mut header = data - 1;
            // A row of gaps is no line of names.
            let is_ruled = |i: usize| split.delimiter == Delimiter::Byte(b'|') && marks::is_ruler(&rows[i].1);
            let is_gap = |i: &usize| looks[*i].iter().all(|look| *look == Look::Missing) && !is_ruled(*i);
            let above = (0..header).rev().find(|i| !is_gap(i));
            let above = above.filter(|i| looks[*i].len() >= count && looks[*i].contains(&Look::Text));
            if is_gap(&header) {
                header = above.unwrap_or(header);
            }
            // Lines of marks below the names, as programs of databases draw them.
            let mut rulers = 0;
            while header > 0 && marks::is_ruler(&rows[header].1) {
                (header, rulers) = (header - 1, rulers + 1);
            }
            if rulers > 0 {
                dialect.skip_after_names.get_or_insert(rulers);
                dialect.units_row.get_or_insert(false);
            } else if dialect.units_row.is_none() && dialect.skip_after_names.is_none() {
                let is_units = header > 0
                    && above::filled(&rows[header - 1].1) == above::filled(&rows[header].1)
                    && looks[header - 1].first() != Some(&Look::Number)
                    && !looks[header - 1].contains(&Look::Time)
                    && looks[header - 1].contains(&Look::Text)
                    && (known::are_units(&rows[header].1) || known::are_units_behind(&rows[header].1));
                dialect.units_row = Some(is_units);
                header -= usize::from(is_units);
                // Units above a line of other words, as numbers of sensors, and names above both.
                let has_words_below = !is_units
                    && header > 1
                    && known::are_units(&rows[header - 1].1)
                    && rows[header - 1].1.len() == rows[header].1.len()
                    && looks[header - 2].len() == looks[header].len()
                    && looks[header - 2].iter().all(|look| *look == Look::Text);
                if has_words_below {
                    (dialect.units_row, dialect.skip_after_names) = (Some(true), Some(1));
                    header -= 2;
                }
            } else {
                let behind =
                    usize::from(dialect.units_row == Some(true)) + dialect.skip_after_names.unwrap_or(0) as usize;
                header = header.saturating_sub(behind);
            }
            // Rows with a fault are no names: these are the nearest line above of words alone.
            let is_row = |row: &Vec<Look>| {
                row.len() >= count
                    && measured
                        .iter()
                        .any(|i| matches!(row.get(*i), Some(Look::Number | Look::Time)))
            };
            let are_names = |row: &Vec<Look>| row.len() >= count && row[..count].iter().all(|look| *look == Look::Text);
            let above = (0..header).rev().find(|i| !is_row(&looks[*i]));
            if let Some(above) = above.filter(|above| is_row(&looks[header]) && are_names(&looks[*above])) {
                header = above;
            }
            // A title or settings above the names are skipped; a short line above the data is no line of names.
            while header > 0 && rows[header].1.len() < count && rows[header - 1].1.len() >= count {
                if known::are_units(&rows[header].1) {
                    *dialect.skip_after_names.get_or_insert(0) += 1;
                }
                header -= 1;
            }
            if count > 1 && rows[header].1.len() == 1 {
                return Err(Error::line(
                    rows[data].0,
                    format!(
                        "there is no line of names: this row has {count} cells, and the line above has 1 ({} lines stand above)",
                        lines_before(rows[data].0)
                    ),
                    "say --no-header, and --skip with the number of lines above; or what separates cells with --delimiter",
                ));
            }
            let is_numeric = |look: &Look| matches!(look, Look::Number | Look::Time);
            let may_be_row = |i: usize| {
                let row = &looks[i];
                row.len() >= 2
                    && is_numeric(&row[0])
                    && row[1..].iter().any(is_numeric)
                    && row.len() == looks[i - 1].len()
            };
            // Above one row, the names of another table must stand: it shares most of its names with this one.
            let names = &rows[header].1;
            let are_shared = |i: usize| {
                let above: Vec<&String> = rows[i].1.iter().filter(|name| !name.is_empty()).collect();
                let shared = above.iter().filter(|name| names.contains(name)).count();
                shared >= 2 && 2 * shared > above.len()
            };
            let begins =
                |i: &usize| may_be_row(*i) && are_shared(i - 1) || i + 3 <= header && (*i..i + 3).all(may_be_row);
            if let Some(first) = (1..header).find(begins) {
                return Err(several_tables(rows[first].0));
            }
            dialect.skip = Some(lines_before(rows[header].0));
            let mut found = from_header(rows, header, dialect);
            if let Some((_, names)) = &mut found.names {
                let is_name = |name: &str| look(name, comma) == Look::Text;
                above::take_names(names, &rows[..header], above::filled(&rows[data].1), is_name);
            }
            Ok(found)
        }
        None => {
            dialect.skip = Some(0);
            Ok(from_header(rows, 0, dialect))
        }
    }
}

/// Rows above the line of names, which would be left out as settings are.
fn several_tables(line: u64) -> Error {
    Error::line(
        line,
        "rows of numbers stand above the line of names, as if this were a table before another",
        "make a file of each table; if these are settings, say --skip with the number of lines above the names",
    )
}

fn from_header(rows: &[(u64, Vec<String>)], header: usize, dialect: &mut Dialect) -> Layout {
    let mut next = header + 1;
    let mut units = Vec::new();
    if *dialect.units_row.get_or_insert(false) {
        units = rows.get(next).map(|(_, cells)| cells.clone()).unwrap_or_default();
        next += 1;
    }
    next += usize::try_from(*dialect.skip_after_names.get_or_insert(0)).unwrap_or(0);
    dialect.no_header.get_or_insert(false);
    let (number, names) = rows[header].clone();
    let last = rows[(next - 1).min(rows.len() - 1)].0;
    Layout {
        names: Some((number, names)),
        units,
        first_line: rows.get(next).map_or(last + 1, |(number, _)| *number),
    }
}
