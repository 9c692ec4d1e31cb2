//! Times as loggers write them, kept to the last digit.

use jiff::tz::Offset;
use serde::{Deserialize, Serialize};

/// Decimals of a second that are kept.
pub const DECIMALS: u8 = 18;
/// Attoseconds of a second.
pub(crate) const SECOND: i128 = 1_000_000_000_000_000_000;
/// Numbers above these are taken as parts of a second since 1970 (the smallest is of 1973): the number of decimals.
const EPOCHS: [(f64, Unit); 3] = [
    (1e17, Unit::Nanoseconds),
    (1e14, Unit::Microseconds),
    (1e11, Unit::Milliseconds),
];

/// A time: attoseconds since 1970 in UTC, since 1970 on a local clock, or since the zero of the logger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Time(pub(crate) i128);

/// What times are measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Scale {
    /// Plain seconds since some zero.
    Seconds,
    /// Coordinated universal time since 1970.
    Utc,
    /// A clock whose zone is not known, since 1970 on that clock.
    Local,
}

/// Unit of times that are numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// Seconds.
    Seconds,
    /// Thousandths.
    Milliseconds,
    /// Millionths.
    Microseconds,
    /// Billionths.
    Nanoseconds,
}

impl Unit {
    /// Decimals of a second of one unit.
    pub fn decimals(self) -> u8 {
        match self {
            Self::Seconds => 0,
            Self::Milliseconds => 3,
            Self::Microseconds => 6,
            Self::Nanoseconds => 9,
        }
    }

    /// The unit of numbers of this size, if they are times since 1970.
    pub(crate) fn of_epoch(number: f64) -> Option<Self> {
        EPOCHS
            .iter()
            .find(|(above, _)| number.abs() >= *above)
            .map(|(_, unit)| *unit)
    }
}

impl Time {
    /// A time of so many ticks of `10^-decimals` seconds; `decimals` above 18 count as 18.
    pub fn from_ticks(ticks: i64, decimals: u8) -> Self {
        Self(i128::from(ticks) * 10_i128.pow(u32::from(DECIMALS - decimals.min(DECIMALS))))
    }

    /// Ticks of `10^-decimals` seconds, rounded down, and whether that is exact; `None` if they exceed 64 bits.
    pub fn ticks(self, decimals: u8) -> Option<(i64, bool)> {
        let tick = 10_i128.pow(u32::from(DECIMALS - decimals.min(DECIMALS)));
        let ticks = i64::try_from(self.0.div_euclid(tick)).ok()?;
        Some((ticks, self.0.rem_euclid(tick) == 0))
    }

    /// Decimals of a second that the time needs.
    pub fn decimals(self) -> u8 {
        decimals_of(self.fraction())
    }

    /// Attoseconds behind the whole second.
    pub(crate) fn fraction(self) -> u64 {
        // Less than a second fits 64 bits, where divisions are fast.
        self.0.rem_euclid(SECOND) as u64
    }

    /// Seconds, rounded to a double.
    pub fn seconds(self) -> f64 {
        as_seconds(self.0)
    }

    /// Seconds from an earlier time to this, rounded once.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        as_seconds(self.0 - earlier.0)
    }

    pub(crate) fn checked(whole: i64, attoseconds: i128) -> Self {
        Self(i128::from(whole) * SECOND + attoseconds)
    }

    /// The time as text with this many decimals: seconds, or a date as `2026-01-31T12:00:00.5`, with `Z` if it is UTC. A time beyond the
    /// years -9999 to 9999 is written as seconds.
    pub fn shown(self, scale: Scale, decimals: u8) -> String {
        let (whole, rest) = (self.0.div_euclid(SECOND), self.0.rem_euclid(SECOND));
        let decimals = usize::from(decimals.min(DECIMALS));
        let date = i64::try_from(whole).ok().and_then(datetime);
        if let (Scale::Utc | Scale::Local, Some(date)) = (scale, date) {
            let zone = if scale == Scale::Utc { "Z" } else { "" };
            let fraction = &format!("{rest:018}")[..decimals];
            let point = if decimals == 0 { "" } else { "." };
            return format!("{}{point}{fraction}{zone}", date.strftime("%Y-%m-%dT%H:%M:%S"));
        }
        let size = self.0.unsigned_abs();
        let (whole, rest) = (size / SECOND as u128, size % SECOND as u128);
        let sign = if self.0 < 0 { "-" } else { "" };
        let all = format!("{rest:018}");
        let fraction = all[..decimals].trim_end_matches('0');
        let point = if fraction.is_empty() { "" } else { "." };
        format!("{sign}{whole}{point}{fraction}")
    }
}

/// The date of so many seconds since 1970, if it is in the years -9999 to 9999.
fn datetime(seconds: i64) -> Option<jiff::civil::DateTime> {
    const TWO_DAYS: i64 = 2 * 86_400;
    let of = |seconds: i64| jiff::Timestamp::from_second(seconds).map(|stamp| Offset::UTC.to_datetime(stamp));
    // The last day at either end has no time stamp.
    let shift = if seconds > 0 { TWO_DAYS } else { -TWO_DAYS };
    let shifted = || {
        of(seconds.checked_sub(shift)?)
            .ok()?
            .checked_add(jiff::SignedDuration::from_secs(shift))
            .ok()
    };
    of(seconds).ok().or_else(shifted)
}

/// Decimals of a second that attoseconds below one second need.
pub(crate) fn decimals_of(mut fraction: u64) -> u8 {
    if fraction == 0 {
        return 0;
    }
    let mut decimals = DECIMALS;
    for (power, places) in [(1_000_000_000, 9), (1000, 3), (1000, 3), (10, 1), (10, 1)] {
        if fraction.is_multiple_of(power) {
            fraction /= power;
            decimals -= places;
        }
    }
    decimals
}

/// Attoseconds as seconds: whole seconds are exact.
fn as_seconds(attoseconds: i128) -> f64 {
    const UNIT: u64 = 1_000_000_000_000_000_000;
    // By size, so that a small negative time loses no digits to a whole second below it.
    let size = attoseconds.unsigned_abs();
    let seconds = match u64::try_from(size) {
        Ok(few) => (few / UNIT) as f64 + (few % UNIT) as f64 / UNIT as f64,
        Err(_) => (size / u128::from(UNIT)) as f64 + (size % u128::from(UNIT)) as f64 / UNIT as f64,
    };
    if attoseconds < 0 { -seconds } else { seconds }
}
