//! How the times of a column are written, by its cells.

use crate::civil::{self, Zone, digits, is_compact};
use crate::time::{Scale, Unit};
use crate::worded::of_period;
pub(crate) use crate::worded::three;
use crate::written::{Clock, NAMED_ZONE, Order, Problem, Syntax};

/// What cells leave open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Doubt {
    /// The day or the month may stand first.
    DayOrMonth,
    /// The year may stand first or last.
    Year,
    /// The same, of dates that are all one day: rows behind them may decide.
    YearOfOneDay,
}

impl Doubt {
    pub(crate) fn problem(self) -> Problem {
        match self {
            Self::DayOrMonth => civil::AMBIGUOUS,
            Self::Year | Self::YearOfOneDay => civil::YEAR,
        }
    }

    /// Whether further rows may decide.
    pub(crate) fn may_be_decided(self) -> bool {
        self != Self::Year
    }
}

/// How cells of a column are written, if all are times; an ambiguity if the day or the month may stand first.
pub(crate) fn detect(cells: &[&str]) -> Option<Result<Syntax, Doubt>> {
    let bare: Vec<&str> = cells.iter().map(|cell| civil::undressed(cell)).collect();
    let cells = bare.as_slice();
    let clock = |syntax: Syntax, scale| Clock {
        takes_leap_seconds: true,
        cuts: true,
        ..Clock::new(syntax, scale)
    };
    let all = |syntax: Syntax| {
        let utc = clock(syntax.clone(), Scale::Utc);
        let local = clock(syntax, Scale::Local);
        !cells.is_empty()
            && cells
                .iter()
                .all(|cell| local.parse(cell).is_ok() || matches!(utc.parse(cell), Ok(_) | Err(NAMED_ZONE)))
    };
    if !cells.is_empty() && cells.iter().all(|cell| is_compact(cell)) {
        return Some(Ok(Syntax::Date(Order::Ymd)));
    }
    if all(Syntax::Number(Unit::Seconds)) {
        let largest = cells
            .iter()
            .filter_map(|cell| cell.trim().parse::<f64>().ok())
            .fold(0.0_f64, |m, x| m.max(x.abs()));
        return Some(Ok(Syntax::Number(Unit::of_epoch(largest).unwrap_or(Unit::Seconds))));
    }
    if all(Syntax::OfDay) {
        return Some(Ok(Syntax::OfDay));
    }
    let year_first = cells
        .iter()
        .all(|cell| digits(cell.trim(), 8).is_some_and(|(_, count, _)| count == 4 || count >= 7));
    if year_first {
        return all(Syntax::Date(Order::Ymd)).then_some(Ok(Syntax::Date(Order::Ymd)));
    }
    let (dmy, mdy) = (all(Syntax::Date(Order::Dmy)), all(Syntax::Date(Order::Mdy)));
    let is_dotted = cells
        .iter()
        .all(|cell| digits(cell.trim(), 2).is_some_and(|(_, _, rest)| rest.starts_with('.')));
    if let (true, Some(doubt)) = (dmy || mdy, may_have_year_first(cells)) {
        // Points stand in dates with the day first.
        if doubt == Doubt::Year || (dmy && !mdy && !is_dotted) {
            return Some(Err(doubt));
        }
    }
    let is_worded = cells
        .iter()
        .all(|cell| of_period(cell).is_some() || cell.trim().chars().take(7).any(|c| c.is_alphabetic() && c != 'T'));
    match (dmy, mdy) {
        (true, true) if is_dotted || is_worded => Some(Ok(Syntax::Date(Order::Dmy))),
        (true, true) => Some(Err(Doubt::DayOrMonth)),
        (true, false) => Some(Ok(Syntax::Date(Order::Dmy))),
        (false, true) => Some(Ok(Syntax::Date(Order::Mdy))),
        (false, false) => all(Syntax::Date(Order::Ymd)).then_some(Ok(Syntax::Date(Order::Ymd))),
    }
}

/// Whether more than a quarter of the numbers are below the one before.
pub(crate) fn goes_back(sample: &[String]) -> bool {
    let numbers: Vec<f64> = sample.iter().filter_map(|cell| cell.parse().ok()).collect();
    let backward = numbers.windows(2).filter(|pair| pair[1] < pair[0]).count();
    4 * backward > numbers.len()
}

/// The offset that a name states, as `Date Time, GMT-07:00`, `Time (UTC +1)` and `time_utc`.
pub(crate) fn offset_in(name: &str) -> Option<String> {
    let lower = name.to_lowercase();
    let says = |zone: &str| {
        let words = || lower.split(|c: char| !c.is_ascii_alphanumeric());
        words().any(|word| word == zone) && !words().any(|word| matches!(word, "local" | "not"))
    };
    let Some(at) = name.find("GMT").or(name.find("UTC")) else {
        return says("utc").then(|| "UTC".to_owned());
    };
    let text: String = name[at + 3..]
        .trim_start()
        .chars()
        .take_while(|c| c.is_ascii_digit() || "+-:".contains(*c))
        .collect();
    if text.is_empty() && (says("utc") || says("gmt")) {
        return Some("UTC".to_owned());
    }
    civil::offset(&text).map(|_| text)
}

/// Whether dates of two digits each may be of one year that stands first: their first number stays, and their last changes, or all are one
/// day.
fn may_have_year_first(cells: &[&str]) -> Option<Doubt> {
    let dates: Option<Vec<[i64; 3]>> = cells
        .iter()
        .map(|cell| three(cell).filter(|(_, is_short)| *is_short).map(|(date, _)| date))
        .collect();
    let is_date = |[_, month, day]: &[i64; 3]| (1..=12).contains(month) && (1..=31).contains(day);
    let dates = dates?;
    let varies = |i: usize| dates.iter().any(|date| date[i] != dates[0][i]);
    if varies(0) || !dates.iter().all(is_date) {
        return None;
    }
    match (varies(1), varies(2)) {
        (_, true) => Some(Doubt::Year),
        (false, false) => Some(Doubt::YearOfOneDay),
        (true, false) => None,
    }
}

/// Whether a written time says something of its zone.
pub(crate) fn has_offset(text: &str, order: Order) -> bool {
    civil::written(text, order).is_some_and(|found| found.zone != Zone::Nothing)
}

/// Whether a text looks like a time that is no plain number.
pub(crate) fn looks_like_time(text: &str) -> bool {
    let text = civil::undressed(text);
    // A date has digits, and a year and a month, or a quarter, alone may be anything.
    !(text.len() == 7 && text.as_bytes()[4] == b'-')
        && of_period(text).is_none()
        && text.bytes().any(|c| c.is_ascii_digit())
        && text.starts_with(|c: char| c.is_ascii_alphanumeric())
        // Behind the name of a day or a month stand further words.
        && (text.as_bytes()[0].is_ascii_digit() || text.contains([' ', ',', '\t']))
        && !matches!(detect(&[text]), None | Some(Ok(Syntax::Number(_))))
}
