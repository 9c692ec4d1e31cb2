//! Which columns give the time of a row, and how it is written there.

use crate::civil;
use crate::column::{Column, Kind};
use crate::days::{by_name, has_date_name, may_be_compact};
use crate::dialect::Dialect;
use crate::doubts;
use crate::error::Error;
use crate::guess;
use crate::interval;
use crate::known;
use crate::named::{NAMES, OF_DAY, is_exact_name, is_time_name, starts_an_interval};
use crate::names::is_one_of;
use crate::parts::{calendar, monthly, of_day_parts, parts, weeks};
use crate::sample::{Refused, dated_hours, majority, with_stated_unit};
use crate::stated;
use crate::time::{Scale, Unit};
use crate::written::{self, Clock, Order, Syntax};
use std::borrow::Cow;

/// What the cells of a column say of the time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Says {
    Nothing,
    /// A date and perhaps a time of day.
    Date,
    /// A date alone.
    Day,
    OfDay,
}

fn says(column: &Column, sample: &[String], has_named: bool) -> Says {
    let cells: Vec<&str> = sample.iter().map(String::as_str).collect();
    let name = column.own_name.to_lowercase();
    if cells.is_empty() {
        // Of a typed column no texts are kept.
        return if column.kind == Kind::Time {
            Says::Date
        } else {
            Says::Nothing
        };
    }
    let is_compact = cells.iter().all(|cell| civil::is_compact(cell));
    if is_compact {
        // Equal numbers, and numbers beside a column that is named as the time, are no times unless the name says so.
        let varies = cells.iter().any(|cell| *cell != cells[0]);
        let is_time = is_time_name(&name) || (varies && !has_named);
        return match (is_time, cells.iter().all(|cell| cell.len() == 8)) {
            (false, _) => Says::Nothing,
            (true, true) => Says::Day,
            (true, false) => Says::Date,
        };
    }
    if column.kind != Kind::Time {
        if has_date_name(&[&name]) && cells.iter().all(|cell| cell.len() == 6) && may_be_compact(&[&name], &cells) {
            return Says::Day;
        }
        let is_short = |cell: &&str| cell.len() <= 6 && cell.bytes().all(|c| c.is_ascii_digit());
        // Also with the zone behind each, as `2130 UTC`.
        let is_zoned = |cell: &&str| cell.len() == 8 && cell.ends_with(" UTC") && is_short(&&cell[..4]);
        let is_named = || is_one_of(OF_DAY, &name) || name.ends_with(" utc");
        let is_of_day = is_named() && (cells.iter().all(is_short) || cells.iter().all(is_zoned));
        return if is_of_day { Says::OfDay } else { Says::Nothing };
    }
    let is_of_day = |cell: &&str| civil::of_day(cell.trim()).is_some();
    if cells.iter().all(is_of_day) {
        Says::OfDay
    } else if cells
        .iter()
        .any(|cell| (cell.contains(':') && cell.len() > 10) || cell.len() > 16)
    {
        Says::Date
    } else {
        Says::Day
    }
}

/// The columns that give the time by their cells and names; `None` if none does for certain.
pub(crate) fn guess(
    columns: &[Column],
    samples: &[&[String]],
    dialect: &Dialect,
    is_certain: bool,
) -> Option<Vec<usize>> {
    let named = |name: &str| columns.iter().position(|column| column.own_name.to_lowercase() == name);
    if dialect.format.as_deref() == Some("EPW") {
        return Some((0..5).collect());
    }
    if dialect.format.as_deref() == Some(known::NETATMO) {
        // Seconds since 1970 stand beside local times.
        return columns
            .iter()
            .position(|column| column.own_name == "Timestamp")
            .map(|column| vec![column]);
    }
    let has_named = NAMES.split('|').any(|name| named(name).is_some());
    let said: Vec<Says> = columns
        .iter()
        .zip(samples)
        .map(|(column, sample)| says(column, sample, has_named))
        .collect();
    let of = |what: Says| (0..said.len()).filter(|i| said[*i] == what).collect::<Vec<usize>>();
    let (dates, days, clocks) = (of(Says::Date), of(Says::Day), of(Says::OfDay));
    if let ([], [day], [_, ..]) = (dates.as_slice(), days.as_slice(), clocks.as_slice()) {
        let is_start = |clock: &usize| starts_an_interval(&columns[*clock].own_name);
        let beside = clocks
            .iter()
            .find(|clock| clock.abs_diff(*day) == 1 && (clocks.len() == 1 || is_start(clock)));
        let by_name = clocks
            .iter()
            .find(|clock| is_one_of(OF_DAY, &columns[**clock].own_name.to_lowercase()));
        if let Some(clock) = by_name.or(beside) {
            return Some(vec![*day, *clock]);
        }
    }
    if let ([], [day], []) = (dates.as_slice(), days.as_slice(), clocks.as_slice()) {
        let behind = columns[day + 1..].iter().map(|column| column.own_name.as_str());
        let hours = of_day_parts(behind).len();
        if hours > 0 {
            return Some((*day..=day + hours).collect());
        }
    }
    let dated = if dates.is_empty() { days } else { dates };
    let by_parts = || calendar(columns).or_else(|| weeks(columns).filter(|_| !has_named));
    if let (true, Some(found)) = (dated.is_empty(), by_parts()) {
        return Some(found);
    }
    if let (true, Some([year, month])) = (dated.is_empty(), monthly(columns)) {
        let is_month = |cell: &String| cell.parse::<u8>().is_ok_and(|month| (1..=12).contains(&month));
        let is_year = |cell: &String| cell.parse::<u16>().is_ok_and(|year| (1600..=2300).contains(&year));
        if !samples[month].is_empty() && samples[month].iter().all(is_month) && samples[year].iter().all(is_year) {
            return Some(vec![year, month]);
        }
    }
    let dated = if dated.is_empty() { clocks } else { dated };
    match dated.as_slice() {
        [one] if columns[*one].kind == Kind::Time || said[*one] != Says::OfDay => return Some(vec![*one]),
        [] | [_] => {}
        several => {
            let by_name = several
                .iter()
                .find(|i| is_one_of(NAMES, &columns[**i].own_name.to_lowercase()));
            let by_name = by_name.or(several.iter().find(|i| is_time_name(&columns[**i].own_name)));
            return Some(vec![by_name.copied().unwrap_or(several[0])]);
        }
    }
    // `T` is a temperature as often as a time, which does not go back again and again.
    let may_be = |i: &usize| {
        columns[*i].own_name.to_lowercase() != "t"
            || (!guess::goes_back(samples[*i]) && (*i == 0 || columns[*i].own_name == "t"))
    };
    let with_unit = |name: &str| {
        columns
            .iter()
            .position(|column| is_exact_name(&column.own_name.to_lowercase(), name))
            .filter(may_be)
    };
    let exact = NAMES
        .split('|')
        .find_map(|name| named(name).filter(may_be))
        .or_else(|| NAMES.split('|').find_map(with_unit));
    let like = || {
        columns
            .iter()
            .position(|column| is_time_name(&column.own_name))
            .filter(|i| !is_certain && may_be(i))
    };
    exact
        .or_else(like)
        .or_else(|| by_unit(columns, samples))
        .map(|column| vec![column])
}

/// The column of numbers that may be the time of day beside a date that most rows share, by its name.
pub(crate) fn shared_date(columns: &[Column], samples: &[&[String]], time: &[usize]) -> Option<usize> {
    let [date] = time else { return None };
    let sample = samples[*date];
    let is_same = sample.windows(2).filter(|pair| pair[0] == pair[1]).count();
    if sample.is_empty() || 2 * is_same < sample.len() || says(&columns[*date], sample, false) != Says::Day {
        return None;
    }
    let is_clock = |i: &usize| {
        let name = columns[*i].own_name.to_lowercase();
        let mut words = name.split(|c: char| !c.is_alphanumeric());
        let is_size = |cell: &String| cell.parse().is_ok_and(|x: f64| (0.0..=240_000.0).contains(&x));
        i != date
            && words.any(|word| is_one_of(OF_DAY, word) || word == "hour" || word == "hours")
            && !samples[*i].is_empty()
            && samples[*i].iter().all(is_size)
    };
    (0..columns.len()).find(is_clock)
}

/// The first column, if it alone states a unit of time and its numbers increase, as `Source [Second]` of an oscilloscope.
fn by_unit(columns: &[Column], samples: &[&[String]]) -> Option<usize> {
    let is_stated = |column: &Column| {
        interval::is_stated(&column.own_name) || interval::of_name(&format!("t [{}]", column.unit)).is_some()
    };
    let increases = |sample: &[String]| {
        let numbers: Option<Vec<f64>> = sample
            .iter()
            .map(|cell| cell.replacen(',', ".", 1).parse().ok())
            .collect();
        numbers.is_some_and(|numbers| numbers.len() >= 2 && numbers.is_sorted_by(|a, b| a < b))
    };
    let (first, others) = columns.split_first()?;
    let is_it = is_stated(first) && !others.iter().any(is_stated) && increases(samples.first()?);
    is_it.then_some(0)
}

/// How times of these columns are written, by what is said and by a sample of their cells (joined by a space). `are_hours`: whether the
/// second column has hours behind a date ([`parts::are_hours`](crate::parts::are_hours)).
pub(crate) fn clock(
    names: &[&str],
    sample: &[String],
    are_hours: Option<bool>,
    dialect: &mut Dialect,
) -> Result<Clock, Refused> {
    let marks = dialect.marks();
    let plain: Vec<Cow<'_, str>> = sample.iter().map(|cell| marks.without_groups(cell)).collect();
    let cells: Vec<&str> = plain.iter().map(AsRef::as_ref).collect();
    let marks = Some(marks);
    let mut zone_text = dialect.time_zone.clone();
    let syntax = if names.len() > 1
        && dialect.time_format.is_none()
        && let Some(meaning) = parts(names, sample)
    {
        Syntax::Parts(meaning, dialect.format.as_deref() == Some("EPW"))
    } else if let Some(found) = dated_hours(names, sample, are_hours, dialect.time_format.as_deref()) {
        found?
    } else {
        match dialect.time_format.as_deref() {
            Some(unit @ ("s" | "ms" | "us" | "ns")) => Syntax::Number(interval::part(unit).unwrap_or(Unit::Seconds)),
            Some("dmy") => Syntax::Date(Order::Dmy),
            Some("mdy") => Syntax::Date(Order::Mdy),
            Some("ymd" | "iso") => Syntax::Date(Order::Ymd),
            Some("be") => Syntax::Buddhist,
            Some(format) if written::since(format).is_some() => Syntax::Since(0, 0),
            Some(format) if format.contains('%') => Syntax::Format(format.to_owned()),
            Some(other) => {
                let expected = "`dmy`, `mdy`, `ymd`, the unit of numbers `s`, `ms`, `us`, `ns`, `min`, `h` or `d`, numbers of days or \
                                seconds as of `excel`, `matlab`, `mjd`, `jd` or `labview`, `be` for years of the Buddhist era, or a format as '%d.%m.%Y %H:%M:%S'";
                return Err(Refused::Option(Error::option("--time-format", other, expected)));
            }
            None => match by_name(names, &cells).map_or_else(|| majority(&cells), Ok) {
                Ok(Syntax::Date(_)) | Err(Refused::Doubt(_)) if stated::calendar(&cells).is_some() => {
                    return Err(Refused::Cell(0, stated::calendar(&cells).unwrap_or(written::NO_TIME)));
                }
                Err(Refused::Doubt(doubt)) => match stated::order(names) {
                    Some(order) => Syntax::Date(order),
                    None => return Err(Refused::Doubt(doubt)),
                },
                found => found?,
            },
        }
    };
    let syntax = with_stated_unit(syntax, names, &cells, dialect);
    let zero = match (&syntax, &dialect.time_format) {
        (Syntax::Number(_), None) => stated::zero(names)
            .transpose()
            .map_err(|problem| Refused::Cell(0, problem))?,
        _ => None,
    };
    let stated = zero.map(|(unit, zero)| (Syntax::Since(unit, zero), Scale::Utc));
    if let Some((syntax, scale)) = stated.or_else(|| dialect.time_format.as_deref().and_then(written::since)) {
        let zone = zone_text.as_deref().and_then(written::zone);
        return Ok(Clock {
            zone: zone.filter(|_| scale == Scale::Local),
            marks,
            ..Clock::new(syntax, scale)
        });
    }
    let largest = doubts::largest(&cells);
    if let (Syntax::Number(unit), None) = (&syntax, &dialect.time_format)
        && let Some(problem) = doubts::of_numbers(names, &cells, *unit)
    {
        return Err(Refused::Cell(0, problem));
    }
    let has_offset = match &syntax {
        Syntax::Date(order) => cells.iter().any(|cell| guess::has_offset(cell, *order)),
        Syntax::Format(format) => ["%z", "%:z", "%Q", "%s", "%c"].iter().any(|part| format.contains(part)),
        _ => false,
    };
    let is_dated = match &syntax {
        Syntax::Date(_) | Syntax::Parts(..) | Syntax::DateAnd(..) | Syntax::Buddhist => true,
        Syntax::Format(format) => ["%Y", "%y", "%F", "%D", "%s", "%G", "%c"]
            .iter()
            .any(|part| format.contains(part)),
        _ => false,
    };
    if is_dated && !has_offset && zone_text.is_none() {
        zone_text = names.iter().find_map(|name| guess::offset_in(name));
        dialect.time_zone.clone_from(&zone_text);
    }
    let scale = match &syntax {
        // Numbers of one unit that are smaller than its times since 1970 count from a zero of the logger.
        Syntax::Number(unit)
            if *unit != Unit::Seconds
                && Unit::of_epoch(largest).is_some_and(|found| found.decimals() >= unit.decimals()) =>
        {
            Scale::Utc
        }
        _ if !is_dated => Scale::Seconds,
        _ if has_offset || zone_text.is_some() => Scale::Utc,
        _ => Scale::Local,
    };
    let mut clock = Clock {
        zone: zone_text.as_deref().and_then(written::zone),
        marks,
        ..Clock::new(syntax, scale)
    };
    if let (Syntax::Number(unit), None) = (&clock.syntax, &dialect.time_format) {
        clock.largest = doubts::most(&cells, *unit);
        if *unit != Unit::Seconds {
            let text = ["s", "ms", "us", "ns"][usize::from(unit.decimals() / 3)];
            dialect.time_format = Some(text.to_owned());
        }
    }
    Ok(clock)
}
