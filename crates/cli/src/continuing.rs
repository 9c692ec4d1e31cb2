//! Times of a table that continues a recording, or is compared with it: whether they mean the same, and follow.

use crate::clock;
use crate::error::Error;
use crate::input::Table;
use crate::say::say;
use fewbits_recipes::times;
use fewbits_record::TimeBase;
use fewbits_table::{Scale, Time};

/// The tolerance of a recording's times, as `--time` takes it.
pub(crate) fn own_tolerance(time: TimeBase) -> String {
    match time {
        TimeBase::Clock {
            tolerance: ticks @ 1..,
            decimals,
            ..
        } if decimals <= clock::NANOSECONDS => {
            // A tick was reserved for decimals beyond one.
            let tick = 10_u64.pow(u32::from(clock::NANOSECONDS - decimals));
            format!("±{}ns", ticks.saturating_add(1).saturating_mul(tick))
        }
        _ => "exact".to_owned(),
    }
}

/// Refuses times that are others than those of the recording. `begin`: its first tick. `mend`: what to do if no option helps.
pub(crate) fn check_clock(
    table: &mut Table,
    time: TimeBase,
    begin: Option<i64>,
    file: &str,
    mend: &str,
) -> Result<(), Error> {
    let (TimeBase::Clock { decimals, format, .. }, Some((scale, first))) = (time, table.first_time()?) else {
        return Ok(());
    };
    // Seconds since 1970, not those of a run or of a day.
    let is_dated = |time: Time| time.seconds() >= 1e8;
    let has_dates = begin.is_none_or(|tick| is_dated(Time::from_ticks(tick, decimals)));
    let problem = match (scale, times::scale(format)) {
        (own, known) if own == known => return Ok(()),
        (Scale::Seconds, Scale::Utc) if first.is_none_or(is_dated) => return Ok(()),
        (Scale::Utc, Scale::Seconds) if has_dates => return Ok(()),
        (Scale::Local, known) if known == Scale::Utc || has_dates => {
            "without a zone, and those of {} are UTC: say --time-zone UTC, or their zone"
        }
        (Scale::Local, _) => "dates, and those of {} are seconds: ",
        (Scale::Utc, _) => "UTC, and those of {} have no zone or date: ",
        _ => "seconds, and those of {} are dates: ",
    };
    let mend = if problem.ends_with(' ') { mend } else { "" };
    Err(Error::content(table.file(), format!("its times are {}{mend}", problem.replace("{}", file))))
}

/// Says that the table begins before the last time of a recording that it continues. `end`: its last tick.
pub(crate) fn tell_earlier(table: &mut Table, time: TimeBase, end: Option<i64>, file: &str) -> Result<(), Error> {
    if let (TimeBase::Clock { decimals, .. }, Some((scale, Some(first))), Some(end)) = (time, table.first_time()?, end)
        && let end = Time::from_ticks(end, decimals)
        && first < end
    {
        let shown = |time: Time| time.shown(scale, time.decimals());
        say!(
            "note: {}: its first time, {}, is before the last of {file}, {}: rows stay in the order in which they come, and the same rows \
             twice are twice there",
            table.file(),
            shown(first),
            shown(end)
        );
    }
    Ok(())
}
