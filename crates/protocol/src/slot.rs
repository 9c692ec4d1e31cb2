//! Slot numbers of 24 bits, and the schedule of their times.

use core::num::NonZeroU64;

/// Bits of a slot number in a frame.
pub const SLOT_BITS: u32 = 24;
const MASK: u32 = (1 << SLOT_BITS) - 1;

/// Number of a slot as it is sent: counted modulo `2^24`.
///
/// Slots are compared as serial numbers: `a` is after `b` if `a - b` modulo `2^24` is from 1 to `2^23 - 1`. At ten slots per second numbers
/// repeat after 19 days, and two ends may differ by up to 9 days before an old slot counts as new.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(from = "u64", into = "u64"))]
pub struct Slot(u32);

impl Slot {
    /// The number of the slot with this count: `count` modulo `2^24`.
    pub fn of_count(count: u64) -> Self {
        Self((count & u64::from(MASK)) as u32)
    }

    /// The number, below `2^24`.
    pub fn number(self) -> u32 {
        self.0
    }

    /// The slot before.
    #[must_use]
    pub fn before(self) -> Self {
        Self(self.0.wrapping_sub(1) & MASK)
    }

    /// The slot after.
    #[must_use]
    pub fn after(self) -> Self {
        Self(self.0.wrapping_add(1) & MASK)
    }

    /// Whether this slot is later than `other`.
    pub fn is_after(self, other: Self) -> bool {
        let ahead = self.0.wrapping_sub(other.0) & MASK;
        ahead != 0 && ahead < 1 << (SLOT_BITS - 1)
    }

    /// The count with this slot number that is nearest to `count`.
    pub fn nearest_count(self, count: u64) -> u64 {
        let ahead = u64::from(self.0.wrapping_sub(count as u32) & MASK);
        let behind = (1 << SLOT_BITS) - ahead;
        // At the ends of the range of counts there is a candidate on one side only.
        let (later, earlier) = (count.checked_add(ahead), count.checked_sub(behind));
        let nearer = if ahead < behind { later } else { earlier };
        nearer.or(earlier).or(later).unwrap_or(count)
    }
}

impl From<u64> for Slot {
    fn from(count: u64) -> Self {
        Self::of_count(count)
    }
}

impl From<Slot> for u64 {
    fn from(slot: Slot) -> Self {
        u64::from(slot.0)
    }
}

/// When slots begin, by the clock of one node: slot `k` at `origin + k period`. Times in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub struct Schedule {
    origin: i128,
    period: NonZeroU64,
}

impl Schedule {
    /// Slots of `period` nanoseconds from time 0 on.
    pub fn new(period: NonZeroU64) -> Self {
        Self { origin: 0, period }
    }

    /// Length of a slot in nanoseconds.
    pub(crate) fn period(&self) -> u64 {
        self.period.get()
    }

    /// Count of the slot that contains a time; 0 before the first.
    pub fn count(&self, now: u64) -> u64 {
        let count = (i128::from(now) - self.origin) / i128::from(self.period.get());
        u64::try_from(count.max(0)).unwrap_or(u64::MAX)
    }

    /// Time at which the slot of a count begins.
    pub fn start(&self, count: u64) -> u64 {
        let start = self
            .origin
            .saturating_add(i128::from(count).saturating_mul(i128::from(self.period.get())));
        u64::try_from(start.max(0)).unwrap_or(u64::MAX)
    }

    /// Sets the schedule so that slot `slot` begins at `now`.
    pub(crate) fn synchronise(&mut self, slot: Slot, now: u64) {
        let count = slot.nearest_count(self.count(now));
        self.origin = i128::from(now) - i128::from(count) * i128::from(self.period.get());
    }
}

#[cfg(test)]
mod tests {
    use super::{Schedule, Slot};
    use proptest::prelude::*;
    use std::num::NonZeroU64;

    proptest! {
        /// Defect: times at the end of their range overflowed.
        #[test]
        fn a_schedule_begins_the_slot_that_it_is_told(period in 1..=u64::MAX, now in prop_oneof![any::<u64>(), Just(u64::MAX)], slot in any::<u64>()) {
            let mut schedule = Schedule::new(NonZeroU64::new(period).unwrap());
            schedule.synchronise(Slot::of_count(slot), now);
            prop_assert_eq!(Slot::of_count(schedule.count(now)), Slot::of_count(slot));
            prop_assert_eq!(schedule.start(schedule.count(now)), now);
        }
    }
}
