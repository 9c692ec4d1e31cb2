//! Ticks as text, and options of times.

use crate::error::Error;
use fewbits_record::{TimeBase, TimeFormat};
use fewbits_table::{Dialect, Scale, Time};

/// Decimals of a tick for UTC, and for tables that cannot be read twice.
pub(crate) const NANOSECONDS: u8 = 9;

/// Description of an invalid time: what is wrong, and what the user can do.
pub(crate) type Problem = (&'static str, &'static str);

pub(crate) const TOO_LARGE: Problem = (
    "does not fit ticks of 64 bits: it is too large, or times have too many decimals",
    "allow an error of times, as --time ±1ns or ±1us",
);
pub(crate) const TOO_FINE: Problem = (
    "has more decimals than a tick",
    "make the recording with an error of times, as --time ±2ns, or write fewer decimals",
);

/// What times of a recording are measured from.
pub(crate) fn scale(format: TimeFormat) -> Scale {
    match format {
        TimeFormat::Utc => Scale::Utc,
        TimeFormat::Local => Scale::Local,
        _ => Scale::Seconds,
    }
}

/// The tick of a time that a user wrote.
pub(crate) fn tick(text: &str, time: TimeBase) -> Result<i64, Problem> {
    const NO_TIME: Problem = ("is not a time", "write it as the recording does: seconds, or as 2026-01-31T12:00:00.5Z");
    let TimeBase::Clock {
        decimals,
        tolerance,
        format,
    } = time
    else {
        return text
            .parse()
            .map_err(|_| ("is not a row number", "write a whole number"));
    };
    // One column, and no line of names.
    let said = Dialect {
        delimiter: Some("\u{1}".to_owned()),
        no_header: Some(true),
        time_column: vec!["#1".to_owned()],
        ..Dialect::default()
    };
    let line = format!("{text}\n");
    let open = || {
        let mut table = fewbits_table::Table::open(std::io::Cursor::new(line), &said)?;
        let mut batch = fewbits_table::Batch::default();
        let found = table.time().map(|(_, scale)| scale);
        table.read(&mut batch, 1)?;
        Ok::<_, fewbits_table::Error>(batch.times.first().copied().zip(found))
    };
    let (found, own) = open().ok().flatten().ok_or(NO_TIME)?;
    if (own == Scale::Seconds) != (scale(format) == Scale::Seconds) {
        return Err(NO_TIME);
    }
    match found.ticks(decimals).ok_or(TOO_LARGE)? {
        (_, false) if tolerance == 0 => Err(TOO_FINE),
        (tick, _) => Ok(tick),
    }
}

/// A tick as text.
pub(crate) fn shown(tick: i64, time: TimeBase) -> String {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return tick.to_string();
    };
    let found = Time::from_ticks(tick, decimals);
    let decimals = if found.decimals() == 0 { 0 } else { decimals };
    found.shown(scale(format), decimals)
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
        assert!(tick("noon", seconds).is_err());
        let utc = clock(9, 0, TimeFormat::Utc);
        assert_eq!(shown(tick("2026-01-31T12:00:00.250Z", utc).unwrap(), utc), "2026-01-31T12:00:00.250000000Z");
        assert_eq!(tick("2014-04-10", utc), Ok(1_397_088_000_000_000_000));
        assert_eq!(tick("2014-04-10T02:00:00+02:00", utc), Ok(1_397_088_000_000_000_000));
        let local = clock(0, 0, TimeFormat::Local);
        assert_eq!(shown(tick("1952-01-01 00:00", local).unwrap(), local), "1952-01-01T00:00:00");
    }
}
