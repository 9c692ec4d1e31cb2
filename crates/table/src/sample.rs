//! How times are written, by a sample of their cells and by the names of their columns.

use crate::civil;
use crate::days::may_be_days;
use crate::dialect::Dialect;
use crate::error::Error;
use crate::guess::{self, Doubt};
use crate::interval;
use crate::parts::{Part, is_hour_and_minute, of_day_parts};
use crate::time::Unit;
use crate::written::{self, Order, Problem, Syntax};

/// Why cells are not taken for times.
pub(crate) enum Refused {
    /// An option is not understood.
    Option(Error),
    /// The row of the sample, and its problem.
    Cell(usize, Problem),
    Doubt(Doubt),
}

/// How times are written, or the refusal.
pub(crate) type Found = Result<Syntax, Refused>;

/// Numbers with the unit that the name of their column states. Times since 1970 keep that of their size if the name states seconds.
pub(crate) fn with_stated_unit(syntax: Syntax, names: &[&str], cells: &[&str], dialect: &mut Dialect) -> Syntax {
    let ([name], Syntax::Number(_), None) = (names, &syntax, &dialect.time_format) else {
        return syntax;
    };
    let Some((unit, _)) = interval::of_name(name).filter(|(unit, _)| *unit != "s" && !may_be_days(names, cells)) else {
        return syntax;
    };
    dialect.time_format = Some(unit.to_owned());
    interval::part(unit).map_or_else(|| Syntax::Since(interval::seconds(unit).unwrap_or(1), 0), Syntax::Number)
}

/// A date in the first column and the hour, and perhaps minute and second, in those behind it.
pub(crate) fn dated_hours(
    names: &[&str],
    sample: &[String],
    are_hours: Option<bool>,
    format: Option<&str>,
) -> Option<Found> {
    let mut behind = of_day_parts(names.get(1..)?.iter().copied());
    let is_alone = matches!((behind.as_slice(), names), ([], [_, name]) if !is_hour_and_minute(name));
    if is_alone && are_hours.is_some() {
        behind.push(Part::Hour);
    }
    // `Heure` may have whole times of day, as `21h30` and `21:30`.
    let is_of_day = |text: &String| {
        text.rsplit(' ')
            .next()
            .is_some_and(|last| civil::of_day(last).is_some())
    };
    if behind.is_empty() || behind.len() + 1 != names.len() || sample.first().is_some_and(is_of_day) {
        return None;
    }
    let date = |text: &String| {
        let words: Vec<&str> = text.split(' ').collect();
        words[..words.len().saturating_sub(behind.len())].join(" ")
    };
    let dates: Vec<String> = sample.iter().map(date).collect();
    let dates: Vec<&str> = dates.iter().map(String::as_str).collect();
    let order = match format {
        Some("dmy") => Order::Dmy,
        Some("mdy") => Order::Mdy,
        Some("ymd" | "iso") => Order::Ymd,
        Some(_) => return None,
        None => match majority(&dates) {
            Ok(Syntax::Date(order)) => order,
            Ok(_) => return None,
            Err(refused) => return Some(Err(refused)),
        },
    };
    if is_alone && are_hours == Some(false) {
        return Some(Err(Refused::Cell(0, written::HOURS)));
    }
    Some(Ok(Syntax::DateAnd(order, behind)))
}

/// How most of the cells are written: a garbled one must not decide.
pub(crate) fn majority(cells: &[&str]) -> Found {
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
    let is_spelled = |cell: &&str| interval::spelled(cell).is_some() || interval::lettered(cell).is_some();
    match found {
        Some(Ok(syntax)) => Ok(syntax),
        Some(Err(doubt)) => Err(Refused::Doubt(doubt)),
        None if cells.iter().all(is_spelled) => Ok(Syntax::Spelled),
        None => {
            let first = cells
                .iter()
                .position(|cell| guess::detect(&[cell]).is_none())
                .unwrap_or(0);
            Err(Refused::Cell(first, written::NO_TIME))
        }
    }
}
