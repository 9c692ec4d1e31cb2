//! Times of tables as ticks of recordings, and ticks as text.

use fewbits_record::{TimeBase, TimeFormat};
use fewbits_table::{Dialect, Scale, Table, Time};

/// Decimals of a tick for UTC, and for tables that cannot be read twice.
pub const NANOSECONDS: u8 = 9;

/// Description of an invalid time: what is wrong, and what the user can do.
pub type Problem = (&'static str, &'static str);

/// The problem of a time that 64 bits do not hold.
pub const TOO_LARGE: Problem = (
    "does not fit ticks of 64 bits: it is too large, or times have too many decimals",
    "allow an error of times, as --time ±2ns or ±1us",
);
/// The problem of a time between two exact ticks.
pub const TOO_FINE: Problem = (
    "has more decimals than a tick",
    "make the recording with an error of times, as --time ±2ns, or write fewer decimals",
);

/// What times of a recording are measured from.
pub fn scale(format: TimeFormat) -> Scale {
    match format {
        TimeFormat::Utc => Scale::Utc,
        TimeFormat::Local => Scale::Local,
        _ => Scale::Seconds,
    }
}

/// An end of a range of times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Rows at this time and behind it.
    From,
    /// Rows at this time and before it.
    To,
}

/// The tick of a time that a user wrote as an end of a range: of a time between two ticks, the one that lies in the range.
///
/// # Errors
/// What is expected instead, if the text is no time, or one that the recording cannot have.
pub fn tick(text: &str, time: TimeBase, end: End) -> Result<i64, &'static str> {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return text
            .parse()
            .map_err(|_| "a row number, since this recording has no times");
    };
    let expected = match format {
        TimeFormat::Utc => "a time, as 2026-01-31T12:00:00.5Z",
        TimeFormat::Local => "a time without a zone, as those of the recording: 2026-01-31T12:00:00.5",
        _ => "seconds, as times of the recording are",
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
        let mut table = Table::open(std::io::Cursor::new(line), &said)?;
        let mut batch = fewbits_table::Batch::default();
        let found = table.time().map(|(_, scale)| scale);
        table.read(&mut batch, 1)?;
        Ok::<_, fewbits_table::Error>(batch.times.first().copied().zip(found))
    };
    let (found, own) = open().ok().flatten().ok_or(expected)?;
    // Times without a zone are read as UTC if the recording has that.
    if own != scale(format) && (own, format) != (Scale::Local, TimeFormat::Utc) {
        return Err(expected);
    }
    let (tick, is_exact) = found.ticks(decimals).ok_or("a time that fits the recording's ticks")?;
    Ok(tick.saturating_add(i64::from(!is_exact && end == End::From)))
}

/// A tick as text.
pub fn shown(tick: i64, time: TimeBase) -> String {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return tick.to_string();
    };
    let found = Time::from_ticks(tick, decimals);
    let decimals = if found.decimals() == 0 { 0 } else { decimals };
    found.shown(scale(format), decimals)
}

/// The time base of a table whose times are measured from `scale`. `first`: its first time, if there is one. `decimals`: those of its finest
/// time, if all were read. `nanoseconds`: how far times may be off.
///
/// Exact times have ticks as fine as the finest one, in thousandths if they are dates; others have the finest that 64 bits allow.
pub fn base(scale: Scale, first: Option<Time>, decimals: Option<u8>, nanoseconds: u64) -> TimeBase {
    let format = match scale {
        Scale::Utc => TimeFormat::Utc,
        Scale::Local => TimeFormat::Local,
        _ => TimeFormat::Seconds,
    };
    let fits = |decimals: &u8| {
        first.is_none_or(|first| {
            let tick = first.ticks(*decimals);
            tick.is_some_and(|(tick, _)| tick.abs() < i64::MAX / 4)
        })
    };
    let decimals = match (format, decimals) {
        (TimeFormat::Seconds, Some(decimals)) if nanoseconds == 0 => decimals.min(18),
        // Units that timestamps of other programs have.
        (_, Some(decimals)) if nanoseconds == 0 => decimals.next_multiple_of(3).min(18),
        // Ticks of 64 bits: the first time tells how fine they can be.
        _ => (0..=NANOSECONDS).rev().find(fits).unwrap_or(0),
    };
    let tick = 10_u64.pow(u32::from(NANOSECONDS.saturating_sub(decimals)));
    TimeBase::Clock {
        decimals,
        // One tick of the tolerance is reserved for decimals beyond a tick, which are cut off.
        tolerance: (nanoseconds / tick).saturating_sub(1),
        format,
    }
}

/// The name of a table's column of times beside columns of values of these names; `time` if several columns give it, it is also one of the
/// columns of values, or the table has no names.
pub fn name(table: &Table, values: &[String]) -> String {
    let name = match table.time() {
        Some(([only], _)) => {
            let made_up = format!("column_{}", only + 1);
            table.time_name().map(str::to_owned).filter(|name| *name != made_up)
        }
        _ => None,
    };
    name.filter(|name| !values.contains(name))
        .unwrap_or_else(|| "time".to_owned())
}

/// The tick of a time of a table; `None` if rows are numbered.
///
/// # Errors
/// If it does not fit, or has more decimals than an exact tick keeps.
pub fn of_row(time: Time, base: TimeBase) -> Result<Option<i64>, Problem> {
    let TimeBase::Clock {
        decimals, tolerance, ..
    } = base
    else {
        return Ok(None);
    };
    match time.ticks(decimals) {
        None => Err(TOO_LARGE),
        Some((_, false)) if tolerance == 0 => Err(TOO_FINE),
        Some((tick, _)) => Ok(Some(tick)),
    }
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
        let tick = |text: &str, time| tick(text, time, End::From);
        let seconds = clock(3, 0, TimeFormat::Seconds);
        for text in ["0", "12.5", "-0.125", "1518567890.001"] {
            assert_eq!(shown(tick(text, seconds).unwrap(), seconds), text);
        }
        assert_eq!(tick("1.5e2", seconds), Ok(150_000));
        assert!(tick("noon", seconds).is_err());
        let utc = clock(9, 0, TimeFormat::Utc);
        assert_eq!(shown(tick("2026-01-31T12:00:00.250Z", utc).unwrap(), utc), "2026-01-31T12:00:00.250000000Z");
        assert_eq!(tick("2014-04-10", utc), Ok(1_397_088_000_000_000_000));
        assert_eq!(tick("2014-04-10T02:00:00+02:00", utc), Ok(1_397_088_000_000_000_000));
        let local = clock(0, 0, TimeFormat::Local);
        assert_eq!(shown(tick("1952-01-01 00:00", local).unwrap(), local), "1952-01-01T00:00:00");
    }

    #[test]
    fn ends_between_two_ticks_lie_in_the_range() {
        let seconds = clock(0, 0, TimeFormat::Seconds);
        for (text, from, to) in [("1.5", 2, 1), ("-1.5", -1, -2), ("7", 7, 7)] {
            assert_eq!((tick(text, seconds, End::From), tick(text, seconds, End::To)), (Ok(from), Ok(to)));
        }
    }

    #[test]
    fn a_zone_is_no_end_of_times_without_one() {
        let local = clock(0, 0, TimeFormat::Local);
        for text in ["2024-03-05T11:00:05Z", "2024-03-05T11:00:05+02:00", "12"] {
            assert!(tick(text, local, End::From).unwrap_err().contains("without a zone"), "{text}");
        }
    }
}
