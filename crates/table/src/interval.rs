//! Units of times in names of columns, as of `time_ms`, `Time [us]`, `elapsedMs` and `t/h`.

use crate::hint::without_unit;
use crate::names::is_one_of;
use crate::time::{Time, Unit};

/// Unit of times that are numbers, as `--time-format` says it.
const WORDS: [(&str, &str); 7] = [
    ("s", "s|sec|secs|second|seconds|sekunden|secondes|segundos"),
    ("ms", "ms|msec|msecs|millis|millisecond|milliseconds"),
    ("us", "us|µs|μs|usec|usecs|micros|microsecond|microseconds|microsec"),
    ("ns", "ns|nsec|nsecs|nanos|nanosecond|nanoseconds|nanosec|nanosecs"),
    ("min", "min|mins|minute|minutes|minuten|minutos"),
    ("h", "h|hr|hrs|hour|hours|stunden|heures|horas"),
    ("d", "days|tage|jours"),
];

/// Where the last word of a name begins, and where it ends.
fn last_word(name: &str) -> (usize, usize) {
    let end = name.trim_end_matches(|c: char| !c.is_alphanumeric()).len();
    let begin = name[..end]
        .rfind(|c: char| !c.is_alphanumeric())
        .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
    // `elapsedMs`: a capital behind a small letter begins a word.
    let word = &name[begin..end];
    let capital = word
        .char_indices()
        .zip(word.chars().skip(1).zip(word.char_indices().skip(1)))
        .filter(|((_, before), (next, _))| before.is_lowercase() && next.is_uppercase())
        .map(|(_, (_, (at, _)))| begin + at)
        .last();
    (capital.unwrap_or(begin), end)
}

/// The unit of a word, as `--time-format` says it.
pub(crate) fn unit(word: &str) -> Option<&'static str> {
    let found = WORDS.iter().find(|(_, words)| is_one_of(words, word));
    found.map(|(unit, _)| *unit)
}

/// The unit that the last word of a name states, as `--time-format` says it, and the name without it; also before the event that times count
/// from, as of `hours since start`.
pub(crate) fn of_name(name: &str) -> Option<(&'static str, &str)> {
    let before = || {
        let (unit, event) = name.split_once(" since ")?;
        event.starts_with(char::is_alphabetic).then(|| of_last_word(unit))?
    };
    of_last_word(name).or_else(before)
}

fn of_last_word(name: &str) -> Option<(&'static str, &str)> {
    let (begin, end) = last_word(name);
    let word = name[begin..end].to_lowercase();
    let in_brackets = name[..begin].ends_with(['(', '[']);
    let in_days = || (in_brackets && matches!(word.as_str(), "d" | "day")).then_some("d");
    let unit = unit(&word).or_else(in_days)?;
    let rest = name[..begin].trim_end_matches([' ', '_', '-', '.', ',', '(', '[', '/', ':']);
    // `in` of `time in ms` belongs to the unit.
    let rest = rest.strip_suffix(" in").or(rest.strip_suffix("_in")).unwrap_or(rest);
    Some((unit, rest))
}

/// The number and the unit of a time that is spelled with one, as `1.5 sec` and `3 min`.
pub(crate) fn spelled(cell: &str) -> Option<(&str, &'static str)> {
    let (number, word) = without_unit(cell)?;
    let (unit, _) = of_name(word).filter(|(_, rest)| rest.is_empty())?;
    number
        .parse::<f64>()
        .is_ok_and(f64::is_finite)
        .then_some((number, unit))
}

/// A time of hours, minutes and seconds by their letters, as `PT1M0.5S` and `1m30.5s`.
pub(crate) fn lettered(cell: &str) -> Option<Time> {
    let letters = cell.bytes().filter(u8::is_ascii_alphabetic).count();
    if !cell.starts_with('P') && letters != cell.bytes().filter(|c| b"hms".contains(c)).count() {
        return None;
    }
    let duration: jiff::SignedDuration = cell.parse().ok()?;
    Some(Time::checked(duration.as_secs(), i128::from(duration.subsec_nanos()) * 1_000_000_000))
}

/// Whether a name states a unit of time in brackets, or is the word for one that has no other meaning.
pub(crate) fn is_stated(name: &str) -> bool {
    let (begin, end) = last_word(name);
    let in_brackets = name[..begin].ends_with(['(', '[']);
    let is_word = || begin == 0 && (end >= 4 || matches!(&*name.to_lowercase(), "sec" | "ms" | "us" | "µs" | "ns"));
    of_name(name).is_some() && (in_brackets || is_word())
}

/// The seconds of a unit that is longer than a second.
pub(crate) fn seconds(unit: &str) -> Option<i64> {
    match unit {
        "min" => Some(60),
        "h" => Some(3600),
        "d" => Some(86_400),
        _ => None,
    }
}

/// A second or a part of one.
pub(crate) fn part(unit: &str) -> Option<Unit> {
    match unit {
        "s" => Some(Unit::Seconds),
        "ms" => Some(Unit::Milliseconds),
        "us" => Some(Unit::Microseconds),
        "ns" => Some(Unit::Nanoseconds),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_the_last_words_of_names() {
        for (name, unit, rest) in [
            ("time_ms", "ms", "time"),
            ("Time (ms)", "ms", "Time"),
            ("t_us", "us", "t"),
            ("Zeit [µs]", "us", "Zeit"),
            ("elapsedMs", "ms", "elapsed"),
            ("t/ns", "ns", "t"),
            ("time in h", "h", "time"),
            ("Time [d]", "d", "Time"),
            ("Time (day)", "d", "Time"),
            ("millis", "ms", ""),
            ("time_min", "min", "time"),
            ("t(s)", "s", "t"),
            ("hours since start", "h", ""),
            ("run minutes since last event", "min", "run"),
            ("Zeit in Stunden", "h", "Zeit"),
        ] {
            assert_eq!(of_name(name), Some((unit, rest)), "{name}");
        }
        for name in [
            "time",
            "timestamp",
            "items",
            "date",
            "x_d",
            "runs",
            "",
            "()",
            "day",
            "ts",
            "hours since 1970-01-01",
        ] {
            assert_eq!(of_name(name), None, "{name}");
        }
    }
}
