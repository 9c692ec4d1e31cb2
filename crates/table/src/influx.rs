//! Lines of InfluxDB's line protocol as rows: `weather,site=roof temperature=82.5,ok=true 1465839830100400200` has the columns `measurement`,
//! `site`, `temperature`, `ok` and `time`. Lines of JSON behind a topic, as `mosquitto_sub -v` writes them, have the column `topic`.

use crate::error::Error;
use crate::head::Head;
use crate::json;

/// The names and texts of a line of the protocol.
pub(crate) fn pairs(line: &str, number: u64) -> Result<Vec<(String, String)>, Error> {
    if line.trim_start().starts_with('#') {
        return Ok(Vec::new());
    }
    found(line.trim()).ok_or_else(|| {
        Error::line(
            number,
            "not a line of InfluxDB's protocol, as the first lines are",
            "mend the line, or leave such lines out with --skip-bad",
        )
    })
}

/// Whether the first line, comments not counted, is one of the protocol.
pub(crate) fn is_protocol(head: &Head) -> bool {
    let first = head.filled_lines().find(|line| !line.starts_with('#'));
    first.is_some_and(|line| found(line).is_some())
}

/// Parts of a text between marks that stand neither behind a backslash nor in quotes.
fn split(text: &str, mark: char, has_quotes: bool) -> Vec<&str> {
    let (mut parts, mut from, mut is_escaped, mut is_quoted) = (Vec::new(), 0, false, false);
    for (at, c) in text.char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' if has_quotes => is_quoted = !is_quoted,
            c if c == mark && !is_quoted => {
                parts.push(&text[from..at]);
                from = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[from..]);
    parts
}

/// A text without the backslashes before marks.
fn bare(text: &str) -> String {
    let mut found = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let is_escape = c == '\\' && rest.peek().is_some_and(|next| ",= \"\\".contains(*next));
        found.extend(if is_escape { rest.next() } else { Some(c) });
    }
    found
}

fn found(line: &str) -> Option<Vec<(String, String)>> {
    let (head, fields, time) = match split(line, ' ', true).as_slice() {
        [head, fields] => (*head, *fields, None),
        [head, fields, time] => (*head, *fields, Some(*time)),
        _ => return None,
    };
    let pair = |text: &str, has_quotes: bool| match split(text, '=', has_quotes).as_slice() {
        [name, value] if !name.is_empty() && !value.is_empty() => Some((bare(name), (*value).to_owned())),
        _ => None,
    };
    let mut parts = split(head, ',', false).into_iter();
    let mut pairs =
        vec![("measurement".to_owned(), bare(parts.next().filter(|name| !name.is_empty() && !name.contains('='))?))];
    for tag in parts {
        let (name, value) = pair(tag, false)?;
        pairs.push((name, bare(&value)));
    }
    for field in split(fields, ',', true) {
        let (name, value) = pair(field, true)?;
        pairs.push((name, value_of(&value)?));
    }
    if let Some(time) = time {
        time.parse::<i64>().ok()?;
        pairs.push(("time".to_owned(), time.to_owned()));
    }
    Some(pairs)
}

/// The text of a field: a number, one of whole numbers with `i` or `u` behind it, a word for yes or no, a text in quotes.
fn value_of(text: &str) -> Option<String> {
    if let Some(quoted) = text.strip_prefix('"') {
        return quoted.strip_suffix('"').map(bare);
    }
    let whole = text
        .strip_suffix(['i', 'u'])
        .filter(|whole| whole.parse::<i128>().is_ok());
    if let Some(whole) = whole {
        return Some(whole.to_owned());
    }
    match text {
        "t" | "T" | "true" | "True" | "TRUE" => Some("true".to_owned()),
        "f" | "F" | "false" | "False" | "FALSE" => Some("false".to_owned()),
        number => number.parse::<f64>().is_ok().then(|| number.to_owned()),
    }
}

/// The topic in front of an object, and the rest.
fn behind_topic(line: &str) -> Option<(&str, &str)> {
    let (topic, object) = line.trim().split_once(" {")?;
    let is_topic = !topic.is_empty() && !topic.contains(|c: char| c.is_whitespace() || ",;\"{}:=".contains(c));
    (is_topic && object.ends_with('}')).then(|| (topic, &line.trim()[topic.len() + 1..]))
}

/// Whether the first lines are a topic and an object.
pub(crate) fn has_topics(head: &Head) -> bool {
    let mut lines = head.filled_lines();
    lines.next().is_some_and(|line| behind_topic(line).is_some())
        && lines.next().is_none_or(|line| behind_topic(line).is_some())
}

/// The names and texts of such a line.
pub(crate) fn topic_pairs(line: &str, number: u64) -> Result<Vec<(String, String)>, Error> {
    let (topic, object) = behind_topic(line).ok_or_else(|| {
        Error::line(
            number,
            "not a topic and an object of JSON, as the first lines are",
            "mend the line, or leave such lines out with --skip-bad",
        )
    })?;
    let mut pairs = vec![("topic".to_owned(), topic.to_owned())];
    pairs.extend(json::flattened(object, number)?);
    Ok(pairs)
}
