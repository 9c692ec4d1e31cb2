//! Dates in several columns: which columns give one, and what each of them means.

use crate::column::Column;
use crate::interval;
use crate::names::is_one_of;
use crate::time::{SECOND, Unit};

/// Meaning of a column of a part of a date.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Year,
    Month,
    Day,
    Hour,
    Minute,
    Second,
    /// Counted from 1.
    DayOfYear,
    /// A time of day, as `21:30` or `2130`.
    OfDay,
    /// Weeks since 6 January 1980, as receivers of satellites count them.
    Week,
    /// Units of a second of so many decimals in such a week.
    OfWeek(u8),
}

impl Part {
    /// The place among year, month, day, hour, minute and second.
    pub(crate) fn index(self) -> Option<usize> {
        let all = [
            Self::Year,
            Self::Month,
            Self::Day,
            Self::Hour,
            Self::Minute,
            Self::Second,
        ];
        all.iter().position(|part| *part == self)
    }
}

/// A name without marks and without the unit in brackets.
fn letters(name: &str) -> String {
    let name = name.split(['[', '(']).next().unwrap_or(name).to_lowercase();
    name.chars().filter(|c| c.is_alphanumeric()).collect()
}

/// Whether two names are those of the week of GPS and of the seconds, or thousandths, of the week.
fn week_parts(week: &str, of_week: &str) -> Option<Vec<Part>> {
    const WEEKS: [&str; 6] = ["week", "gpsweek", "gpswk", "wn", "gpswn", "gpsweeknumber"];
    const SECONDS: &str = "tow|gpstow|sow|gpssow|gpsseconds|gpssecond|gpssec|gpssecs|secondsofweek|gpssecondsofweek|timeofweek|\
        gpstimeofweek|weekseconds";
    let name = letters(of_week);
    let is_named = |name: &str| is_one_of(SECONDS, name);
    let is_thousandths = of_week.to_lowercase().contains("[ms]") || of_week.to_lowercase().contains("(ms)");
    let decimals = match name.as_str() {
        "itow" | "gpsms" | "weekms" | "gpsmilliseconds" => 3,
        name if is_named(name) => {
            if is_thousandths {
                3
            } else {
                0
            }
        }
        name => name.strip_suffix("ms").filter(|name| is_named(name)).map(|_| 3)?,
    };
    WEEKS
        .contains(&letters(week).as_str())
        .then(|| vec![Part::Week, Part::OfWeek(decimals)])
}

/// The columns of weeks of GPS and of the seconds in them, side by side.
pub(crate) fn weeks(columns: &[Column]) -> Option<Vec<usize>> {
    let is_pair = |i: &usize| week_parts(&columns[*i].own_name, &columns[*i + 1].own_name).is_some();
    (0..columns.len().saturating_sub(1))
        .find(is_pair)
        .map(|i| vec![i, i + 1])
}

/// The part of a date that a name means, behind the parts of other columns.
fn part(name: &str, before: &[Part]) -> Option<Part> {
    const MEANINGS: [(Part, &str); 8] = [
        (Part::Year, "year|yyyy|yr|yy|#yy|jahr|année|annee|année|año|anno|jaar|ano"),
        (Part::Month, "month|mm|mo|mon|monat|mois|mes|mese|maand|mês"),
        (Part::Day, "day|dd|dy|tag|jour|día|dia|giorno|dag"),
        (Part::Hour, "hour|hh|hr|stunde|heure|hora"),
        (Part::Minute, "minute|min|mi|mn"),
        (Part::Second, "second|sec|ss|seconds"),
        (Part::DayOfYear, "doy|jday|julian|julian_day|day_of_year|yday|ddd"),
        (Part::OfDay, "time|hhmm|hrmn|hrmin|hour_minute|uhrzeit"),
    ];
    let lower = name.to_lowercase();
    // `MM` and `mm` stand for months and minutes.
    if lower == "mm" && before.contains(&Part::Hour) {
        return Some(Part::Minute);
    }
    let found = MEANINGS.iter().find(|(_, words)| is_one_of(words, &lower))?.0;
    (!before.contains(&found)).then_some(found)
}

/// Whether a name says that hours and minutes stand in one number.
pub(crate) fn is_hour_and_minute(name: &str) -> bool {
    ["hhmm", "hrmn", "hrmin", "hour_minute"].contains(&name.to_lowercase().as_str())
}

/// Columns side by side that give a date by their names, from the year on.
pub(crate) fn calendar(columns: &[Column]) -> Option<Vec<usize>> {
    let is = |i: usize, expected: Part| {
        let column = columns.get(i);
        column.is_some_and(|column| part(&column.own_name, &[]) == Some(expected))
    };
    // Day, month and year, in this order or that of America, side by side.
    let ends_with_year = |i: usize| {
        is(i + 2, Part::Year)
            && ((is(i, Part::Day) && is(i + 1, Part::Month)) || (is(i, Part::Month) && is(i + 1, Part::Day)))
    };
    let first = (0..columns.len()).find(|i| is(*i, Part::Year) || ends_with_year(*i))?;
    let mut found = Vec::new();
    for column in &columns[first..] {
        let Some(part) = part(&column.own_name, &found) else {
            break;
        };
        found.push(part);
    }
    days_of_years(&mut found);
    let is_date = found.contains(&Part::DayOfYear) || (found.contains(&Part::Month) && found.contains(&Part::Day));
    is_date.then(|| (first..first + found.len()).collect())
}

/// Columns side by side that are named as a year and a month.
pub(crate) fn monthly(columns: &[Column]) -> Option<[usize; 2]> {
    let of = |i: usize, before: &[Part]| part(&columns.get(i)?.own_name, before);
    let year = (0..columns.len()).find(|i| of(*i, &[]) == Some(Part::Year))?;
    (of(year + 1, &[Part::Year]) == Some(Part::Month)).then_some([year, year + 1])
}

/// Meanings of columns that give a date together, by their names, or by their cells.
pub(crate) fn parts(names: &[&str], sample: &[String]) -> Option<Vec<Part>> {
    if let [week, of_week] = names
        && let Some(found) = week_parts(week, of_week)
    {
        return Some(found);
    }
    let mut found = Vec::new();
    for name in names {
        match part(name, &found) {
            Some(part) => found.push(part),
            None => return by_cells(names.len(), sample),
        }
    }
    days_of_years(&mut found);
    (found.contains(&Part::Year) && found.len() >= 2).then_some(found)
}

/// Without a month, days are those of the year.
fn days_of_years(found: &mut [Part]) {
    if found.contains(&Part::Year) && !found.contains(&Part::Month) && !found.contains(&Part::DayOfYear) {
        let days = found.iter_mut().filter(|part| **part == Part::Day);
        days.for_each(|part| *part = Part::DayOfYear);
    }
}

/// Meanings of columns of whole numbers in the order of a date: a year of four digits, month, day and so on, or the day of the year.
fn by_cells(count: usize, sample: &[String]) -> Option<Vec<Part>> {
    const ORDER: [(Part, i64); 6] = [
        (Part::Year, 2300),
        (Part::Month, 12),
        (Part::Day, 31),
        (Part::Hour, 24),
        (Part::Minute, 60),
        (Part::Second, 60),
    ];
    let row = |text: &String| {
        text.split_whitespace()
            .map(|cell| cell.parse::<i64>().ok())
            .collect::<Option<Vec<i64>>>()
    };
    let rows: Vec<Vec<i64>> = sample.iter().map(row).collect::<Option<_>>()?;
    let all = |i: usize, within: std::ops::RangeInclusive<i64>| rows.iter().all(|row| within.contains(&row[i]));
    // Years of two digits need a time of day behind them, or they may be anything.
    if rows.is_empty()
        || rows.iter().any(|row| row.len() != count)
        || !(all(0, 1700..=2300) || (count >= 5 && all(0, 0..=99)))
    {
        return None;
    }
    if (3..=6).contains(&count) && (1..count).all(|i| all(i, i64::from(i < 3)..=ORDER[i].1)) {
        return Some(ORDER[..count].iter().map(|(part, _)| *part).collect());
    }
    if count == 2 && all(1, 1..=12) {
        // Months, if there are more rows than days of the year could be so small.
        return (rows.len() > 12).then(|| vec![Part::Year, Part::Month]);
    }
    let by_day = [Part::Year, Part::DayOfYear, Part::OfDay];
    (count <= 3 && all(1, 1..=366) && (count < 3 || all(2, 0..=2400))).then(|| by_day[..count].to_vec())
}

/// Meanings of columns behind that of a date by their names: hour, minute, second.
pub(crate) fn of_day_parts<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<Part> {
    let mut found = Vec::new();
    for name in names {
        let expected = [Part::Hour, Part::Minute, Part::Second].get(found.len()).copied();
        // `mm` behind an hour is a minute.
        match part(name, &found).filter(|part| Some(*part) == expected) {
            Some(part) => found.push(part),
            None => break,
        }
    }
    found
}

/// Whether cells of one or two digits beside dates are hours; `None` if there is nothing to decide, `Some(false)` if they may be minutes
/// behind midnight, as `5` of `0005`, or seconds.
pub(crate) fn are_hours(dates: &[String], cells: &[String]) -> Option<bool> {
    let hours = cells.iter().map(|cell| match cell.len() {
        1 | 2 => cell.parse::<u8>().ok().filter(|hour| *hour < 60),
        _ => None,
    });
    let latest = hours
        .collect::<Option<Vec<u8>>>()?
        .into_iter()
        .max()
        .filter(|hour| *hour > 0)?;
    // Minutes in steps of some days would all be behind midnight.
    Some((6..=24).contains(&latest) && dates.iter().any(|date| *date != dates[0]))
}

/// The cells of a date and a time of day as one text.
pub(crate) fn joined(cells: &[&str]) -> String {
    match cells {
        [date, time] => format!("{date} {}", padded(time)),
        _ => cells.join(" "),
    }
}

/// A time of day without marks that lost its zeros, as `930` of `0930`.
pub(crate) fn padded(cell: &str) -> std::borrow::Cow<'_, str> {
    let cell = cell.trim();
    if (1..=5).contains(&cell.len()) && cell.bytes().all(|c| c.is_ascii_digit()) {
        let width = if cell.len() <= 4 { 4 } else { 6 };
        return format!("{cell:0>width$}").into();
    }
    cell.into()
}

/// Decimals of a second that the last word of a name counts, and what stands before it: 9 and `stamp` of `stamp.nsecs`.
fn counted(name: &str) -> (Option<u8>, String) {
    let lower = name.to_lowercase();
    let (before, word) = lower.rsplit_once(['.', '_', '/', ' ']).unwrap_or(("", &lower));
    let unit = interval::unit(word).and_then(interval::part);
    (unit.map(Unit::decimals), before.to_owned())
}

/// Decimals of parts of a second, by the name of their column.
pub(crate) fn decimals_named(name: &str) -> Option<u8> {
    counted(name).0.filter(|decimals| *decimals > 0)
}

/// Parts of a second of so many decimals, as attoseconds.
pub(crate) fn parts_of_second(cell: &str, decimals: u8) -> Option<i128> {
    let count = cell.trim().parse::<u32>().ok().map(i128::from)?;
    let unit = SECOND / 10_i128.pow(u32::from(decimals));
    Some(count * unit).filter(|parts| *parts < SECOND)
}

/// The column behind those of the time, if it says which half of the day their hours are of.
pub(crate) fn half_behind(samples: &[&[String]], time: &[usize]) -> Option<usize> {
    let last = *time.last()?;
    let cells = samples.get(last + 1)?;
    let is_half = |cell: &String| {
        let word = cell.replace(['.', ' '], "").to_ascii_lowercase();
        matches!(word.as_str(), "am" | "pm")
    };
    (!cells.is_empty() && cells.iter().all(is_half)).then_some(last + 1)
}

/// The column behind those of the time, if it counts parts of their seconds: by both names, as `stamp.sec, stamp.nanosec`, or since it
/// increases wherever the times stay equal.
pub(crate) fn parts_behind(columns: &[Column], samples: &[&[String]], time: &[usize]) -> Option<usize> {
    let last = *time.last()?;
    let (column, cells) = (columns.get(last + 1)?, samples.get(last + 1)?);
    let decimals = decimals_named(&column.own_name)?;
    let parts: Vec<i128> = cells
        .iter()
        .map(|cell| parts_of_second(cell, decimals))
        .collect::<Option<_>>()?;
    let (unit, before) = counted(&columns[last].own_name);
    let is_whole = |cell: &String| cell.bytes().all(|c| c.is_ascii_digit());
    let by_name = unit == Some(0) && before == counted(&column.own_name).1 && samples[last].iter().all(is_whole);
    let of = |row: usize| time.iter().map(move |i| samples[*i].get(row));
    let (mut equal, mut increases) = (0, true);
    for row in 1..parts.len() {
        if of(row).eq(of(row - 1)) {
            equal += 1;
            increases &= parts[row] > parts[row - 1];
        }
    }
    (!parts.is_empty() && (by_name || (equal > 0 && increases))).then_some(last + 1)
}

/// A column of whole seconds with that of their parts behind it, by their names.
pub(crate) fn seconds_and_parts(columns: &[Column], samples: &[&[String]]) -> Option<Vec<usize>> {
    let is_seconds = |i: &usize| counted(&columns[*i].own_name).0 == Some(0);
    (0..columns.len())
        .filter(is_seconds)
        .find_map(|i| parts_behind(columns, samples, &[i]).map(|behind| vec![i, behind]))
}
