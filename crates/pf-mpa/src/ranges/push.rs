//! Ranges in full, with and without a statement of their accuracy.

use super::{RangeEstimate, RangeTracker, Travel};
use crate::Error;
use fewbits_numerics::error::{positive, refuse};

impl RangeTracker {
    /// Processes one range at `time` (seconds, not before the last). `None` during acquisition.
    ///
    /// # Errors
    /// If there is no such anchor, a number is not finite, `time` is before the last range's, or a range whose error is in proportion to the
    /// distance is not positive.
    pub fn push(&mut self, time: f64, anchor: &str, range: f64) -> Result<Option<RangeEstimate>, Error> {
        self.take(time, anchor, range, 1.0)
    }

    /// The same of a range that states how accurate it is: the standard deviation of its error is `share` times that of a range without such a
    /// statement, which is [estimated](RangeEstimate::noise). So statements need to be right only in proportion to each other.
    ///
    /// # Errors
    /// As [`push`](Self::push), and if `share` is not positive, or ranges travel as levels.
    pub fn push_with_noise(
        &mut self,
        time: f64,
        anchor: &str,
        range: f64,
        share: f64,
    ) -> Result<Option<RangeEstimate>, Error> {
        positive("share", share)?;
        if let Travel::Bits(bits) = self.travel {
            return refuse("travel", format!("{bits} bits"), "ranges in full, since a level does not state its noise");
        }
        self.take(time, anchor, range, share)
    }
}
