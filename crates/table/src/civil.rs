//! Dates and times of day in many spellings: their parts, and what they say of their zone.

pub(crate) use crate::calendar::{NO_SUCH_DATE, Problem, digits};
use crate::calendar::{checked, day_of_year, month_named, of_week};
use crate::time::DECIMALS;
use crate::worded::{arranged, of_east_asia, of_period};
pub(crate) use crate::worded::{is_ratio, undressed};
use crate::zones::zone_of;
pub(crate) use crate::zones::{Zone, offset};
use jiff::civil::Date;

pub(crate) const AMBIGUOUS: Problem =
    ("may have the day or the month first", "say --time-format dmy or --time-format mdy");
pub(crate) const YEAR: Problem = ("may have the year first or last", "say --time-format ymd, dmy or mdy");

/// Order of day, month and year.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Ymd,
    Dmy,
    Mdy,
}

/// A written time in its parts.
#[derive(Debug)]
pub(crate) struct Written {
    pub(crate) date: Result<Date, Problem>,
    /// Seconds of the day, and attoseconds.
    pub(crate) second: i64,
    pub(crate) fraction: i128,
    /// Whether it is a leap second.
    pub(crate) leap: bool,
    pub(crate) zone: Zone,
}

/// The parts of a date with or without a time of day.
pub(crate) fn written(text: &str, order: Order) -> Option<Written> {
    let text = undressed(text);
    let one = |text: &str| {
        let worded = || parts(&arranged(text)?, Order::Ymd);
        let of_east_asia = || parts(&of_east_asia(text)?, Order::Ymd);
        let of_period = || parts(&of_period(text)?, Order::Ymd);
        parts(text, order)
            .or_else(of_period)
            .or_else(worded)
            .or_else(of_east_asia)
    };
    let found = one(text);
    if found.as_ref().is_some_and(|found| found.zone != Zone::Unknown) {
        return found;
    }
    // An interval, as of hours of a market: its beginning.
    let interval = || {
        let is_mark = |mark: &&str| text.matches(*mark).count() == 1;
        let mark = [" - ", " \u{2013} ", " / ", "/"].into_iter().find(is_mark)?;
        let (begin, end) = text.split_once(mark)?;
        let (begin, end) = (one(begin.trim())?, one(end.trim())?);
        let is_before = (begin.date.ok()?, begin.second) < (end.date.ok()?, end.second);
        is_before.then_some(begin)
    };
    interval().or(found)
}

fn parts(text: &str, order: Order) -> Option<Written> {
    let (date, rest) = date(text, order)?;
    // A time of day without marks behind a hyphen, as `20240305-213000`.
    let is_six = |rest: &&str| rest.len() == 6 && rest.bytes().all(|c| c.is_ascii_digit());
    let rest = rest.strip_prefix('-').filter(is_six).unwrap_or(rest);
    let rest = rest.trim_start_matches([' ', 'T', 't', '_', ',', '\t', ':']);
    let midnight = (0, 0, false, rest);
    // `2024-03-05-08` may be an hour.
    let is_offset = offset(rest).is_some() && rest.contains(|c: char| c == ':' || c.is_ascii_alphabetic());
    let (second, fraction, leap, rest) = if rest.is_empty() || is_offset {
        midnight
    } else {
        of_day(rest)
            .or_else(|| marked_of_day(rest))
            .or_else(|| compact_of_day(rest))?
    };
    Some(Written {
        date,
        second,
        fraction,
        leap,
        zone: zone_of(rest),
    })
}

/// Reads a date in an order. A year that stands first with four digits is read in any order.
fn date(text: &str, order: Order) -> Option<(Result<Date, Problem>, &str)> {
    let (first, length, rest) = digits(text, 4)?;
    let next = rest.chars().next()?;
    if next.is_ascii_digit() {
        return compact(text);
    }
    if length == 4 && (next == 'W' || rest.starts_with("-W")) {
        return week(first, rest);
    }
    if length == 4 && next == ':' {
        // `2024:065:21:30:00`
        let (second, count, rest) = digits(&rest[1..], 3)?;
        if count == 3 {
            return rest.starts_with(':').then(|| (day_of_year(first, second), rest));
        }
        // `2024:03:05 21:30:00`, as cameras write it
        let (day, _, rest) = digits(rest.strip_prefix(':')?, 2)?;
        return rest
            .starts_with([' ', 'T'])
            .then(|| (checked(first, second, day), rest));
    }
    // `05MAR2024`
    let mark = if next.is_ascii_alphabetic() && length <= 2 {
        ""
    } else {
        &rest[..rest
            .chars()
            .next()
            .filter(|mark| matches!(mark, '-' | '/' | '.' | ' ' | ':'))?
            .len_utf8()]
    };
    let rest = &rest[mark.len()..];
    let word_length = rest.bytes().take_while(u8::is_ascii_alphabetic).count();
    let month = month_named(&rest[..word_length]);
    let (second, rest) = match month {
        Some(month) => (month as i64 + 1, rest[word_length..].trim_start_matches('.')),
        None if mark.trim().is_empty() => return None,
        None => {
            let (value, count, behind) = digits(rest, 3)?;
            if length == 4 && count == 3 {
                return Some((day_of_year(first, value), behind));
            }
            if count > 2 {
                return None;
            }
            (value, behind)
        }
    };
    if length == 4 && rest.is_empty() && mark == "-" {
        return Some((checked(first, second, 1), rest));
    }
    let rest = rest.strip_prefix(mark)?;
    let (third, third_length, rest) = digits(rest, 4)?;
    // Two digits each with colons are a time of day.
    if mark == ":" && third_length != 4 {
        return None;
    }
    let (year, month, day, year_length) = match (length, month, order) {
        (4, _, _) => (first, second, third, 4),
        (_, Some(_), _) | (_, _, Order::Dmy) => (third, second, first, third_length),
        (_, _, Order::Mdy) => (third, first, second, third_length),
        (_, _, Order::Ymd) => (first, second, third, length),
    };
    let year = match year_length {
        2 => century(year),
        4 => year,
        _ => return None,
    };
    Some((checked(year, month, day), rest))
}

/// The year of two digits: of 1969 to 2068.
pub(crate) fn century(year: i64) -> i64 {
    match year {
        69..=99 => year + 1900,
        0..69 => year + 2000,
        _ => year,
    }
}

/// A week and a day of it, as `-W10-2` or `W102` behind the year.
fn week(year: i64, text: &str) -> Option<(Result<Date, Problem>, &str)> {
    let (week, count, rest) = digits(text.trim_start_matches('-').strip_prefix('W')?, 2)?;
    if count == 2 && rest.is_empty() {
        // A week alone is that of its Monday, as a month alone is that of its first day.
        return Some((of_week(year, week, 1), rest));
    }
    let rest = match text.starts_with('-') {
        true => rest.strip_prefix('-')?,
        false => rest,
    };
    let (day, _, rest) = digits(rest, 1)?;
    (count == 2).then(|| (of_week(year, week, day), rest))
}

/// A date without marks: `20240305`, also before a time of day, or `2024065`.
fn compact(text: &str) -> Option<(Result<Date, Problem>, &str)> {
    let count = text.bytes().take_while(u8::is_ascii_digit).count();
    let year = digits(text, 4)
        .map(|(year, ..)| year)
        .filter(|year| (1700..2300).contains(year))?;
    match count {
        7 => Some((day_of_year(year, text[4..7].parse().ok()?), &text[7..])),
        8 | 10 | 12 | 14 | 17 => Some((checked(year, text[4..6].parse().ok()?, text[6..8].parse().ok()?), &text[8..])),
        _ => None,
    }
}

/// Whether a cell of digits alone is a date, and perhaps a time of day, without marks.
pub(crate) fn is_compact(cell: &str) -> bool {
    let (whole, decimals) = cell.split_once('.').unwrap_or((cell, ""));
    let lengths: &[usize] = if decimals.is_empty() {
        &[8, 10, 12, 14, 17]
    } else {
        &[14]
    };
    lengths.contains(&whole.len())
        && cell.len() != whole.len() + 1
        && whole.bytes().chain(decimals.bytes()).all(|c| c.is_ascii_digit())
        && parts(cell, Order::Ymd).is_some_and(|found| found.date.is_ok() && found.second <= 86_400)
}

/// The digits behind a mark of decimals as attoseconds, and what follows.
fn fraction(text: &str) -> Option<(i128, &str)> {
    let count = text.bytes().take_while(u8::is_ascii_digit).count();
    let kept = text[..count].trim_end_matches('0');
    if kept.len() > usize::from(DECIMALS) {
        return None;
    }
    Some((format!("{kept:0<18}").parse().ok()?, &text[count..]))
}

/// Seconds since 1970 of a date and a second of the day, as if it were UTC.
pub(crate) fn seconds(date: Date, second: i64) -> i64 {
    let epoch = Date::constant(1970, 1, 1);
    let days = date.since(epoch).map_or(0, |span| i64::from(span.get_days()));
    days * 86_400 + second
}

/// Seconds and attoseconds of a time of day, whether it is a leap second, and what follows.
pub(crate) fn of_day(text: &str) -> Option<(i64, i128, bool, &str)> {
    let (hours, count, rest) = digits(text, 9)?;
    let (behind, is_lettered) = match rest.strip_prefix(':') {
        Some(behind) => (behind, false),
        // `21h30`, as in French.
        None => (rest.strip_prefix(['h', 'H']).filter(|_| count <= 2)?, true),
    };
    let (minutes, count, mut rest) = digits(behind, 2)?;
    if is_lettered && (count != 2 || rest.starts_with(|c: char| c.is_alphanumeric())) {
        return None;
    }
    let (mut seconds, mut parts) = (0, 0);
    if let Some(behind) = rest.strip_prefix(':') {
        let (value, count, behind) = digits(behind, 4)?;
        // Four digits are the year of `05:03:2024`.
        if count > 2 {
            return None;
        }
        seconds = value;
        rest = behind;
        // Three digits behind a further colon are thousandths.
        let is_thousandths =
            |behind: &&str| digits(behind, 4).is_some_and(|(_, count, rest)| count == 3 && rest.trim().is_empty());
        if let Some(behind) = rest
            .strip_prefix(['.', ','])
            .or(rest.strip_prefix(':').filter(is_thousandths))
        {
            (parts, rest) = fraction(behind)?;
        }
    }
    if minutes > 59 || seconds > 60 {
        return None;
    }
    let (hours, rest) = half_day(hours, rest)?;
    Some((hours * 3600 + minutes * 60 + seconds, parts, seconds == 60, rest))
}

/// A time of day behind a date with other marks than colons, as `21.30.00` or `21-30-00`.
fn marked_of_day(text: &str) -> Option<(i64, i128, bool, &str)> {
    let mark = text.get(2..3).filter(|mark| matches!(*mark, "." | "-"))?;
    let is_part = |part: &str| part.len() == 2 && part.bytes().all(|c| c.is_ascii_digit());
    let is_marked = text.get(5..6) == Some(mark)
        && [0..2, 3..5, 6..8]
            .into_iter()
            .all(|at| text.get(at).is_some_and(is_part));
    if !is_marked {
        return None;
    }
    let with_colons = format!("{}:{}:{}", &text[..2], &text[3..5], &text[6..8]);
    let (second, _, leap, _) = of_day(&with_colons)?;
    let (parts, rest) = match text[8..].strip_prefix(['.', ',']) {
        Some(behind) => fraction(behind)?,
        None => (0, &text[8..]),
    };
    let (half, rest) = half_day(second / 3600, rest)?;
    Some((half * 3600 + second % 3600, parts, leap, rest))
}

/// Minutes and seconds with decimals, as `0:30.5`.
pub(crate) fn of_hour(text: &str) -> Option<(i64, i128)> {
    let (minutes, _, rest) = digits(text, 9)?;
    let (seconds, count, rest) = digits(rest.strip_prefix(':')?, 2)?;
    let (parts, rest) = fraction(rest.strip_prefix('.')?)?;
    (count == 2 && seconds < 60 && rest.is_empty()).then_some((minutes * 60 + seconds, parts))
}

/// Days and a time of day, as `2 days 03:04:05`.
pub(crate) fn of_days(text: &str) -> Option<(i64, i128)> {
    let (days, _, rest) = digits(text, 6)?;
    let rest = rest.strip_prefix(" day")?;
    let rest = rest
        .strip_prefix('s')
        .unwrap_or(rest)
        .trim_start_matches([' ', ',', '+']);
    let (second, parts, leap, rest) = if rest.is_empty() {
        (0, 0, false, rest)
    } else {
        of_day(rest)?
    };
    (!leap && rest.is_empty() && second < 86_400).then_some((days * 86_400 + second, parts))
}

/// The hour of a clock of twelve hours, by what follows: `am`, `p.m.`, `p`.
fn half_day(hours: i64, rest: &str) -> Option<(i64, &str)> {
    let behind = rest.trim_start();
    let letters = ["a. m.", "p. m."]
        .iter()
        .find(|word| behind.get(..5).is_some_and(|begin| begin.eq_ignore_ascii_case(word)))
        .map_or_else(
            || {
                behind
                    .bytes()
                    .take_while(|c| c.is_ascii_alphabetic() || *c == b'.')
                    .count()
            },
            |word| word.len(),
        );
    let word = behind[..letters].replace(['.', ' '], "").to_ascii_lowercase();
    let is_afternoon = match word.as_str() {
        "am" | "a" => false,
        "pm" | "p" => true,
        _ => return Some((hours, rest)),
    };
    if !(1..=12).contains(&hours) {
        return None;
    }
    Some((hours % 12 + if is_afternoon { 12 } else { 0 }, &behind[letters..]))
}

/// A time of day without marks: `21`, `2130`, `213000`, `213000.5`, `213000500`.
pub(crate) fn compact_of_day(text: &str) -> Option<(i64, i128, bool, &str)> {
    let count = text.bytes().take_while(u8::is_ascii_digit).count();
    let part = |at: usize| text.get(at..at + 2).and_then(|part| part.parse::<i64>().ok());
    let (minutes, seconds) = match count {
        2 => (0, 0),
        4 => (part(2)?, 0),
        6 | 9 => (part(2)?, part(4)?),
        _ => return None,
    };
    let (parts, rest) = match (count, text[count..].strip_prefix(['.', ','])) {
        (6, Some(behind)) => fraction(behind)?,
        (9, _) => (fraction(&text[6..9])?.0, &text[9..]),
        _ => (0, &text[count..]),
    };
    if rest.starts_with([':', '.', ',', '-', '/']) && count < 6 || minutes > 59 || seconds > 60 {
        return None;
    }
    Some((part(0)? * 3600 + minutes * 60 + seconds, parts, seconds == 60, rest))
}

/// A time of day of six digits, with decimals or without, as `213000.50`.
pub(crate) fn of_digits(text: &str) -> Option<(i64, i128)> {
    let count = text.bytes().take_while(u8::is_ascii_digit).count();
    let (second, parts, leap, rest) = compact_of_day(text).filter(|_| count == 6)?;
    (!leap && second < 86_400 && rest.is_empty()).then_some((second, parts))
}
