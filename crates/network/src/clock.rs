//! Slots: the time grid that all nodes share.

use crate::units::{Instant, Seconds};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{positive, within};
use fewbits_protocol::Schedule;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU64;

/// The slots that all nodes share. Slot `k` begins at `k` periods after time 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clock {
    period: u64,
    deadline: u64,
}

impl Clock {
    /// Slots of the given length. The deadline for reports is nine tenths of it after the slot's beginning.
    ///
    /// # Errors
    /// If the period is below a microsecond or above 10^6 s.
    pub fn new(period: Seconds) -> Result<Self, ArgumentError> {
        within("period", positive("period", period.value())?, 1e-6, 1e6)?;
        let period = Instant::default().after(period).0;
        Ok(Self {
            period,
            deadline: period / 10 * 9,
        })
    }

    /// Length of a slot.
    pub fn period(&self) -> Seconds {
        Instant(self.period).since_start()
    }

    /// Time from the beginning of a slot to its deadline.
    pub(crate) fn reporting_time(&self) -> Seconds {
        Instant(self.deadline).since_start()
    }

    /// Beginning of a slot.
    pub fn start(&self, slot: u32) -> Instant {
        Instant(self.period.saturating_mul(u64::from(slot)))
    }

    /// Deadline of a slot: reports that arrive later are not used.
    pub fn deadline(&self, slot: u32) -> Instant {
        Instant(self.start(slot).0.saturating_add(self.deadline))
    }

    /// The end of a slot, before the next begins.
    pub fn end(&self, slot: u32) -> Instant {
        Instant(self.start(slot.saturating_add(1)).0.saturating_sub(1))
    }

    /// The slots in the form that the state machines of `fewbits-protocol` use.
    pub(crate) fn schedule(&self) -> Schedule {
        // A period is a microsecond or more, so it is never zero.
        Schedule::new(NonZeroU64::new(self.period).unwrap_or(NonZeroU64::MIN))
    }

    /// Number of the slot that contains an instant.
    pub fn slot(&self, now: Instant) -> u32 {
        u32::try_from(now.0 / self.period).unwrap_or(u32::MAX)
    }
}
