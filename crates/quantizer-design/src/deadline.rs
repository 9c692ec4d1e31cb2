//! When a computation must end.

use std::time::{Duration, Instant};

/// Multiplications per second that a computation may count on: a third of what a slow processor does.
const SPEED: f64 = 3e8;

/// The instant at which a computation must end, if there is one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Deadline(Option<Instant>);

impl Deadline {
    pub(crate) const NEVER: Self = Self(None);

    /// `limit` after `start`. Never, if there is no limit or the sum is beyond the clock's range.
    pub(crate) fn after(start: Instant, limit: Option<Duration>) -> Self {
        Self(limit.and_then(|limit| start.checked_add(limit)))
    }

    pub(crate) fn is_over(self) -> bool {
        self.0.is_some_and(|end| Instant::now() >= end)
    }

    /// Whether so many multiplications may take longer than what is left of the time.
    pub(crate) fn is_short_for(self, work: f64) -> bool {
        self.0
            .is_some_and(|end| work > SPEED * end.saturating_duration_since(Instant::now()).as_secs_f64())
    }
}
