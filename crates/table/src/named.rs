//! Names of columns of times.

use crate::interval;
use crate::names::is_one_of;

/// Names of a column that is taken as time, if no column has dates. The short ones stand last: beside another, they may be anything.
pub(crate) const NAMES: &str = "time|timestamp|datetime|date|ts|_time|epoch|date_time|date time|%time|zeitstempel|zeit|datum|utc|x_value|\
    created_at|last_changed|mess_datum|yyyymmdd|tmstamp|time stamp|fecha|zeitpunkt|when|seconds|second|sec|t|t_s|\
    t(s)|t (s)|t[s]|t [s]|t/s";
/// Names of a column of times of day beside one of dates.
pub(crate) const OF_DAY: &str = "time|zeit|uhrzeit|heure|hora|ora|tijd|gps_time|hhmm|hhmmss|hrmn|hrmin|hour_minute";

/// Whether a name, in small letters, is one of the time, perhaps with a unit behind it.
pub(crate) fn is_exact_name(name: &str, known: &str) -> bool {
    name == known || interval::of_name(name).is_some_and(|(_, rest)| rest == known)
}

pub(crate) fn is_time_name(name: &str) -> bool {
    let lower = name.to_lowercase();
    NAMES.split('|').any(|known| is_exact_name(&lower, known))
        || "timestamp|time_|time |date time|datetime|date-time|time(|time[|zeit |zeit(|zeit["
            .split('|')
            .any(|begin| lower.starts_with(begin))
        || "_time| time|_timestamp|_date"
            .split('|')
            .any(|end| lower.ends_with(end))
}

/// Whether a word of a name says that an interval begins, as `START TIME` beside `END TIME`.
pub(crate) fn starts_an_interval(name: &str) -> bool {
    const WORDS: &str = "start|begin|beginning|from|beginn|von|anfang|inicio";
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphanumeric());
    words.any(|word| is_one_of(WORDS, word))
}
