//! Seconds since the first row, from times as they are written: fractions of a second, and times of day that pass midnight.

use crate::say::say;
use fewbits_record::TimeBase;

/// Times above these are not seconds since 1970 but fractions of a second: the number of them in one second.
const PARTS_OF_A_SECOND: [(f64, f64); 3] = [(1e17, 1e9), (1e14, 1e6), (4e9, 1e3)];

/// Ticks of rows as seconds.
pub(super) struct Seconds {
    /// Seconds of a tick.
    tick: f64,
    first: Option<i64>,
    is_numbered: bool,
    /// Ticks of a day; `None` if times have a date, or are durations.
    day: Option<i64>,
    last: i64,
    /// Midnights that have passed.
    midnights: i64,
}

impl Seconds {
    pub(super) fn new(base: TimeBase, is_of_day: bool) -> Self {
        let tick = match base {
            TimeBase::Clock { decimals, .. } => 1.0 / 10_f64.powi(i32::from(decimals)),
            _ => 1.0,
        };
        Self {
            tick,
            first: None,
            is_numbered: base == TimeBase::Numbered,
            day: is_of_day.then_some((86_400.0 / tick).round() as i64),
            last: 0,
            midnights: 0,
        }
    }

    /// The tick with the days that have passed, and its seconds since the first row.
    pub(super) fn of(&mut self, tick: i64, may_be_late: bool, row: u64, file: &str) -> (i64, f64) {
        if self.first.is_none() && !self.is_numbered {
            let first = tick as f64 * self.tick;
            if let Some((_, parts)) = PARTS_OF_A_SECOND.iter().find(|(above, _)| first.abs() > *above) {
                say!("{file}: times are taken as {parts:e} parts of a second");
                self.tick /= parts;
            }
        }
        let before = self.midnights;
        let tick = self.with_days(tick, may_be_late);
        if before == 0 && self.midnights == 1 {
            say!("{file}: row {row}: times of day without a date pass midnight: this row is taken for the next day");
        }
        self.first.get_or_insert(tick);
        (tick, self.since_first(tick))
    }

    /// The difference is taken in whole ticks: as nanoseconds since 1970, doubles are 256 apart.
    pub(super) fn since_first(&self, tick: i64) -> f64 {
        (i128::from(tick) - i128::from(self.first.unwrap_or(tick))) as f64 * self.tick
    }

    /// A time of day that is earlier by more than half a day is of the next day; one that is later by as much may be late, of the day before.
    fn with_days(&mut self, tick: i64, may_be_late: bool) -> i64 {
        let Some(day) = self.day else { return tick };
        let (days, ahead) = (self.midnights.saturating_mul(day), tick.saturating_sub(self.last));
        if !(0..=day).contains(&tick) {
            // Durations, as `25:10:00`.
            self.day = None;
            return tick.saturating_add(days);
        }
        if may_be_late && self.midnights > 0 && ahead > day / 2 {
            return tick + days - day;
        }
        self.last = tick;
        if ahead < -day / 2 {
            self.midnights += 1;
            return tick + days + day;
        }
        tick + days
    }
}

#[cfg(test)]
mod tests {
    use super::Seconds;
    use fewbits_record::TimeBase;

    fn found<const N: usize>(is_of_day: bool, may_be_late: bool, ticks: [i64; N]) -> [i64; N] {
        let mut seconds = Seconds::new(TimeBase::Numbered, is_of_day);
        ticks.map(|tick| seconds.of(tick, may_be_late, 1, "x").0)
    }

    #[test]
    fn days_pass_at_midnight_and_late_rows_stay_in_theirs() {
        let day = 86_400;
        assert_eq!(
            found(true, true, [86_000, 86_399, 1, 86_398, 5, 40_000, 30_000, 70_000, 86_399, 0]),
            [
                86_000,
                86_399,
                day + 1,
                86_398,
                day + 5,
                day + 40_000,
                day + 30_000,
                day + 70_000,
                day + 86_399,
                2 * day
            ]
        );
        // Where rows cannot be late, a long pause is one.
        assert_eq!(found(true, false, [86_399, 1, 86_398]), [86_399, day + 1, day + 86_398]);
    }

    #[test]
    fn dates_and_durations_stay() {
        assert_eq!(found(false, false, [86_399, 1]), [86_399, 1]);
        assert_eq!(found(true, false, [86_399, 90_000, 1]), [86_399, 90_000, 1]);
    }
}
