//! Which columns give the time of a row, and how it is written there.

use crate::column::{Column, Kind};
use crate::dialect::Dialect;
use crate::error::Error;
use crate::guess;
use crate::time::{Scale, Unit};
use crate::written::{self, Clock, Order, Problem, Syntax};

/// Names of a column that is taken as time, if no column has dates.
const NAMES: [&str; 18] = [
    "second",
    "sec",
    "zeitstempel",
    "when",
    "time",
    "timestamp",
    "datetime",
    "date",
    "seconds",
    "t",
    "ts",
    "_time",
    "epoch",
    "date_time",
    "date time",
    "zeit",
    "datum",
    "utc",
];

fn is_time_name(name: &str) -> bool {
    let lower = name.to_lowercase();
    NAMES.contains(&lower.as_str())
        || ["timestamp", "time_", "time ", "date time", "datetime", "time("]
            .iter()
            .any(|begin| lower.starts_with(begin))
        || ["_time", " time", "_timestamp", "_date"]
            .iter()
            .any(|end| lower.ends_with(end))
}

/// The columns that give the time by their kinds and names; `None` if none does for certain.
pub(crate) fn guess(columns: &[Column], dialect: &Dialect, is_certain: bool) -> Option<Vec<usize>> {
    let named = |name: &str| columns.iter().position(|column| column.own_name.to_lowercase() == name);
    if dialect.format.as_deref() == Some("EPW") {
        return Some((0..5).collect());
    }
    if let (Some(date), Some(time)) = (named("date"), named("time"))
        && columns[date].kind == Kind::Time
    {
        return Some(vec![date, time]);
    }
    let dated: Vec<usize> = (0..columns.len()).filter(|i| columns[*i].kind == Kind::Time).collect();
    match dated.as_slice() {
        [one] => return Some(vec![*one]),
        [] => {}
        several => {
            let by_name = several
                .iter()
                .find(|i| NAMES.contains(&columns[**i].own_name.to_lowercase().as_str()));
            let by_name = by_name.or(several.iter().find(|i| is_time_name(&columns[**i].own_name)));
            return Some(vec![by_name.copied().unwrap_or(several[0])]);
        }
    }
    let exact = NAMES.iter().find_map(|name| named(name));
    let like = || {
        columns
            .iter()
            .position(|column| is_time_name(&column.own_name))
            .filter(|_| !is_certain)
    };
    exact.or_else(like).map(|column| vec![column])
}

/// Meanings of columns of numbers that give a date together.
fn parts(names: &[&str]) -> Option<Vec<usize>> {
    const MEANINGS: [&[&str]; 6] = [
        &["year", "yyyy", "yr", "jahr"],
        &["month", "mm", "mo", "monat"],
        &["day", "dd", "dy", "tag"],
        &["hour", "hh", "hr", "stunde"],
        &["minute", "min", "mi", "mn"],
        &["second", "sec", "ss", "seconds"],
    ];
    let meaning = |name: &&str| {
        let lower = name.to_lowercase();
        MEANINGS.iter().position(|words| words.contains(&lower.as_str()))
    };
    let found: Option<Vec<usize>> = names.iter().map(meaning).collect();
    found.filter(|found| found.contains(&0) && found.len() >= 2)
}

/// The offset that a name states, as `Date Time, GMT-07:00`.
fn offset_in(name: &str) -> Option<String> {
    let at = name.find("GMT").or(name.find("UTC"))?;
    let text: String = name[at + 3..]
        .chars()
        .take_while(|c| c.is_ascii_digit() || "+-:".contains(*c))
        .collect();
    written::offset(&text).map(|_| text)
}

/// How times of these columns are written, by what is said and by a sample of their cells (joined by a space).
pub(crate) fn clock(
    names: &[&str],
    sample: &[String],
    dialect: &mut Dialect,
) -> Result<Clock, Result<Error, (usize, Problem)>> {
    let cells: Vec<&str> = sample.iter().map(String::as_str).collect();
    let mut zone_text = dialect.time_zone.clone();
    let is_epw = dialect.format.as_deref() == Some("EPW");
    let syntax = if names.len() > 1
        && let Some(meaning) = parts(names)
    {
        Syntax::Parts(meaning, is_epw)
    } else {
        match dialect.time_format.as_deref() {
            Some("s") => Syntax::Number(Unit::Seconds),
            Some("ms") => Syntax::Number(Unit::Milliseconds),
            Some("us") => Syntax::Number(Unit::Microseconds),
            Some("ns") => Syntax::Number(Unit::Nanoseconds),
            Some("dmy") => Syntax::Date(Order::Dmy),
            Some("mdy") => Syntax::Date(Order::Mdy),
            Some("ymd" | "iso") => Syntax::Date(Order::Ymd),
            Some(format) if format.contains('%') => Syntax::Format(format.to_owned()),
            Some(other) => {
                let expected = "`dmy`, `mdy`, `ymd`, the unit of numbers `s`, `ms`, `us` or `ns`, or a format as '%d.%m.%Y %H:%M:%S'";
                return Err(Ok(Error::option("--time-format", other, expected)));
            }
            None => majority(&cells)?,
        }
    };
    let has_offset = match &syntax {
        Syntax::Date(order) => cells.iter().any(|cell| guess::has_offset(cell, *order)),
        Syntax::Format(format) => ["%z", "%:z", "%Q", "%s", "%c"].iter().any(|part| format.contains(part)),
        _ => false,
    };
    let is_dated = match &syntax {
        Syntax::Date(_) | Syntax::Parts(..) => true,
        Syntax::Format(format) => ["%Y", "%y", "%F", "%D", "%s", "%G", "%c"]
            .iter()
            .any(|part| format.contains(part)),
        _ => false,
    };
    if is_dated && !has_offset && zone_text.is_none() {
        zone_text = names.iter().find_map(|name| offset_in(name));
        dialect.time_zone.clone_from(&zone_text);
    }
    let largest = || {
        cells
            .iter()
            .filter_map(|cell| cell.parse::<f64>().ok())
            .fold(0.0_f64, |most, x| most.max(x.abs()))
    };
    let scale = match &syntax {
        Syntax::Number(unit) if *unit != Unit::Seconds && Unit::of_epoch(largest()).is_some() => Scale::Utc,
        _ if !is_dated => Scale::Seconds,
        _ if has_offset || zone_text.is_some() => Scale::Utc,
        _ => Scale::Local,
    };
    if let (Syntax::Number(unit), None) = (&syntax, &dialect.time_format)
        && *unit != Unit::Seconds
    {
        let text = ["s", "ms", "us", "ns"][usize::from(unit.decimals() / 3)];
        dialect.time_format = Some(text.to_owned());
    }
    let zone = zone_text.as_deref().and_then(written::zone);
    Ok(Clock {
        syntax,
        zone,
        scale,
        takes_leap_seconds: false,
        cuts: false,
    })
}

/// How most of the cells are written: a garbled one must not decide.
fn majority(cells: &[&str]) -> Result<Syntax, Result<Error, (usize, Problem)>> {
    if cells.is_empty() {
        return Ok(Syntax::Number(Unit::Seconds));
    }
    let found = guess::detect(cells).or_else(|| {
        let good: Vec<&str> = cells
            .iter()
            .copied()
            .filter(|cell| guess::detect(&[cell]).is_some())
            .collect();
        (2 * good.len() >= cells.len() && !good.is_empty())
            .then(|| guess::detect(&good))
            .flatten()
    });
    match found {
        Some(Ok(syntax)) => Ok(syntax),
        Some(Err(problem)) => Err(Err((0, problem))),
        None => {
            let first = cells
                .iter()
                .position(|cell| guess::detect(&[cell]).is_none())
                .unwrap_or(0);
            Err(Err((first, written::NO_TIME)))
        }
    }
}
