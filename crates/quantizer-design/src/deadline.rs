//! Time limits of computations.

use std::time::{Duration, Instant};

/// Multiplications per second that a computation may assume: a third of the speed of a slow processor.
const SPEED: f64 = 3e8;

/// The instant by which a computation must end; `None` without a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadline(Option<Instant>);

impl Deadline {
    /// No deadline.
    pub const NEVER: Self = Self(None);

    /// The instant `limit` after `start`. Never, if there is no limit or the sum overflows.
    pub(crate) fn after(start: Instant, limit: Option<Duration>) -> Self {
        Self(limit.and_then(|limit| start.checked_add(limit)))
    }

    pub(crate) fn is_over(self) -> bool {
        self.0.is_some_and(|end| Instant::now() >= end)
    }

    /// Whether this many multiplications may take longer than the remaining time.
    pub(crate) fn is_short_for(self, work: f64) -> bool {
        self.0
            .is_some_and(|end| work > SPEED * end.saturating_duration_since(Instant::now()).as_secs_f64())
    }
}
