//! The usual spellings of times, read without copies. What is not taken here is left to the reader of all spellings, which a test compares.

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

/// A date as `2026-01-31`, with a time of day as `T12:00`, `12:00:00` or `12:00:00.5`, with `Z` or `+01:00` behind it if `scale` is UTC, and
/// nothing otherwise. A year that stands first is read alike in any order.
pub(crate) fn date(text: &[u8], scale: Scale) -> Option<Time> {
    let mark = *text.get(4)?;
    if !matches!(mark, b'-' | b'/') || *text.get(7)? != mark {
        return None;
    }
    let (year, month, day) = (two(text, 0)? * 100 + two(text, 2)?, two(text, 5)?, two(text, 8)?);
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
    let (mut second, mut fraction, mut rest) = (0, 0, &text[10..]);
    if !rest.is_empty() {
        if !matches!(rest[0], b' ' | b'T') || *rest.get(3)? != b':' {
            return None;
        }
        let (hours, minutes) = (two(rest, 1)?, two(rest, 4)?);
        second = hours * 3600 + minutes * 60;
        rest = &rest[6..];
        let mut seconds = 0;
        if rest.first() == Some(&b':') {
            seconds = two(rest, 1)?;
            rest = &rest[3..];
            if rest.first() == Some(&b'.') {
                let digits = rest[1..].iter().take_while(|c| c.is_ascii_digit()).count();
                if !(1..=usize::from(DECIMALS)).contains(&digits) {
                    return None;
                }
                fraction = rest[1..=digits]
                    .iter()
                    .fold(0, |sum, c| sum * 10 + i128::from(c - b'0'));
                fraction *= 10_i128.pow(u32::from(DECIMALS) - digits as u32);
                rest = &rest[digits + 1..];
            }
        }
        if hours > 23 || minutes > 59 || seconds > 59 {
            return None;
        }
        second += seconds;
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
    Some(Time(i128::from(since_1970) * SECOND + fraction))
}
