//! Whether numbers are likely days: of a year, of spreadsheets, or Julian dates; times as numbers of units, and of a date with numbers behind it.

use crate::civil;
use crate::hint::hint;
use crate::interval;
use crate::named::OF_DAY;
use crate::names::is_one_of;
use crate::number as numbers;
use crate::parts::Part;
use crate::time::{SECOND, Time, Unit};
use crate::written::{Clock, NO_TIME, Order, Problem, Syntax, number};
use jiff::fmt::strtime;
use std::borrow::Cow;
use std::collections::HashSet;

/// Whether the one column is called as dates are.
pub(crate) fn has_date_name(names: &[&str]) -> bool {
    let is_date = |name: &&str| {
        let lower = name.to_lowercase();
        ["date", "datum", "fecha", "yyyyddd", "day"]
            .iter()
            .any(|word| lower.contains(word))
    };
    names.len() == 1 && names.iter().any(is_date)
}

/// A year and the day of the year, or a time of day, as one number, which only the name of the column tells from a count.
pub(crate) fn by_name(names: &[&str], cells: &[&str]) -> Option<Syntax> {
    let is_day =
        |cell: &&str| cell.len() == 7 && civil::written(cell, Order::Ymd).is_some_and(|found| found.date.is_ok());
    if cells.is_empty() {
        None
    } else if has_date_name(names) && cells.iter().all(is_day) {
        Some(Syntax::Date(Order::Ymd))
    } else if are_minutes(names, cells) {
        Some(Syntax::Format("%M:%S%.f".to_owned()))
    } else if are_digits_of_time(names, cells, 4) && cells.iter().all(|cell| is_written(cell, 4, "%H%M")) {
        Some(Syntax::Format("%H%M".to_owned()))
    } else {
        let is_time = is_of_day_name(names) || are_digits_of_time(names, cells, 6);
        (is_time && cells.iter().all(|cell| civil::of_digits(cell).is_some())).then_some(Syntax::OfDay)
    }
}

/// Whether the name of a column of two numbers with a colon says that these are minutes and seconds, as `Time (mm:ss)`.
fn are_minutes(names: &[&str], cells: &[&str]) -> bool {
    let [name] = names else { return false };
    let name = name.to_lowercase();
    let is_said = ["m:s", "min:s"].iter().any(|words| {
        let at = name.find(words);
        let before = at.map(|at| name[..at].trim_end_matches('m'));
        before.is_some_and(|before| before.is_empty() || before.ends_with(['(', '[', ' ']))
    });
    is_said && cells.iter().all(|cell| cell.matches(':').count() == 1)
}

/// Whether a column of the time has numbers of so many digits, some behind a zero, as `095800`, which counts do not have.
fn are_digits_of_time(names: &[&str], cells: &[&str], digits: usize) -> bool {
    matches!(names, [name] if is_one_of(OF_DAY, &name.to_lowercase()))
        && cells.iter().all(|cell| cell.len() == digits)
        && cells.iter().any(|cell| cell.starts_with('0'))
}

/// Whether a column is named as one of times of day without marks, as receivers of satellites write them: `213000.50`.
fn is_of_day_name(names: &[&str]) -> bool {
    const WORDS: &str = "utc|utc_time|utc time|time_utc|utctime|gps_time|gpstime|hhmmss|hhmmss.ss";
    matches!(names, [name] if is_one_of(WORDS, &name.to_lowercase()))
}

/// Whether a column of dates has numbers of the size of days since 1900.
pub(crate) fn may_be_days(names: &[&str], cells: &[&str]) -> bool {
    let within = |low: f64, high: f64| {
        !cells.is_empty()
            && cells
                .iter()
                .all(|cell| cell.parse().is_ok_and(|days: f64| (low..high).contains(&days)))
    };
    // Times of day as shares of a day have many decimals: 36,500 is in 1999, and 55,000 in 2050.
    let is_share = |cell: &&str| cell.split_once('.').is_some_and(|(_, places)| places.len() >= 5);
    (has_date_name(names) && within(20_000.0, 80_000.0))
        || (names.len() == 1 && cells.iter().any(is_share) && within(36_500.0, 55_000.0))
}

/// Whether so many digits have the parts of a format.
fn is_written(cell: &str, digits: usize, format: &str) -> bool {
    cell.len() == digits && cell.bytes().all(|c| c.is_ascii_digit()) && strtime::parse(format, cell).is_ok()
}

/// Whether numbers are likely dates without marks that begin with a day or with a year of two digits: `240305` in a column of dates,
/// `2403050958` and `05032024095800` in any. Numbers that count something do not all have such parts; up to 60 seconds since 1970 can.
pub(crate) fn may_be_compact(names: &[&str], cells: &[&str]) -> bool {
    const DATES: [(usize, &str); 4] = [(6, "%y%m%d"), (6, "%d%m%y"), (6, "%m%d%y"), (8, "%d%m%Y")];
    const TIMES: [(usize, &str); 3] = [(0, ""), (4, "%H%M"), (6, "%H%M%S")];
    let times = if has_date_name(names) { &TIMES[..] } else { &TIMES[1..] };
    let is_one = |(date, time): ((usize, &str), &(usize, &str))| {
        let format = format!("{}{}", date.1, time.1);
        cells.iter().all(|cell| is_written(cell, date.0 + time.0, &format))
    };
    let is_recent = |cell: &&str| cell.parse().is_ok_and(|x: f64| (1e9..2.1e9).contains(&x));
    let may_count = cells.iter().all(is_recent) && cells.iter().collect::<HashSet<_>>().len() < 60;
    !cells.is_empty()
        && !may_count
        && DATES
            .into_iter()
            .any(|date| times.iter().any(|time| is_one((date, time))))
}

impl Clock {
    /// A number without marks between groups of digits.
    pub(crate) fn without_groups<'a>(&self, text: &'a str) -> Result<Cow<'a, str>, Problem> {
        let Some(marks) = self.marks else {
            return Ok(Cow::Borrowed(text));
        };
        let text = marks.without_groups(text);
        let other = if marks.decimal == b',' { '.' } else { ',' };
        // Behind a point of a table of decimal commas there may be decimals, but three digits are likelier a group.
        let is_group = |(whole, rest): (&str, &str)| rest.len() == 3 && whole.len() <= 3 && !whole.starts_with('0');
        let has_mark = marks.thousands.is_some_and(|mark| text.contains(char::from(mark)));
        match text.split_once(other) {
            Some(parts) if has_mark || other == ',' || is_group(parts) => Err((numbers::NO_NUMBER, hint(&text))),
            _ => Ok(text),
        }
    }

    /// A number of units of so many seconds since a zero.
    pub(crate) fn since(&self, text: &str, unit: i64, zero: i64) -> Result<Time, Problem> {
        let count = self.number(text, Unit::Seconds)?;
        let size = count.0.checked_mul(i128::from(unit)).ok_or(NO_TIME)?;
        Ok(Time(size.checked_add(i128::from(zero) * SECOND).ok_or(NO_TIME)?))
    }

    /// A number with its unit behind it.
    pub(crate) fn spelled(&self, text: &str) -> Result<Time, Problem> {
        if let Some(time) = interval::lettered(text) {
            return Ok(time);
        }
        let (number, unit) = interval::spelled(text).ok_or(NO_TIME)?;
        match interval::part(unit) {
            Some(part) => self.number(number, part),
            None => self.since(number, interval::seconds(unit).unwrap_or(1), 0),
        }
    }
}

impl Clock {
    /// A date in the first cell, and hour, minute and second in those behind it.
    pub(crate) fn date_and(&self, cells: &[&str], order: Order, behind: &[Part]) -> Result<Time, Problem> {
        let (date, rest) = cells.split_first().ok_or(NO_TIME)?;
        let found = civil::written(date, order).ok_or(NO_TIME)?;
        if found.second != 0 || found.fraction != 0 || rest.len() != behind.len() {
            return Err(NO_TIME);
        }
        let (mut second, mut fraction) = (0, 0);
        for (cell, part) in rest.iter().zip(behind) {
            let time = number(cell.trim(), Unit::Seconds)?;
            let whole = i64::try_from(time.0.div_euclid(SECOND)).map_err(|_| NO_TIME)?;
            let (unit, most) = match part {
                Part::Hour => (3600, 24),
                Part::Minute => (60, 59),
                _ => (1, 59),
            };
            if !(0..=most).contains(&whole) || (time.0.rem_euclid(SECOND) != 0 && *part != Part::Second) {
                return Err(NO_TIME);
            }
            (second, fraction) = (second + unit * whole, time.0.rem_euclid(SECOND));
        }
        if second > 86_400 {
            return Err(NO_TIME);
        }
        self.placed(found.date?, second, fraction, &found.zone)
    }
}

impl Clock {
    /// The time of a second of a week by the clock of GPS, which has no leap seconds.
    pub(crate) fn of_week(&self, week: &str, of_week: &str, decimals: u8) -> Result<Time, Problem> {
        let unit = if decimals == 0 {
            Unit::Seconds
        } else {
            Unit::Milliseconds
        };
        let week = week.trim().parse::<i64>().map_err(|_| NO_TIME)?;
        if (0..1024).contains(&week) {
            return Err((
                "has a week of GPS before August 1999, or one that is counted modulo 1024",
                "add the weeks of the earlier rounds, 1024 or 2048, to the column, or convert it to dates",
            ));
        }
        let since = number(of_week.trim(), unit)?;
        let day = since.0.div_euclid(86_400 * SECOND);
        if !(0..7).contains(&day) {
            return Err(NO_TIME);
        }
        let days = jiff::Span::new().try_days(week.saturating_mul(7).saturating_add(day as i64));
        let first = jiff::civil::Date::constant(1980, 1, 6);
        let date = days.and_then(|days| first.checked_add(days)).map_err(|_| NO_TIME)?;
        let rest = since.0.rem_euclid(86_400 * SECOND);
        self.placed(date, (rest / SECOND) as i64, rest % SECOND, &civil::Zone::Nothing)
    }
}
