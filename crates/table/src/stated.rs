//! What the name of a column of times states beside its unit: the order of dates, and the zero of numbers; calendars by their years.

use crate::civil::{self, Order, Problem};
use crate::interval;
use crate::worded::three;

/// The order of day, month and year that a pattern in a name states, as of `Time (DD/MM/YYYY h:mm:ss A)`.
pub(crate) fn order(names: &[&str]) -> Option<Order> {
    names.iter().find_map(|name| {
        let name = name.to_lowercase();
        let has = |patterns: [&str; 3]| patterns.iter().any(|pattern| name.contains(pattern));
        if has(["dd/mm", "dd.mm", "dd-mm"]) {
            Some(Order::Dmy)
        } else if has(["mm/dd", "mm.dd", "mm-dd"]) && !name.contains("yy/") && !name.contains("yy-") {
            Some(Order::Mdy)
        } else {
            has(["yy/mm", "yy.mm", "yy-mm"]).then_some(Order::Ymd)
        }
    })
}

const UNEVEN: Problem = (
    "counts units of different lengths, or parts of a second, from a date, by the name of its column",
    "convert the column to dates, or name another column with --time-column",
);

/// The seconds of the unit and those of the zero since 1970 of numbers whose name has both, as `hours since 1970-01-01 00:00`.
pub(crate) fn zero(names: &[&str]) -> Option<Result<(i64, i64), Problem>> {
    let [name] = names else { return None };
    let at = name.to_ascii_lowercase().find(" since ")?;
    let date = name[at + 7..].trim_matches(|c: char| !c.is_alphanumeric());
    let found = civil::written(date, Order::Ymd)?;
    let zone = match found.zone {
        civil::Zone::Nothing => 0,
        civil::Zone::Offset(offset) => offset,
        _ => return None,
    };
    let zero = civil::seconds(found.date.ok()?, found.second) - zone;
    let word = name[..at].rsplit(|c: char| !c.is_alphanumeric()).next()?.to_lowercase();
    let seconds = match word.as_str() {
        "day" | "d" => Some(86_400),
        word => match interval::of_name(word) {
            Some(("s", "")) => Some(1),
            Some((unit, "")) => interval::seconds(unit),
            _ => None,
        },
    };
    let is_uneven = ["month", "year", "ms", "milli", "us", "micro", "ns", "nano"];
    match seconds {
        Some(unit) => Some(Ok((unit, zero))),
        None => is_uneven
            .iter()
            .any(|unit| word.starts_with(unit))
            .then_some(Err(UNEVEN)),
    }
}

/// Years of the Buddhist era from 1900 to 2100.
const BUDDHIST: std::ops::RangeInclusive<i64> = 2443..=2643;
/// Years of the Persian and the Islamic calendar since 1880.
const PERSIAN: std::ops::RangeInclusive<i64> = 1298..=1500;
/// Years of the Buddhist era before those of the common one.
pub(crate) const BEFORE: i64 = 543;

/// What the years of dates say of their calendar, if all are years of another one.
pub(crate) fn calendar(cells: &[&str]) -> Option<Problem> {
    let year = |cell: &&str| {
        let ([first, _, last], _) = three(cell)?;
        [first, last].into_iter().find(|number| *number > 999)
    };
    let all = |years: std::ops::RangeInclusive<i64>| {
        !cells.is_empty()
            && cells
                .iter()
                .all(|cell| year(cell).is_some_and(|year| years.contains(&year)))
    };
    if all(BUDDHIST) {
        Some((
            "has a year of the Buddhist era, or one of the far future",
            "say --time-format be for the first, ymd or dmy to take the year as it is",
        ))
    } else {
        all(PERSIAN).then_some((
            "has a year of the Persian or the Islamic calendar, or one of the Middle Ages",
            "convert the column for the first; say --time-format ymd or dmy to take the year as it is",
        ))
    }
}

/// A date with a year of the Buddhist era, with that of the common era, and the order of its parts.
pub(crate) fn of_common_era(text: &str) -> Option<(String, Order)> {
    let mut runs = text.split(|c: char| !c.is_ascii_digit());
    let year = runs.find(|run| run.len() == 4 && run.parse().is_ok_and(|year| BUDDHIST.contains(&year)))?;
    let common = year.parse::<i64>().ok()? - BEFORE;
    let order = if text.trim_start().starts_with(year) {
        Order::Ymd
    } else {
        Order::Dmy
    };
    Some((text.replacen(year, &common.to_string(), 1), order))
}
