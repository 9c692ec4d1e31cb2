//! How times are written: dates and times of day in many spellings, numbers, formats that are said, zones.

use crate::time::{DECIMALS, SECOND, Scale, Time, Unit};
use jiff::civil::{Date, DateTime};
use jiff::tz::{Offset, TimeZone};

/// Order of day, month and year.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Ymd,
    Dmy,
    Mdy,
}

/// How the times of a column are written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Syntax {
    Number(Unit),
    Date(Order),
    /// Hours, minutes and seconds without a date.
    OfDay,
    /// Year, month, day, hour, minute, second in columns of their own; hours that end, as in EPW, if `true`.
    Parts(Vec<usize>, bool),
    Format(String),
}

/// Problem with a time and its mend.
pub(crate) type Problem = (&'static str, &'static str);

pub(crate) const NO_TIME: Problem = (
    "is not a time",
    "say how times are written with --time-format, as '%d.%m.%Y %H:%M', or name another column with --time-column; leave single rows out with --skip-bad",
);
const LEAP: Problem = (
    "is a leap second, which exact times cannot keep",
    "allow --time ±1s, or leave the row out with --skip-bad 1",
);
const TOO_FINE: Problem =
    ("has more decimals of a second than the 18 that are kept", "allow an error of times, as --time ±1ns");
const NO_SUCH_DATE: Problem =
    ("is no date of the calendar", "mend the cell, or say the order with --time-format dmy, mdy or ymd");
const NO_ZONE: Problem = ("has no offset, rows before have one", "mend the cell, or say --time-zone");
const DOUBTFUL: Problem = (
    "is no time of that zone, or two (a change of daylight saving)",
    "say a fixed offset, as --time-zone +01:00, or leave --time-zone out to keep local times",
);
pub(crate) const AMBIGUOUS: Problem =
    ("may have the day or the month first", "say --time-format dmy or --time-format mdy");

/// A plain number of units as attoseconds.
fn number(text: &str, unit: Unit) -> Result<Time, Problem> {
    let (negative, size) = match text.strip_prefix('-') {
        Some(size) => (true, size),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, decimals) = size.split_once(['.', ',']).unwrap_or((size, ""));
    let is_plain = !(whole.is_empty() && decimals.is_empty())
        && whole.bytes().chain(decimals.bytes()).all(|byte| byte.is_ascii_digit());
    if !is_plain {
        let value: f64 = text.parse().map_err(|_| NO_TIME)?;
        return if value.is_finite() && text.contains(['e', 'E']) {
            number(&format!("{value}"), unit)
        } else {
            Err(NO_TIME)
        };
    }
    let decimals = decimals.trim_end_matches('0');
    let places = usize::from(DECIMALS - unit.decimals());
    if decimals.len() > places {
        return Err(TOO_FINE);
    }
    // The digits with zeros behind them are the number of ticks, exactly.
    let ticks: i128 = format!("0{whole}{decimals:0<places$}").parse().map_err(|_| NO_TIME)?;
    Ok(Time(if negative { -ticks } else { ticks }))
}

/// Reads digits: their value and what follows.
pub(crate) fn digits(text: &str, at_most: usize) -> Option<(i64, usize, &str)> {
    let count = text.bytes().take(at_most).take_while(u8::is_ascii_digit).count();
    let value = text[..count].parse().ok()?;
    Some((value, count, &text[count..]))
}

const MONTHS: [&str; 12] = [
    "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
];

/// Reads a date in an order. A year that stands first with four digits is read in any order.
pub(crate) fn date(text: &str, order: Order) -> Option<(Result<Date, Problem>, &str)> {
    let (first, length, rest) = digits(text, 4)?;
    let mark = rest
        .chars()
        .next()
        .filter(|mark| matches!(mark, '-' | '/' | '.' | ' '))?;
    let rest = &rest[mark.len_utf8()..];
    let word = rest.get(..3).map(str::to_ascii_lowercase);
    let month = word.and_then(|word| MONTHS.iter().position(|month| *month == word));
    let (second, rest) = match month {
        Some(month) => (month as i64 + 1, rest[3..].trim_start_matches(|c: char| c.is_ascii_alphabetic())),
        None if mark == ' ' => return None,
        None => digits(rest, 2).map(|(value, _, rest)| (value, rest))?,
    };
    let rest = rest.strip_prefix(mark)?;
    let (third, third_length, rest) = digits(rest, 4)?;
    let (year, month, day, year_length) = match (length, month, order) {
        (4, _, _) => (first, second, third, 4),
        (_, Some(_), _) | (_, _, Order::Dmy) => (third, second, first, third_length),
        (_, _, Order::Mdy) => (third, first, second, third_length),
        (_, _, Order::Ymd) => (first, second, third, length),
    };
    let year = match (year_length, year) {
        (2, 69..) => year + 1900,
        (2, _) => year + 2000,
        (4, _) => year,
        _ => return None,
    };
    let date = match (i16::try_from(year), i8::try_from(month), i8::try_from(day)) {
        (Ok(year), Ok(month), Ok(day)) => Date::new(year, month, day).map_err(|_| NO_SUCH_DATE),
        _ => Err(NO_SUCH_DATE),
    };
    Some((date, rest))
}

/// Seconds and attoseconds of a time of day, whether it is a leap second, and what follows.
pub(crate) fn of_day(text: &str) -> Option<(i64, i128, bool, &str)> {
    let (hours, _, rest) = digits(text, 9)?;
    let (minutes, _, mut rest) = digits(rest.strip_prefix(':')?, 2)?;
    let (mut seconds, mut fraction) = (0, 0);
    if let Some(behind) = rest.strip_prefix(':') {
        let (value, _, behind) = digits(behind, 2)?;
        seconds = value;
        rest = behind;
        if let Some(behind) = rest.strip_prefix(['.', ',']) {
            let count = behind.bytes().take_while(u8::is_ascii_digit).count();
            let kept = behind[..count].trim_end_matches('0');
            if count == 0 || kept.len() > usize::from(DECIMALS) {
                return None;
            }
            fraction = format!("{kept:0<18}").parse().ok()?;
            rest = &behind[count..];
        }
    }
    if minutes > 59 || seconds > 60 {
        return None;
    }
    let word: String = rest.trim_start().chars().filter(|c| *c != '.').take(2).collect();
    let hours = match word.to_ascii_lowercase().as_str() {
        "am" | "pm" if !(1..=12).contains(&hours) => return None,
        "am" => hours % 12,
        "pm" => hours % 12 + 12,
        _ => hours,
    };
    if matches!(word.to_ascii_lowercase().as_str(), "am" | "pm") {
        rest = rest
            .trim_start()
            .trim_start_matches(|c: char| matches!(c, 'a' | 'A' | 'p' | 'P' | 'm' | 'M' | '.'));
    }
    Some((hours * 3600 + minutes * 60 + seconds, fraction, seconds == 60, rest))
}

/// An offset from UTC in seconds.
pub(crate) fn offset(text: &str) -> Option<i64> {
    let text = text.trim();
    if matches!(text.to_ascii_uppercase().as_str(), "Z" | "UTC" | "GMT") {
        return Some(0);
    }
    let text = text.strip_prefix("UTC").or(text.strip_prefix("GMT")).unwrap_or(text);
    let (sign, rest) = match text.chars().next()? {
        '+' => (1, &text[1..]),
        '-' => (-1, &text[1..]),
        '\u{2212}' => (-1, &text[3..]),
        _ => return None,
    };
    let (hours, _, rest) = digits(rest, 2)?;
    let minutes = match rest.strip_prefix(':').unwrap_or(rest) {
        "" => 0,
        rest => {
            digits(rest, 2)
                .filter(|(_, count, rest)| *count == 2 && rest.is_empty())?
                .0
        }
    };
    (hours <= 18 && minutes < 60).then_some(sign * (hours * 3600 + minutes * 60))
}

/// Seconds since 1970 of a date and a second of the day, as if it were UTC.
fn civil_seconds(date: Date, second: i64) -> i64 {
    let epoch = Date::constant(1970, 1, 1);
    let days = date.since(epoch).map_or(0, |span| i64::from(span.get_days()));
    days * 86_400 + second
}

/// Reads the times of a column.
#[derive(Debug, Clone)]
pub(crate) struct Clock {
    pub(crate) syntax: Syntax,
    pub(crate) zone: Option<TimeZone>,
    pub(crate) scale: Scale,
    /// Whether 23:59:60 is read as the next minute's beginning.
    pub(crate) takes_leap_seconds: bool,
    /// Whether decimals beyond the 18th may be cut.
    pub(crate) cuts: bool,
}

/// A zone by its name or offset.
pub(crate) fn zone(text: &str) -> Option<TimeZone> {
    match offset(text) {
        Some(seconds) => Offset::from_seconds(i32::try_from(seconds).ok()?)
            .ok()
            .map(TimeZone::fixed),
        None => TimeZone::get(text.trim()).ok(),
    }
}

impl Clock {
    /// The clock of times that are typed as such.
    #[cfg(feature = "parquet")]
    pub(crate) fn typed(scale: Scale, zone: Option<TimeZone>) -> Self {
        Self {
            syntax: Syntax::Number(Unit::Seconds),
            zone,
            scale,
            takes_leap_seconds: false,
            cuts: false,
        }
    }

    pub(crate) fn parse(&self, text: &str) -> Result<Time, Problem> {
        let text = text.trim();
        match &self.syntax {
            Syntax::Number(unit) => match number(text, *unit) {
                Err(problem) if problem == TOO_FINE && self.cuts => {
                    let end = text
                        .find('.')
                        .map_or(text.len(), |i| (i + 1 + 15 - usize::from(unit.decimals())).min(text.len()));
                    number(&text[..end], *unit)
                }
                found => found,
            },
            Syntax::OfDay => {
                let (second, fraction, leap, rest) = of_day(text).ok_or(NO_TIME)?;
                if leap || !rest.trim().is_empty() {
                    return Err(NO_TIME);
                }
                Ok(Time::checked(second, fraction))
            }
            Syntax::Date(order) => self.written(text, *order),
            Syntax::Format(format) => self.formatted(text, format),
            Syntax::Parts(..) => Err(NO_TIME),
        }
    }

    /// A time of a local clock in the zone that was said.
    #[cfg(feature = "parquet")]
    pub(crate) fn zoned(&self, time: Time) -> Result<Time, Problem> {
        match &self.zone {
            Some(zone) => {
                let whole = i64::try_from(time.0.div_euclid(SECOND)).map_err(|_| NO_SUCH_DATE)?;
                self.in_zone(zone, whole, time.0.rem_euclid(SECOND))
            }
            None => Ok(time),
        }
    }

    fn written(&self, text: &str, order: Order) -> Result<Time, Problem> {
        let (date, rest) = date(text, order).ok_or(NO_TIME)?;
        let date = date?;
        let rest = rest.trim_start_matches([' ', 'T', 't', '_', ',', '\t']);
        let (second, fraction, leap, rest) = if rest.is_empty() {
            (0, 0, false, "")
        } else {
            of_day(rest).ok_or(NO_TIME)?
        };
        if second > 86_400 || (leap && second % 86_400 != 0 && !rest.trim().is_empty() && offset(rest).is_none()) {
            return Err(NO_TIME);
        }
        if leap && !self.takes_leap_seconds {
            return Err(LEAP);
        }
        self.placed(date, second, fraction, rest)
    }

    /// A civil time on its clock: with its own offset, that of the zone, or none.
    fn placed(&self, date: Date, second: i64, fraction: i128, offset_text: &str) -> Result<Time, Problem> {
        let seconds = civil_seconds(date, second);
        if !offset_text.trim().is_empty() {
            let offset = offset(offset_text).ok_or(NO_TIME)?;
            return match self.scale {
                Scale::Utc => Ok(Time::checked(seconds - offset, fraction)),
                _ => {
                    Err(("has an offset, rows before have none", "mend the cell, or say --time-zone for those without"))
                }
            };
        }
        match (&self.zone, self.scale) {
            (Some(zone), _) => self.in_zone(zone, seconds, fraction),
            (None, Scale::Utc) => Err(NO_ZONE),
            (None, _) => Ok(Time::checked(seconds, fraction)),
        }
    }

    fn in_zone(&self, zone: &TimeZone, seconds: i64, fraction: i128) -> Result<Time, Problem> {
        let civil: DateTime = jiff::Timestamp::from_second(seconds)
            .map(|stamp| Offset::UTC.to_datetime(stamp))
            .map_err(|_| NO_SUCH_DATE)?;
        let stamp = zone.to_ambiguous_timestamp(civil).unambiguous().map_err(|_| DOUBTFUL)?;
        Ok(Time::checked(stamp.as_second(), fraction))
    }

    fn formatted(&self, text: &str, format: &str) -> Result<Time, Problem> {
        let refused = ("is not written as --time-format says", "mend the cell, or the format");
        let parsed = jiff::fmt::strtime::parse(format, text).map_err(|_| refused)?;
        let time = match parsed.to_time() {
            Ok(time) => time,
            Err(_) if !format.contains("%H") && !format.contains("%I") && !format.contains("%T") => {
                jiff::civil::Time::midnight()
            }
            Err(_) => return Err(refused),
        };
        let second = i64::from(time.hour()) * 3600 + i64::from(time.minute()) * 60 + i64::from(time.second());
        let fraction = i128::from(time.subsec_nanosecond()) * 1_000_000_000;
        if self.scale == Scale::Seconds {
            return Ok(Time::checked(second, fraction));
        }
        let date = match (parsed.to_date(), parsed.timestamp()) {
            (Ok(date), _) => date,
            (_, Some(stamp)) => {
                return Ok(Time::checked(stamp.as_second(), i128::from(stamp.subsec_nanosecond()) * 1_000_000_000));
            }
            _ => return Err(refused),
        };
        match parsed.offset() {
            Some(offset) => Ok(Time::checked(civil_seconds(date, second) - i64::from(offset.seconds()), fraction)),
            None => self.placed(date, second, fraction, ""),
        }
    }

    /// The time of numbers of year, month, day, hour, minute, second in cells of their own.
    pub(crate) fn of_parts(&self, cells: &[&str]) -> Result<Time, Problem> {
        let Syntax::Parts(meaning, ends) = &self.syntax else {
            return self.parse(&cells.join(" "));
        };
        let mut parts = [0_i64, 1, 1, 0, 0, 0];
        let mut fraction = 0;
        for (cell, part) in cells.iter().zip(meaning) {
            let time = number(cell.trim(), Unit::Seconds)?;
            parts[*part] = i64::try_from(time.0.div_euclid(SECOND)).map_err(|_| NO_TIME)?;
            let rest = time.0.rem_euclid(SECOND);
            if rest != 0 && *part != 5 {
                return Err(NO_TIME);
            }
            fraction = if *part == 5 { rest } else { fraction };
        }
        let [year, month, day, hour, minute, second] = parts;
        let small = |part: i64| i8::try_from(part).map_err(|_| NO_SUCH_DATE);
        let date = Date::new(i16::try_from(year).map_err(|_| NO_SUCH_DATE)?, small(month)?, small(day)?)
            .map_err(|_| NO_SUCH_DATE)?;
        if !(0..=24).contains(&hour) || !(0..=60).contains(&minute) || !(0..60).contains(&second) {
            return Err(NO_TIME);
        }
        // In weather years, hour 1 is the first hour of a day, and minute 60 its end.
        let hour = if *ends { hour - 1 } else { hour };
        self.placed(date, hour * 3600 + minute * 60 + second, fraction, "")
    }
}
