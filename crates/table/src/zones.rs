//! What a written time says of its zone.

use crate::calendar::digits;
use jiff::tz::TimeZone;

/// What a written time says of its zone.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Zone {
    Nothing,
    /// Seconds ahead of UTC.
    Offset(i64),
    /// An abbreviation, as `CET`, which several zones may have.
    Name(String),
    /// A region, as `Europe/Berlin`.
    Region(TimeZone),
    Unknown,
}

/// The zone that the text behind a time of day names.
pub(crate) fn zone_of(rest: &str) -> Zone {
    let rest = rest.trim();
    // A region behind an offset says no more than the offset.
    let rest = match rest.split_once('[') {
        Some((before, region)) if region.ends_with(']') => before.trim(),
        _ => rest,
    };
    // Nor does a name, as in `+0100 CET` and `GMT+0100 (Central European Standard Time)`.
    let rest = match rest.split_once(' ') {
        Some((before, name)) if before.contains(['+', '-']) && offset(before).is_some() && is_zone_name(name) => before,
        _ => rest,
    };
    if rest.is_empty() {
        return Zone::Nothing;
    }
    match offset(rest) {
        Some(seconds) => Zone::Offset(seconds),
        None if (2..=5).contains(&rest.len()) && rest.bytes().all(|c| c.is_ascii_alphabetic()) => {
            Zone::Name(rest.to_ascii_uppercase())
        }
        None if rest.contains('/') => TimeZone::get(rest).map_or(Zone::Unknown, Zone::Region),
        None => Zone::Unknown,
    }
}

/// Whether a text may name a zone: letters, or any words in brackets.
fn is_zone_name(name: &str) -> bool {
    let is_word = (2..=5).contains(&name.len()) && name.bytes().all(|c| c.is_ascii_alphabetic());
    is_word || (name.starts_with('(') && name.ends_with(')'))
}

/// An offset from UTC in seconds.
pub(crate) fn offset(text: &str) -> Option<i64> {
    let text = text.trim();
    if matches!(text.to_ascii_uppercase().as_str(), "Z" | "UTC" | "GMT" | "UT") {
        return Some(0);
    }
    let text = text.strip_prefix("UTC").or(text.strip_prefix("GMT")).unwrap_or(text);
    let (sign, rest) = match text.chars().next()? {
        '+' => (1, &text[1..]),
        '-' => (-1, &text[1..]),
        '\u{2212}' => (-1, &text[3..]),
        _ => return None,
    };
    let (hours, _, rest) = digits(rest, 2)?;
    let minutes = match rest.strip_prefix(':').unwrap_or(rest) {
        "" => 0,
        rest => {
            digits(rest, 2)
                .filter(|(_, count, rest)| *count == 2 && rest.is_empty())?
                .0
        }
    };
    (hours <= 18 && minutes < 60).then_some(sign * (hours * 3600 + minutes * 60))
}
