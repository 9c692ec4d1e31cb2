//! Lines of JSON objects as rows: `{"Time": "...", "SI7021": {"Temperature": 20.0}}` has the columns `Time` and `SI7021.Temperature`.
//! Numbers keep their digits: they are read as text, as those of other tables.

use crate::error::{Error, printable};
use crate::lines::{Line, Row};
use crate::named::is_time_name;

/// Largest depth of objects and lists.
const MAX_DEPTH: usize = 16;

/// The keys and the text of all scalars of an object, in their order. `null` is an empty text.
pub(crate) fn flattened(line: &str, number: u64) -> Result<Vec<(String, String)>, Error> {
    // The lines of a list may end in its commas.
    let line = line.trim_end();
    let mut reader = Reader {
        text: line
            .strip_suffix("},")
            .map_or(line, |_| &line[..line.len() - 1])
            .as_bytes(),
        at: 0,
    };
    let mut pairs = Vec::new();
    let refused = |at: usize| {
        Error::line(
            number,
            format!("byte {} is not as in a line of JSON", at + 1),
            "one object stands on each line (jq -c '.[]' makes lines of a list); leave the line out with --skip-bad",
        )
    };
    let done = reader.value("", 0, &mut pairs).is_some() && reader.peek().is_none();
    if done { Ok(pairs) } else { Err(refused(reader.at)) }
}

/// Whether the only object is a row: it has no lists of one length, one of them of times, which are columns, and no list of objects with times.
pub(crate) fn check_alone(pairs: &[(String, String)]) -> Result<(), Error> {
    let mut lists: Vec<(&str, usize)> = Vec::new();
    for (key, _) in pairs {
        let Some((name, _)) = key.rsplit_once('.').filter(|(_, index)| index.parse::<usize>().is_ok()) else {
            continue;
        };
        match lists.last_mut().filter(|(last, _)| *last == name) {
            Some((_, count)) => *count += 1,
            None => lists.push((name, 1)),
        }
    }
    let is_time = |(name, rows): &&(&str, usize)| *rows > 1 && is_time_name(name.rsplit('.').next().unwrap_or(name));
    let rows = lists.iter().find(is_time).map(|(_, rows)| rows);
    if rows.is_some_and(|rows| lists.iter().filter(|(_, count)| count == rows).count() > 1) {
        return Err(Error::Format {
            what: "JSON, a list for each column",
            mend: "make a table of it: jq -r 'keys_unsorted, ([.[]] | transpose[]) | @csv' FILE | fewbits ... -, with `.hourly | ` \
                   before it, or the like, if the lists stand in an object",
        });
    }
    // A list of objects, each with a time of its own.
    let nth = |key: &str, index: &str| {
        let (list, field) = key.rsplit_once('.')?;
        let list = list.strip_suffix(index)?.strip_suffix('.')?;
        is_time_name(field).then(|| format!("{list}.1.{field}"))
    };
    let second = |(key, _): &(String, String)| {
        nth(key, "0").is_some_and(|second| pairs.iter().any(|(other, _)| *other == second))
    };
    if pairs.iter().any(second) {
        return Err(Error::Format {
            what: "JSON, a list of rows within an object",
            mend: "make lines of them, with the name of the list in place of readings: jq -c '.readings[]' FILE | fewbits ... -",
        });
    }
    Ok(())
}

/// Names and texts of a line, whose number is given.
pub(crate) type Pairs = fn(&str, u64) -> Result<Vec<(String, String)>, Error>;

/// The keys of lines that name their cells, and what reads one.
#[derive(Clone)]
pub(crate) struct Keys {
    pub(crate) keys: Vec<String>,
    pub(crate) pairs: Pairs,
}

/// A row of a line that names its cells: a cell for each key.
pub(crate) fn row(Keys { keys, pairs }: &Keys, row: &mut Row, found: &Line) -> Result<Option<()>, Error> {
    let Line::Text(line) = *found else {
        let (Line::Text(line) | Line::TooLong(line)) = *found;
        return Err(Error::line(line, "too long", "leave such lines out with --skip-bad"));
    };
    row.line = line;
    let text = String::from_utf8_lossy(&row.text).into_owned();
    row.cells = vec![(0, 0); keys.len()];
    if text.trim().is_empty() {
        row.cells.clear();
        return Ok(Some(()));
    }
    let pairs = pairs(&text, line)?;
    row.text.clear();
    for (key, value) in pairs {
        let Some(column) = keys.iter().position(|known| *known == key) else {
            if value.is_empty() {
                continue;
            }
            return Err(Error::line(
                line,
                format!("the key `{}` is in none of the first lines", printable(&key)),
                "put a line with all keys first, or leave such lines out with --skip-bad",
            ));
        };
        if row.cells[column].1 > 0 {
            return Err(Error::line(
                line,
                format!("the key `{}` stands twice", printable(&key)),
                "mend the line, or leave such lines out with --skip-bad",
            ));
        }
        let from = row.text.len();
        row.text.extend_from_slice(value.trim().as_bytes());
        row.cells[column] = (from as u32, row.text.len() as u32);
    }
    Ok(Some(()))
}

struct Reader<'a> {
    text: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn peek(&mut self) -> Option<u8> {
        while self.text.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
        self.text.get(self.at).copied()
    }

    fn take(&mut self, expected: u8) -> Option<()> {
        (self.peek()? == expected).then(|| self.at += 1)
    }

    fn value(&mut self, key: &str, depth: usize, pairs: &mut Vec<(String, String)>) -> Option<()> {
        match self.peek()? {
            _ if depth > MAX_DEPTH => None,
            b'{' => self.members(b'}', key, depth, pairs),
            // A row is an object.
            _ if depth == 0 => None,
            b'[' => self.members(b']', key, depth, pairs),
            b'"' => {
                let text = self.string()?;
                pairs.push((key.to_owned(), text));
                Some(())
            }
            _ => {
                let from = self.at;
                while self.text.get(self.at).is_some_and(|c| !b",]} \t".contains(c)) {
                    self.at += 1;
                }
                let word = std::str::from_utf8(&self.text[from..self.at]).ok()?;
                let word = match word {
                    "null" => "",
                    "true" | "false" | "NaN" | "Infinity" | "-Infinity" => word,
                    _ if word.parse::<f64>().is_ok() => word,
                    _ => return None,
                };
                pairs.push((key.to_owned(), word.to_owned()));
                Some(())
            }
        }
    }

    /// Members of an object, or of a list, whose keys are their numbers from 0.
    fn members(&mut self, end: u8, key: &str, depth: usize, pairs: &mut Vec<(String, String)>) -> Option<()> {
        self.at += 1;
        if self.peek()? == end {
            self.at += 1;
            return Some(());
        }
        for index in 0.. {
            let own = if end == b'}' {
                let name = self.peek().filter(|c| *c == b'"').and_then(|_| self.string())?;
                self.take(b':')?;
                name
            } else {
                index.to_string()
            };
            let path = if key.is_empty() { own } else { format!("{key}.{own}") };
            self.value(&path, depth + 1, pairs)?;
            match self.peek()? {
                b',' => self.at += 1,
                c if c == end => {
                    self.at += 1;
                    return Some(());
                }
                _ => return None,
            }
        }
        None
    }

    fn string(&mut self) -> Option<String> {
        self.at += 1;
        let mut bytes = Vec::new();
        loop {
            let c = *self.text.get(self.at)?;
            self.at += 1;
            match c {
                b'"' => return String::from_utf8(bytes).ok(),
                b'\\' => {
                    let escaped = *self.text.get(self.at)?;
                    self.at += 1;
                    match escaped {
                        b'n' => bytes.push(b'\n'),
                        b't' => bytes.push(b'\t'),
                        b'r' => bytes.push(b'\r'),
                        b'b' => bytes.push(8),
                        b'f' => bytes.push(12),
                        b'u' => {
                            let mut units = vec![self.unit()?];
                            if (0xd800..0xdc00).contains(&units[0]) && self.text[self.at..].starts_with(b"\\u") {
                                self.at += 2;
                                units.push(self.unit()?);
                            }
                            bytes.extend_from_slice(String::from_utf16(&units).ok()?.as_bytes());
                        }
                        other => bytes.push(other),
                    }
                }
                c => bytes.push(c),
            }
        }
    }

    fn unit(&mut self) -> Option<u16> {
        let digits = std::str::from_utf8(self.text.get(self.at..self.at + 4)?).ok()?;
        self.at += 4;
        u16::from_str_radix(digits, 16).ok()
    }
}
