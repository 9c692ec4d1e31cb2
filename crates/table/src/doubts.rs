//! Numbers that would be read as seconds or as parts of them, and may count something else.

use crate::days::{may_be_compact, may_be_days};
use crate::named::NAMES;
use crate::names::is_one_of;
use crate::time::{SECOND, Time, Unit};
use crate::written::{FAR, Problem};

/// Seconds from 1970 to 2200: later times of a logger count from another year.
const SECONDS_OF_2200: f64 = 7_258_118_400.0;
/// Seconds since 1970 of the years from 1990 to 2100.
const EPOCH_SECONDS: std::ops::Range<f64> = 631_152_000.0..4_102_444_800.0;
/// Numbers of 100 nanoseconds since 1601 (file times of Windows) from 1997 to 2100, and since the year 1 (ticks of .NET) from 1966 to 2092. As
/// nanoseconds since 1970 they are of 1973 to 1975 and of 1989 to 1990.
const OTHER_ZEROS: [[f64; 2]; 2] = [[1.26e17, 1.58e17], [6.2e17, 6.6e17]];
const OTHER_ZERO: (&str, &str) = (
    "may count 100 ns since 1601 (Windows) or since the year 1 (.NET)",
    "say --time-format ns if it counts nanoseconds since 1970; otherwise convert the column",
);

const DAYS: Problem = (
    "may be a number of days, as spreadsheets have them",
    "say --time-format excel, or --time-format s if these are seconds",
);
const JULIAN: Problem = (
    "may be a Julian date, a number of days",
    "say --time-format jd (or mjd), d for days since another zero, or --time-format s if these are seconds",
);
const COMPACT: Problem = (
    "may be a date whose digits have no marks",
    "say its format, as --time-format %y%m%d%H%M or %d%m%Y, or --time-format s if these are seconds",
);

const PARTS_OF_A_DAY: Problem = (
    "may be a part of a day, as spreadsheets have times of day",
    "say --time-format d, or --time-format s if these are seconds",
);
const YEARS: Problem = (
    "may be a year with decimals",
    "write dates in place of it, name another column with --time-column, or say --time-format s if these are seconds",
);
const WHOLE_YEARS: Problem = (
    "may be a year",
    "say --time-format %Y, name another column with --time-column, or say --time-format s if these are seconds",
);
const TIME_OF_DAY: Problem = (
    "may be a time of day whose digits have no marks",
    "write them with marks, as 09:30, or with zeros in front, or say --time-format s if these are seconds",
);
const MONTHS: Problem = (
    "may be a month whose digits have no marks",
    "say --time-format %Y%m, or --time-format s if these are seconds",
);
const CUT: Problem = (
    "has lost its last digits, as spreadsheets show large numbers",
    "export the column as whole numbers; or say its unit, as --time-format ms, to take it as it is",
);
const MIXED: Problem = (
    "is a time of another unit than others of the column",
    "write all in one unit, or say the unit with --time-format, as ms",
);
const SEXAGESIMAL: Problem = (
    "has minutes and seconds on both sides of the point, by the name of its column",
    "say --time-format %M.%S (or %H.%M), or --time-format s if these are seconds",
);
/// Names of such columns.
const SEXAGESIMALS: [&str; 5] = ["min.sec", "mm.ss", "m.ss", "hh.mm", "h.mm"];
const MATLAB: Problem = (
    "may be a number of days since the year 0",
    "say --time-format matlab, or --time-format s if these are seconds",
);

/// The largest size of the numbers.
pub(crate) fn largest(cells: &[&str]) -> f64 {
    let numbers = cells.iter().filter_map(|cell| cell.parse::<f64>().ok());
    numbers.fold(0.0, |most, x| most.max(x.abs()))
}

/// What numbers of a unit may count instead.
pub(crate) fn of_numbers(names: &[&str], cells: &[&str], unit: Unit) -> Option<Problem> {
    if unit == Unit::Seconds {
        let found = if may_be_days(names, cells) {
            Some(DAYS)
        } else if may_be_julian(names, cells) {
            Some(JULIAN)
        } else if may_be_matlab(names, cells) {
            Some(MATLAB)
        } else if may_be_years(names, cells) {
            let has_decimals = cells.iter().any(|cell| decimals(cell) > 0);
            Some(if has_decimals { YEARS } else { WHOLE_YEARS })
        } else if are_even_only(cells, 1440, minutes) || are_even_only(cells, 86_400, seconds) {
            Some(TIME_OF_DAY)
        } else if are_even_only(cells, i64::MAX, months) || are_months_by_name(names, cells) {
            Some(MONTHS)
        } else if matches!(names, [name] if SEXAGESIMALS.iter().any(|words| name.to_lowercase().contains(words))) {
            Some(SEXAGESIMAL)
        } else {
            may_be_parts_of_a_day(names, cells).then_some(PARTS_OF_A_DAY)
        };
        if found.is_some() {
            return found;
        }
    } else if cells
        .iter()
        .any(|cell| cell.parse().is_ok_and(|x: f64| EPOCH_SECONDS.contains(&x)))
    {
        // Milliseconds of January 1970 beside those of later years.
        return Some(MIXED);
    } else if largest(cells) > SECONDS_OF_2200 * 10_f64.powi(i32::from(unit.decimals())) {
        return Some(FAR);
    }
    if cells.iter().any(|cell| has_lost_digits(cell, unit)) {
        return Some(CUT);
    }
    if may_be_compact(names, cells) {
        return Some(COMPACT);
    }
    let is_other = |[first, last]: &[f64; 2]| are_within(cells, *first, *last);
    (unit == Unit::Nanoseconds && OTHER_ZEROS.iter().any(is_other)).then_some(OTHER_ZERO)
}

/// The largest time of a column whose cells are times since 1970 of these years.
pub(crate) fn most(cells: &[&str], unit: Unit) -> Time {
    let size = 10_f64.powi(i32::from(unit.decimals()));
    match are_within(cells, EPOCH_SECONDS.start * size, EPOCH_SECONDS.end * size) {
        true => Time(SECONDS_OF_2200 as i128 * SECOND),
        false => Time(i128::MAX),
    }
}

/// Whether there are cells, and all are numbers from `low` to below `high`.
fn are_within(cells: &[&str], low: f64, high: f64) -> bool {
    let is_within = |cell: &&str| cell.parse().is_ok_and(|x: f64| (low..high).contains(&x));
    !cells.is_empty() && cells.iter().all(is_within)
}

/// Whether a word of the only name is one of these.
fn is_called(names: &[&str], known: &str) -> bool {
    let [name] = names else { return false };
    let name = name.to_lowercase();
    let mut words = name.split(|c: char| !c.is_alphanumeric());
    words.any(|word| is_one_of(known, word))
}

/// Whether a column is named as one of Julian dates, whatever it counts from, or has numbers of their size.
fn may_be_julian(names: &[&str], cells: &[&str]) -> bool {
    // Seconds since a start have no quarters alone beyond four weeks.
    let is_share = |cell: &&str| {
        cell.parse()
            .is_ok_and(|x: f64| x.fract() != 0.0 && (2.0 * x).fract() == 0.0)
    };
    let is_since_1941 = || are_within(cells, 2_430_000.0, 2_475_000.0) && cells.iter().any(is_share);
    (is_called(names, "time|date") && is_since_1941())
        || (is_called(names, "julian") && are_within(cells, 2_300_000.0, 2_600_000.0))
        || is_called(names, "jd|bjd|hjd|mjd|rjd|tjd|btjd|bkjd")
}

/// Whether a column has numbers of the size of days since the year 0, from 1916 to 2190, with times of day, or a name that says so.
fn may_be_matlab(names: &[&str], cells: &[&str]) -> bool {
    let is_named = is_called(names, "datenum|matlab|date|datum");
    let has_share = cells.iter().any(|cell| decimals(cell) >= 5);
    (is_named || has_share) && are_within(cells, 700_000.0, 800_000.0)
}

/// Whether a column is named as one of years, or the decimals are rounded parts of one.
fn may_be_years(names: &[&str], cells: &[&str]) -> bool {
    const WORDS: &str = "date|datum|year|yr|decimal|dec|decyear|decimalyear|yeardecimal|jahr|anno|frac";
    // Halves of months, and of days.
    let are_parts = || [24, 730, 732].iter().any(|parts| are_rounded_parts(cells, *parts));
    are_within(cells, 1500.0, 2300.0) && (is_called(names, WORDS) || are_parts())
}

/// Fewest numbers of which the distances are compared.
const FEWEST: usize = 5;

/// Whether whole numbers are evenly spaced as what `read` makes of them, around a circle of so many, and not as they are.
fn are_even_only(cells: &[&str], circle: i64, read: fn(i64) -> Option<i64>) -> bool {
    let numbers: Option<Vec<i64>> = cells.iter().map(|cell| cell.parse().ok()).collect();
    let Some(numbers) = numbers.filter(|numbers| numbers.len() >= FEWEST) else {
        return false;
    };
    let are_even = |numbers: &[i64], circle: i64| {
        let step = |pair: &[i64]| (pair[1] - pair[0]).rem_euclid(circle);
        step(numbers) != 0 && numbers.windows(2).all(|pair| step(pair) == step(numbers))
    };
    let meant: Option<Vec<i64>> = numbers.iter().map(|number| read(*number)).collect();
    meant.is_some_and(|meant| are_even(&meant, circle)) && !are_even(&numbers, i64::MAX)
}

/// Minutes of a day by hours and minutes without marks.
fn minutes(number: i64) -> Option<i64> {
    ((0..=2400).contains(&number) && number % 100 < 60).then_some(number / 100 * 60 + number % 100)
}

/// Seconds of a day by hours, minutes and seconds without marks.
fn seconds(number: i64) -> Option<i64> {
    Some(60 * minutes(number / 100)? + number % 100).filter(|_| number >= 0 && number % 100 < 60)
}

/// Months since the year 0 by year and month without marks.
fn months(number: i64) -> Option<i64> {
    ((1500..2300).contains(&(number / 100)) && (1..=12).contains(&(number % 100)))
        .then_some(number / 100 * 12 + number % 100)
}

/// Whether a column that is called so has years and months without marks, also of one year, whose numbers are evenly spaced.
fn are_months_by_name(names: &[&str], cells: &[&str]) -> bool {
    let is_month = |cell: &&str| cell.len() == 6 && cell.parse().ok().and_then(months).is_some();
    is_called(names, "month|monat|yyyymm|yearmonth|period|date|datum") && cells.iter().all(is_month)
}

/// Whether a column of the time has rounded parts of a day, a quarter of an hour apart at most or beginning anew after less than one.
fn may_be_parts_of_a_day(names: &[&str], cells: &[&str]) -> bool {
    let is_time =
        matches!(names, [name] if is_one_of(NAMES, &name.to_lowercase()) || name.to_lowercase().contains("time"));
    if !is_time || !are_within(cells, 0.0, 1.0 + 1e-9) {
        return false;
    }
    let numbers: Vec<f64> = cells.iter().filter_map(|cell| cell.parse().ok()).collect();
    let steps = || numbers.windows(2).map(|pair| pair[1] - pair[0]);
    // 24 images a second are as far apart as hours of a day.
    let is_short = steps().all(|step| step < 1.01 / 96.0) && steps().any(|step| step > 0.0);
    let begins_anew = steps().any(|step| step < -0.5);
    (is_short || begins_anew) && [1440, 86_400].iter().any(|parts| are_rounded_parts(cells, *parts))
}

/// Whether a time since 1970 is written with an exponent and so few digits that it is told to ten seconds at best.
fn has_lost_digits(cell: &str, unit: Unit) -> bool {
    let Some((digits, exponent)) = cell.split_once(['e', 'E']) else {
        return false;
    };
    let last = exponent.parse::<i32>().unwrap_or(0)
        - digits
            .split_once(['.', ','])
            .map_or(0, |(_, places)| places.len() as i32);
    last > i32::from(unit.decimals()) && cell.replacen(',', ".", 1).parse::<f64>().is_ok_and(|x| x > 1e8)
}

/// Number of decimals of a plain number.
fn decimals(cell: &str) -> usize {
    cell.split_once('.').map_or(0, |(_, places)| places.len())
}

/// Largest probability that numbers of other kinds look like rounded parts.
const CHANCE: f64 = 1e-6;

/// Whether all numbers are multiples of `1 / parts`, rounded to their decimals, and so many of them are not so without rounding that chance
/// does not explain it.
fn are_rounded_parts(cells: &[&str], parts: u32) -> bool {
    let mut chance = 1.0;
    for cell in cells {
        let places = decimals(cell);
        let is_plain = cell.bytes().all(|c| c.is_ascii_digit() || c == b'.');
        let Some((value, scale)) = cell
            .parse::<f64>()
            .ok()
            .filter(|_| is_plain)
            .zip(10_u128.checked_pow(places as u32))
        else {
            return false;
        };
        let shares = value * f64::from(parts);
        let share = f64::from(parts) * (0.51 / scale as f64 + 4.0 * f64::EPSILON * value.abs());
        if (shares - shares.round()).abs() > share {
            return false;
        }
        let is_exact = (shares.round() as u128)
            .checked_mul(scale)
            .is_none_or(|all| all % u128::from(parts) == 0);
        if !is_exact {
            chance *= (2.0 * share).clamp(1e-3, 1.0);
        }
    }
    chance < CHANCE
}
