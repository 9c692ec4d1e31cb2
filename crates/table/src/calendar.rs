//! Dates of the calendar: by month and day, by the day of the year, by weeks, and the names of months and days.

use jiff::civil::{Date, ISOWeekDate, Weekday};

/// Problem with a time and its mend.
pub(crate) type Problem = (&'static str, &'static str);

pub(crate) const NO_SUCH_DATE: Problem = (
    "is no date of the calendar",
    "mend the cell, say the order with --time-format dmy, mdy or ymd, or leave such rows out with --skip-bad",
);

const MONTHS: &str = "january|february|march|april|may|june|july|august|september|october|november|december";
const DAYS: &str = "monday|tuesday|wednesday|thursday|friday|saturday|sunday";

/// Beginnings of the names of months in other languages: German, Dutch, Swedish, French, Spanish, Italian, Portuguese, Russian.
const OTHERS: [&str; 12] = [
    "янв|ene|gen",
    "фев|fév|fev",
    "мар|mär|maa|mrt",
    "апр|avr|abr",
    "май|мая|mai|maj|mei|mag",
    "июн|juin|giu",
    "июл|juil|lug",
    "авг|aoû|aou|ago",
    "сен|set",
    "окт|okt|out|ott",
    "ноя",
    "дек|dez|dic",
];

/// Reads digits: their value and what follows.
pub(crate) fn digits(text: &str, at_most: usize) -> Option<(i64, usize, &str)> {
    let count = text.bytes().take(at_most).take_while(u8::is_ascii_digit).count();
    let value = text[..count].parse().ok()?;
    Some((value, count, &text[count..]))
}

/// The place of a word in a list of names, by three letters or more of it.
fn named(word: &str, names: &str) -> Option<usize> {
    let word = word.trim_end_matches('.').to_lowercase();
    if word.len() < 3 {
        return None;
    }
    names.split('|').position(|name| name.starts_with(&word))
}

/// The number of a month, from 0, by its name or three letters of it.
pub(crate) fn month_named(word: &str) -> Option<usize> {
    // Most words that are asked for are none, or parts of numbers.
    if word.len() < 3 || !word.starts_with(char::is_alphabetic) {
        return None;
    }
    named(word, MONTHS).or_else(|| {
        let word = word.trim_end_matches('.').to_lowercase();
        let word = if word == "déc" || word.starts_with("décem") {
            "dez"
        } else {
            word.as_str()
        };
        // Names that begin as the English ones do, as `mars`, `januari`, `oktober`.
        let like = || {
            let known = [
                "janu", "janv", "janeiro", "febr", "febbr", "mars", "marz", "março", "märz", "april", "juni", "junho",
                "juli", "julho", "augus", "sept", "octu", "octo", "outu", "novem", "decem", "desem",
            ];
            let begin = known.iter().find(|begin| word.starts_with(*begin))?;
            MONTHS.split('|').position(|name| name.starts_with(&begin[..3]))
        };
        let begins = |begins: &&str| begins.split('|').any(|begin| word.starts_with(begin));
        OTHERS.iter().position(begins).or_else(like)
    })
}

/// Whether a word names a day of the week.
pub(crate) fn is_day_name(word: &str) -> bool {
    named(word, DAYS).is_some()
}

/// A date.
pub(crate) fn checked(year: i64, month: i64, day: i64) -> Result<Date, Problem> {
    match (i16::try_from(year), i8::try_from(month), i8::try_from(day)) {
        (Ok(year), Ok(month), Ok(day)) => Date::new(year, month, day).map_err(|_| NO_SUCH_DATE),
        _ => Err(NO_SUCH_DATE),
    }
}

/// A day of a year, counted from 1.
pub(crate) fn day_of_year(year: i64, day: i64) -> Result<Date, Problem> {
    let first = checked(year, 1, 1)?;
    let date = first
        .checked_add(jiff::Span::new().try_days(day - 1).map_err(|_| NO_SUCH_DATE)?)
        .map_err(|_| NO_SUCH_DATE)?;
    if day >= 1 && date.year() == first.year() {
        Ok(date)
    } else {
        Err(NO_SUCH_DATE)
    }
}

/// A day of a week of ISO 8601, both counted from 1.
pub(crate) fn of_week(year: i64, week: i64, day: i64) -> Result<Date, Problem> {
    let small = |number: i64| i8::try_from(number).map_err(|_| NO_SUCH_DATE);
    let weekday = Weekday::from_monday_one_offset(small(day)?).map_err(|_| NO_SUCH_DATE)?;
    let year = i16::try_from(year).map_err(|_| NO_SUCH_DATE)?;
    let date = ISOWeekDate::new(year, small(week)?, weekday).map_err(|_| NO_SUCH_DATE)?;
    Ok(date.date())
}
