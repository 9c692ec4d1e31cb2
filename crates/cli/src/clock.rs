//! Times as text: seconds with decimals, or UTC.

use crate::error::Error;
use fewbits_record::{TimeBase, TimeFormat};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Decimals of a tick for UTC, and for tables that cannot be read twice.
pub(crate) const NANOSECONDS: u8 = 9;

/// Description of an invalid time: what is wrong, and what the user can do.
pub(crate) type Problem = (&'static str, &'static str);

pub(crate) const NO_TIME: Problem = (
    "is not a time",
    "write seconds, or UTC as 2026-01-31T12:00:00.5Z, or name another column with --time-column",
);
const TOO_LARGE: Problem = ("is too large for a time", "subtract a constant, or write fewer decimals");
const TOO_FINE: Problem =
    ("has more decimals than a tick", "allow an error of times with --time ±2ns, or write fewer decimals");

/// A plain decimal number: sign, digits before and after the point.
struct Digits<'a> {
    negative: bool,
    whole: &'a str,
    decimals: &'a str,
}

fn digits(text: &str) -> Option<Digits<'_>> {
    let (negative, size) = match text.strip_prefix('-') {
        Some(size) => (true, size),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, decimals) = size.split_once('.').unwrap_or((size, ""));
    let is_plain = !(whole.is_empty() && decimals.is_empty())
        && whole.bytes().chain(decimals.bytes()).all(|byte| byte.is_ascii_digit());
    is_plain.then_some(Digits {
        negative,
        whole,
        decimals: decimals.trim_end_matches('0'),
    })
}

/// The same number without an exponent.
fn plain(text: &str) -> Result<String, Problem> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(format!("{number}")),
        _ => Err(NO_TIME),
    }
}

/// The format of a time; `None` if the text is not a time.
pub(crate) fn format_of(text: &str) -> Option<TimeFormat> {
    if plain(text).is_ok() {
        Some(TimeFormat::Seconds)
    } else {
        utc(text).is_ok().then_some(TimeFormat::Utc)
    }
}

/// Decimals that a number of seconds needs.
pub(crate) fn decimals_of(text: &str) -> Option<u8> {
    let text = if digits(text).is_some() {
        text.to_owned()
    } else {
        plain(text).ok()?
    };
    digits(&text).and_then(|digits| u8::try_from(digits.decimals.len()).ok())
}

fn utc(text: &str) -> Result<i64, Problem> {
    // A date alone is its midnight.
    let with_time = if text.len() == 10 {
        format!("{text} 00:00:00")
    } else {
        text.to_owned()
    };
    let time = humantime::parse_rfc3339_weak(&with_time).map_err(|_| NO_TIME)?;
    let since = time.duration_since(UNIX_EPOCH).map_err(|_| TOO_LARGE)?;
    i64::try_from(since.as_nanos()).map_err(|_| TOO_LARGE)
}

/// The tick of a time.
pub(crate) fn tick(text: &str, time: TimeBase) -> Result<i64, Problem> {
    let TimeBase::Clock {
        decimals,
        tolerance,
        format,
        ..
    } = time
    else {
        return text
            .parse()
            .map_err(|_| ("is not a row number", "write a whole number"));
    };
    if format == TimeFormat::Utc {
        return utc(text);
    }
    let owned;
    let number = match digits(text) {
        Some(number) => number,
        None => {
            owned = plain(text)?;
            digits(&owned).ok_or(NO_TIME)?
        }
    };
    let places = usize::from(decimals);
    if number.decimals.len() > places && tolerance == 0 {
        return Err(TOO_FINE);
    }
    let kept = &number.decimals[..number.decimals.len().min(places)];
    // The digits with zeros behind them are the number of ticks. This is exact, unlike a product of doubles.
    let all: i128 = format!("0{}{kept:0<places$}", number.whole)
        .parse()
        .map_err(|_| TOO_LARGE)?;
    i64::try_from(if number.negative { -all } else { all }).map_err(|_| TOO_LARGE)
}

/// A tick as text.
pub(crate) fn shown(tick: i64, time: TimeBase) -> String {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return tick.to_string();
    };
    if let (TimeFormat::Utc, Ok(nanoseconds)) = (format, u64::try_from(tick)) {
        let time = SystemTime::checked_add(&UNIX_EPOCH, Duration::from_nanos(nanoseconds));
        // RFC 3339 has no years beyond 9999, but a tick of 64 bits ends in 2262.
        return time.map_or(tick.to_string(), |time| humantime::format_rfc3339(time).to_string());
    }
    let size = tick.unsigned_abs();
    let sign = if tick < 0 { "-" } else { "" };
    let ten = 10_u64.pow(u32::from(decimals.min(18)));
    let (whole, rest) = (size / ten, size % ten);
    let rest = format!("{rest:0places$}", places = usize::from(decimals));
    let rest = rest.trim_end_matches('0');
    if rest.is_empty() {
        format!("{sign}{whole}")
    } else {
        format!("{sign}{whole}.{rest}")
    }
}

/// The tolerance in nanoseconds from `exact` or text like `±10ms`.
pub(crate) fn tolerance(text: &str) -> Result<u64, Error> {
    if text == "exact" {
        return Ok(0);
    }
    let size = text.strip_prefix('±').or(text.strip_prefix("+-")).unwrap_or(text);
    let duration = humantime::parse_duration(size)
        .map_err(|_| Error::option("--time", text, "`exact`, or how far times may be off, as `±10ms`"))?;
    // The largest tolerance of a recording is 2^52 ticks.
    Ok(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX).min(1 << 52))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn clock(decimals: u8, tolerance: u64, format: TimeFormat) -> TimeBase {
        TimeBase::Clock {
            decimals,
            tolerance,
            format,
        }
    }

    #[test]
    fn times_return_as_they_were_written() {
        let seconds = clock(3, 0, TimeFormat::Seconds);
        for text in ["0", "12.5", "-0.125", "1518567890.001"] {
            assert_eq!(shown(tick(text, seconds).unwrap(), seconds), text);
        }
        assert_eq!(tick("1.5e2", seconds), Ok(150_000));
        assert_eq!(tick("0.1234", seconds), Err(TOO_FINE));
        assert_eq!(tick("noon", seconds), Err(NO_TIME));
        let utc = clock(9, 0, TimeFormat::Utc);
        assert_eq!(shown(tick("2026-01-31 12:00:00.250", utc).unwrap(), utc), "2026-01-31T12:00:00.250000000Z");
        assert_eq!(tick("2014-04-10", utc), Ok(1_397_088_000_000_000_000));
    }
}
