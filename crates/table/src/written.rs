//! How times are written: dates and times of day in many spellings, numbers, formats that are said, zones.

use crate::calendar;
use crate::civil::{self, Zone, offset};
pub(crate) use crate::civil::{AMBIGUOUS, NO_SUCH_DATE, Order, Problem};
use crate::interval;
use crate::number;
use crate::parts::{Part, joined, padded, parts_of_second};
use crate::quick;
use crate::stated;
use crate::time::{DECIMALS, SECOND, Scale, Time, Unit};
use jiff::civil::{Date, DateTime};
use jiff::tz::{Offset, TimeZone};

/// How the times of a column are written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Syntax {
    Number(Unit),
    Date(Order),
    /// Hours, minutes and seconds without a date.
    OfDay,
    /// Parts of a date in columns of their own; hours that end, as in EPW, if `true`.
    Parts(Vec<Part>, bool),
    /// A date, and hour, minute and second in columns of their own.
    DateAnd(Order, Vec<Part>),
    /// Numbers with a unit behind each, as `1.5 sec`.
    Spelled,
    /// Units of so many seconds since a zero, in seconds since 1970.
    Since(i64, i64),
    /// A date with a year of the Buddhist era.
    Buddhist,
    Format(String),
}

pub(crate) const NO_TIME: Problem = (
    "is not a time",
    "say how times are written with --time-format, as '%d.%m.%Y %H:%M', or name another column with --time-column; leave single rows out with --skip-bad",
);
const BEYOND: Problem = (
    "is behind the year 2200, as if it were of another unit than others of the column",
    "mend the cell, leave such rows out with --skip-bad, or say the unit with --time-format, as s",
);
const LEAP: Problem = (
    "is a leap second, which exact times cannot keep",
    "allow --time ±1s, or leave the row out with --skip-bad 1",
);
const TOO_FINE: Problem =
    ("has more decimals of a second than the 18 that are kept", "allow an error of times, as --time ±2ns");
pub(crate) const NAMED_ZONE: Problem =
    ("names a zone by letters that several zones share", "say its region, as --time-zone Europe/Berlin");
pub(crate) const FAR: Problem = (
    "is behind the year 2200 if it counts parts of a second since 1970",
    "say --time-format ms, us or ns if it does, s if these are seconds; or convert the column, which may count from another year",
);
pub(crate) const HOURS: Problem = (
    "may have hours or minutes behind the date",
    "say --time-format '%Y-%m-%d %H' for hours, with the date as it is written, or --time-format '%Y-%m-%d %H%M'",
);
const NO_ZONE: Problem = ("has no offset, rows before have one", "mend the cell, or say --time-zone");
const DOUBTFUL: Problem = (
    "is no time of that zone, or two (a change of daylight saving)",
    "say a fixed offset, as --time-zone +01:00, or leave --time-zone out to keep local times",
);

/// A plain number of units as attoseconds.
pub(crate) fn number(text: &str, unit: Unit) -> Result<Time, Problem> {
    let (negative, size) = match text.strip_prefix('-') {
        Some(size) => (true, size),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, decimals) = size.split_once(['.', ',']).unwrap_or((size, ""));
    let is_plain = !(whole.is_empty() && decimals.is_empty())
        && whole.bytes().chain(decimals.bytes()).all(|byte| byte.is_ascii_digit());
    if !is_plain {
        let value: f64 = text.replacen(',', ".", 1).parse().map_err(|_| NO_TIME)?;
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

/// Formats of numbers of units other than parts of a second since 1970: the seconds of a unit, those of the zero since 1970, the scale.
pub(crate) fn since(format: &str) -> Option<(Syntax, Scale)> {
    let days = |days: i64| Syntax::Since(86_400, -days * 86_400);
    Some(match format {
        "excel" => (days(25_569), Scale::Local),
        "matlab" => (days(719_529), Scale::Local),
        "mjd" => (days(40_587), Scale::Utc),
        "jd" => (Syntax::Since(86_400, -210_866_760_000), Scale::Utc),
        "labview" => (Syntax::Since(1, -2_082_844_800), Scale::Utc),
        unit => (Syntax::Since(interval::seconds(unit)?, 0), Scale::Seconds),
    })
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
    /// The last of several columns counts parts of a second of so many decimals, as `Milliseconds` and `nsecs` do.
    pub(crate) parts_behind: Option<u8>,
    /// Marks in times that are numbers; `None` if a comma and a point may both stand before decimals.
    pub(crate) marks: Option<number::Syntax>,
    /// Largest size of times that are numbers: beyond it they are likely of another unit.
    pub(crate) largest: Time,
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
    /// A clock that is as exact as its cells, of any size and with any marks.
    pub(crate) fn new(syntax: Syntax, scale: Scale) -> Self {
        Self {
            syntax,
            zone: None,
            scale,
            takes_leap_seconds: false,
            cuts: false,
            parts_behind: None,
            marks: None,
            largest: Time(i128::MAX),
        }
    }

    /// The time of a cell.
    pub(crate) fn parse(&self, text: &str) -> Result<Time, Problem> {
        self.quick(text.as_bytes()).map_or_else(|| self.slowly(text), Ok)
    }

    /// The time of a cell in one of the usual spellings; `None` if it may be anything.
    #[inline]
    pub(crate) fn quick(&self, text: &[u8]) -> Option<Time> {
        match self.syntax {
            Syntax::Number(_) if self.marks.is_some_and(|marks| marks != number::Syntax::default()) => None,
            Syntax::Number(unit) => quick::ticks(text, unit.decimals()).filter(|time| *time <= self.largest),
            Syntax::OfDay => quick::of_day(text),
            Syntax::Date(order) if self.zone.is_none() || self.scale == Scale::Utc => {
                quick::date(text, order, self.scale)
            }
            _ => None,
        }
    }

    /// Whether times are written with marks, so that none is a number.
    pub(crate) fn is_written(&self) -> bool {
        matches!(self.syntax, Syntax::OfDay | Syntax::Date(_))
    }

    fn slowly(&self, text: &str) -> Result<Time, Problem> {
        let text = civil::undressed(text);
        match &self.syntax {
            Syntax::Buddhist => {
                let (text, order) = stated::of_common_era(text).ok_or(NO_TIME)?;
                self.written(&text, order)
            }
            Syntax::Number(unit) => match self.number(text, *unit)? {
                time if time > self.largest => Err(BEYOND),
                time => Ok(time),
            },
            Syntax::Since(unit, zero) => self.since(text, *unit, *zero),
            Syntax::Spelled => self.spelled(text),
            Syntax::OfDay => {
                let found = civil::of_hour(text)
                    .or_else(|| civil::of_days(text))
                    .or_else(|| civil::of_digits(text));
                if let Some((second, fraction)) = found {
                    return Ok(Time::checked(second, fraction));
                }
                let (second, fraction, leap, rest) = civil::of_day(text).ok_or(NO_TIME)?;
                if civil::is_ratio(text) || leap || !rest.trim().is_empty() {
                    return Err(NO_TIME);
                }
                Ok(Time::checked(second, fraction))
            }
            Syntax::Date(order) => self.written(text, *order),
            Syntax::Format(format) => self.formatted(text, format),
            Syntax::Parts(..) | Syntax::DateAnd(..) => Err(NO_TIME),
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

    pub(crate) fn number(&self, text: &str, unit: Unit) -> Result<Time, Problem> {
        let text: &str = &self.without_groups(text)?;
        match number(text, unit) {
            Err(problem) if problem == TOO_FINE && self.cuts => {
                // What is cut is less than a nanosecond. The last digits before an exponent are not the last decimals.
                let places = usize::from(DECIMALS - unit.decimals());
                let end = text
                    .find(['.', ','])
                    .filter(|_| !text.contains(['e', 'E']))
                    .map_or(text.len(), |i| (i + 1 + places).min(text.len()));
                number(text.get(..end).unwrap_or(text), unit).or_else(|_| {
                    let value: f64 = text.parse().map_err(|_| NO_TIME)?;
                    number(&format!("{value:.places$}"), unit)
                })
            }
            found => found,
        }
    }

    fn written(&self, text: &str, order: Order) -> Result<Time, Problem> {
        let found = civil::written(text, order).ok_or(NO_TIME)?;
        let date = found.date?;
        if found.second > 86_400 || found.zone == Zone::Unknown {
            return Err(NO_TIME);
        }
        if found.leap && !self.takes_leap_seconds {
            return Err(LEAP);
        }
        self.placed(date, found.second, found.fraction, &found.zone)
    }

    /// A civil time on its clock: with its own offset, that of the zone, or none.
    pub(crate) fn placed(&self, date: Date, second: i64, fraction: i128, zone: &Zone) -> Result<Time, Problem> {
        let seconds = civil::seconds(date, second);
        match (zone, &self.zone, self.scale) {
            (Zone::Unknown, ..) => Err(NO_TIME),
            (Zone::Offset(offset), _, Scale::Utc) => Ok(Time::checked(seconds - offset, fraction)),
            (Zone::Offset(_), ..) => {
                Err(("has an offset, rows before have none", "mend the cell, or say --time-zone for those without"))
            }
            (Zone::Name(name), Some(zone), _) => in_named(zone, name, seconds, fraction),
            (Zone::Name(_), None, _) => Err(NAMED_ZONE),
            (Zone::Region(zone), _, Scale::Utc) => self.in_zone(zone, seconds, fraction),
            (Zone::Region(_), ..) => {
                Err(("names a zone, rows before have none", "mend the cell, or say --time-zone for those without"))
            }
            (Zone::Nothing, Some(zone), _) => self.in_zone(zone, seconds, fraction),
            (Zone::Nothing, None, Scale::Utc) => Err(NO_ZONE),
            (Zone::Nothing, None, _) => Ok(Time::checked(seconds, fraction)),
        }
    }

    fn in_zone(&self, zone: &TimeZone, seconds: i64, fraction: i128) -> Result<Time, Problem> {
        let stamp = zone
            .to_ambiguous_timestamp(civil_time(seconds)?)
            .unambiguous()
            .map_err(|_| DOUBTFUL)?;
        Ok(Time::checked(stamp.as_second(), fraction))
    }

    fn formatted(&self, text: &str, format: &str) -> Result<Time, Problem> {
        let refused = ("is not written as --time-format says", "mend the cell, or the format");
        let parsed = jiff::fmt::strtime::parse(format, text).map_err(|_| refused)?;
        let has_hour = ["%H", "%I", "%k", "%l", "%T", "%R", "%c", "%s"]
            .iter()
            .any(|part| format.contains(part));
        let time = match parsed.to_time() {
            Ok(time) => time,
            Err(_) if !has_hour && format.contains("%M") => {
                let part = |part: Option<i8>| part.unwrap_or(0);
                let nanosecond = parsed.subsec_nanosecond().unwrap_or(0);
                jiff::civil::Time::new(0, part(parsed.minute()), part(parsed.second()), nanosecond)
                    .map_err(|_| refused)?
            }
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
            // A month, or a year, is its first day.
            _ if parsed.day().is_some() || parsed.day_of_year().is_some() => return Err(refused),
            _ => parsed
                .year()
                .and_then(|year| Date::new(year, parsed.month().unwrap_or(1), 1).ok())
                .ok_or(refused)?,
        };
        match parsed.offset() {
            Some(offset) => Ok(Time::checked(civil::seconds(date, second) - i64::from(offset.seconds()), fraction)),
            None => self.placed(date, second, fraction, &Zone::Nothing),
        }
    }

    /// The time of parts of a date in cells of their own, or of a date and a time of day in two cells.
    pub(crate) fn of_parts(&self, cells: &[&str]) -> Result<Time, Problem> {
        if let (Some(decimals), [whole @ .., behind]) = (self.parts_behind, cells) {
            let whole = self.of_whole(whole)?;
            let count = parts_of_second(behind, decimals).ok_or(NO_TIME)?;
            let is_whole = whole.0.rem_euclid(SECOND) == 0;
            return is_whole.then_some(Time(whole.0 + count)).ok_or(NO_TIME);
        }
        self.of_whole(cells)
    }

    fn of_whole(&self, cells: &[&str]) -> Result<Time, Problem> {
        let (meaning, ends) = match &self.syntax {
            Syntax::Parts(meaning, ends) => (meaning, ends),
            Syntax::DateAnd(order, behind) => return self.date_and(cells, *order, behind),
            Syntax::Format(format) if !format.contains("%M") => return self.formatted(&cells.join(" "), format),
            _ => return self.parse(&joined(cells)),
        };
        if let ([Part::Week, Part::OfWeek(decimals)], [week, behind]) = (meaning.as_slice(), cells) {
            return self.of_week(week, behind, *decimals);
        }
        let (mut parts, mut fraction) = ([0_i64, 1, 1, 0, 0, 0], 0);
        let (mut day_of_year, mut of_day) = (None, 0);
        for (cell, part) in cells.iter().zip(meaning) {
            if *part == Part::OfDay {
                let text = padded(cell);
                let found = civil::of_day(&text)
                    .or_else(|| civil::compact_of_day(&text))
                    .ok_or(NO_TIME)?;
                (of_day, fraction) = (found.0, found.1);
                if found.2 || !found.3.trim().is_empty() || of_day > 86_400 {
                    return Err(NO_TIME);
                }
                continue;
            }
            let time = number(cell.trim(), Unit::Seconds)?;
            let whole = i64::try_from(time.0.div_euclid(SECOND)).map_err(|_| NO_TIME)?;
            let rest = time.0.rem_euclid(SECOND);
            if rest != 0 && *part != Part::Second {
                return Err(NO_TIME);
            }
            match part {
                Part::DayOfYear => day_of_year = Some(whole),
                Part::Second => (parts[5], fraction) = (whole, rest),
                _ => parts[part.index().ok_or(NO_TIME)?] = whole,
            }
        }
        let [year, month, day, hour, minute, second] = parts;
        let year = civil::century(year);
        let small = |part: i64| i8::try_from(part).map_err(|_| NO_SUCH_DATE);
        let date = match day_of_year {
            Some(day) => calendar::day_of_year(year, day)?,
            None => Date::new(i16::try_from(year).map_err(|_| NO_SUCH_DATE)?, small(month)?, small(day)?)
                .map_err(|_| NO_SUCH_DATE)?,
        };
        if !(0..=24).contains(&hour) || !(0..=60).contains(&minute) || !(0..60).contains(&second) {
            return Err(NO_TIME);
        }
        // In weather years, hour 1 is the first hour of a day, and minute 60 its end.
        let hour = if *ends { hour - 1 } else { hour };
        self.placed(date, hour * 3600 + minute * 60 + second + of_day, fraction, &Zone::Nothing)
    }
}

fn civil_time(seconds: i64) -> Result<DateTime, Problem> {
    let stamp = jiff::Timestamp::from_second(seconds).map_err(|_| NO_SUCH_DATE)?;
    Ok(Offset::UTC.to_datetime(stamp))
}

/// A time that says by letters which of the offsets of a zone it has, as `CEST` of `Europe/Berlin`.
fn in_named(zone: &TimeZone, name: &str, seconds: i64, fraction: i128) -> Result<Time, Problem> {
    let ambiguous = zone.to_ambiguous_timestamp(civil_time(seconds)?);
    let found = [ambiguous.earlier(), ambiguous.later()]
        .into_iter()
        .flatten()
        .find(|stamp| zone.to_offset_info(*stamp).abbreviation().eq_ignore_ascii_case(name));
    found
        .map(|stamp| Time::checked(stamp.as_second(), fraction))
        .ok_or(NAMED_ZONE)
}
#[cfg(test)]
mod tests;
