//! The usual spellings of times, read without copies. What is not taken here is left to the reader of all spellings, which a test compares.

use crate::civil::Order;
use crate::time::{DECIMALS, SECOND, Scale, Time};

/// Digits with a point, of a unit of `10^-decimals` seconds.
pub(crate) fn ticks(text: &[u8], unit: u8) -> Option<Time> {
    let (negative, size) = match text {
        [b'-', size @ ..] => (true, size),
        size => (false, size),
    };
    let (mut mantissa, mut places, mut point) = (0_u64, 0_u8, false);
    if size.is_empty() || size.len() > 19 {
        return None;
    }
    for byte in size {
        match byte {
            b'0'..=b'9' => {
                mantissa = mantissa * 10 + u64::from(byte - b'0');
                places += u8::from(point);
            }
            b'.' if !point && size.len() > 1 => point = true,
            _ => return None,
        }
    }
    let up = DECIMALS.checked_sub(unit)?.checked_sub(places)?;
    let ticks = i128::from(mantissa) * 10_i128.pow(up.into());
    Some(Time(if negative { -ticks } else { ticks }))
}

/// Two digits.
fn two(text: &[u8], at: usize) -> Option<i64> {
    match text.get(at..at + 2)? {
        [a @ b'0'..=b'9', b @ b'0'..=b'9'] => Some(i64::from(a - b'0') * 10 + i64::from(b - b'0')),
        _ => None,
    }
}

/// One digit or two, and what follows.
fn short(text: &[u8]) -> Option<(i64, &[u8])> {
    match text {
        [a @ b'0'..=b'9', b @ b'0'..=b'9', rest @ ..] => Some((i64::from(a - b'0') * 10 + i64::from(b - b'0'), rest)),
        [a @ b'0'..=b'9', rest @ ..] => Some((i64::from(a - b'0'), rest)),
        _ => None,
    }
}

/// Year, month and day at the beginning of a text, and what follows. A year of four digits that stands first is read alike in any order.
fn civil(text: &[u8], order: Order) -> Option<([i64; 3], &[u8])> {
    if let (Some(b'-' | b'/'), true) = (text.get(4), text.get(7) == text.get(4)) {
        let date = [two(text, 0)? * 100 + two(text, 2)?, two(text, 5)?, two(text, 8)?];
        return Some((date, &text[10..]));
    }
    let (first, rest) = short(text)?;
    let (mark, rest) = rest
        .split_first()
        .filter(|(mark, _)| matches!(mark, b'/' | b'-' | b'.'))?;
    let (second, rest) = short(rest)?;
    let rest = rest.strip_prefix(std::slice::from_ref(mark))?;
    let year = two(rest, 0)? * 100 + two(rest, 2)?;
    let rest = &rest[4..];
    match order {
        Order::Dmy => Some(([year, second, first], rest)),
        Order::Mdy => Some(([year, first, second], rest)),
        Order::Ymd => None,
    }
}

/// The first two numbers of a date whose year does not stand first, and whether the third has two digits.
pub(crate) fn first_two(text: &[u8]) -> Option<(i64, i64, bool)> {
    let (first, rest) = short(text)?;
    let (mark, rest) = rest
        .split_first()
        .filter(|(mark, _)| matches!(mark, b'/' | b'-' | b'.'))?;
    let (second, rest) = short(rest)?;
    let rest = rest.strip_prefix(std::slice::from_ref(mark))?;
    Some((first, second, !rest.get(2).is_some_and(u8::is_ascii_digit)))
}

/// Seconds and attoseconds of a time of day, and what follows.
fn clock(text: &[u8]) -> Option<(i64, u64, &[u8])> {
    let (hours, rest) = short(text)?;
    let minutes = rest.strip_prefix(b":").and_then(|rest| two(rest, 0))?;
    let mut rest = &rest[3..];
    let (mut seconds, mut fraction) = (0, 0);
    if rest.first() == Some(&b':') {
        seconds = two(rest, 1)?;
        rest = &rest[3..];
        if rest.first() == Some(&b'.') {
            let digits = rest[1..].iter().take_while(|c| c.is_ascii_digit()).count();
            if !(1..=usize::from(DECIMALS)).contains(&digits) {
                return None;
            }
            // Eighteen digits fit 64 bits.
            let number = rest[1..=digits].iter().fold(0, |sum, c| sum * 10 + u64::from(c - b'0'));
            fraction = number * 10_u64.pow(u32::from(DECIMALS) - digits as u32);
            rest = &rest[digits + 1..];
        }
    }
    (minutes < 60 && seconds < 60).then_some((hours * 3600 + minutes * 60 + seconds, fraction, rest))
}

/// A time of day as `9:42`, `21:30:00` or `21:30:00.5`.
pub(crate) fn of_day(text: &[u8]) -> Option<Time> {
    let (second, fraction, rest) = clock(text)?;
    // `0:30.5` are minutes.
    rest.is_empty().then(|| Time::checked(second, i128::from(fraction)))
}

/// A date as `2026-01-31`, or as `31.1.2026` or `1/31/2026` in its order, with a time of day as `T12:00`, `12:00:00`, `12:00:00.5` or
/// `9:42 PM`, with `Z` or `+01:00` behind it if `scale` is UTC, and nothing otherwise.
pub(crate) fn date(text: &[u8], order: Order, scale: Scale) -> Option<Time> {
    let ([year, month, day], rest) = civil(text, order)?;
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let length = match month {
        2 => 28 + i64::from(is_leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return None,
    };
    if !(1..=length).contains(&day) {
        return None;
    }
    let (mut second, mut fraction, mut rest) = (0, 0, rest);
    if let Some((mark, behind)) = rest.split_first() {
        if !matches!(mark, b' ' | b'T') {
            return None;
        }
        (second, fraction, rest) = clock(behind)?;
        if second >= 86_400 {
            return None;
        }
        if let [b' ', half @ (b'A' | b'P' | b'a' | b'p'), b'M' | b'm', behind @ ..] = rest {
            if !(3600..13 * 3600).contains(&second) {
                return None;
            }
            second = second % 43_200 + if half.eq_ignore_ascii_case(&b'P') { 43_200 } else { 0 };
            rest = behind;
        }
    }
    let offset = match (rest, scale) {
        ([], Scale::Local | Scale::Seconds) => 0,
        ([b'Z'], Scale::Utc) => 0,
        ([sign @ (b'+' | b'-'), _, _, b':', _, _], Scale::Utc) => {
            let (hours, minutes) = (two(rest, 1)?, two(rest, 4)?);
            if hours > 18 || minutes > 59 {
                return None;
            }
            let size = hours * 3600 + minutes * 60;
            if *sign == b'-' { -size } else { size }
        }
        _ => return None,
    };
    // Days of the proleptic Gregorian calendar: years begin in March, so that leap days are last.
    let (year, month) = if month <= 2 {
        (year - 1, month + 9)
    } else {
        (year, month - 3)
    };
    let days =
        365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400) + (153 * month + 2) / 5 + day;
    let since_1970 = (days - 719_469) * 86_400 + second - offset;
    Some(Time(i128::from(since_1970) * SECOND + i128::from(fraction)))
}
