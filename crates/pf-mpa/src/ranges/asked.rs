//! What a tracker of ranges is asked beside its estimates.

use super::RangeTracker;
use super::bank::Hypothesis;
use crate::Error;

impl RangeTracker {
    /// Total bits of all ranges so far.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// Number of times that the track was lost.
    pub fn losses(&self) -> usize {
        self.losses
    }

    /// `ln` of the probability density of the ranges since the place was found: trackers of other settings compare by it on the same ranges.
    /// Ranges of too few anchors for a place count as nothing. `None` during acquisition.
    pub(crate) fn log_evidence(&self) -> Option<f64> {
        let best = self.hypotheses.iter().map(Hypothesis::log_share).reduce(f64::max)?;
        let sum: f64 = self.hypotheses.iter().map(|one| (one.log_share() - best).exp()).sum();
        Some(self.evidence + best + sum.ln())
    }

    /// Number of estimated coordinates of the position: 2, or 3 with the height.
    pub fn coordinates(&self) -> usize {
        self.known.axes
    }

    /// Number of anchors whose ranges are needed at once before there is a place.
    pub fn needed(&self) -> usize {
        (self.known.axes + 2).min(self.places.len())
    }

    /// The probability that an anchor's ranges depend on its distance. One half or less: it contradicts the others. 1 before a place is found.
    ///
    /// # Errors
    /// If there is no such anchor.
    pub fn works(&self, anchor: &str) -> Result<f64, Error> {
        let number = self.number(anchor)?;
        let shares = self.shares();
        let sum: f64 = self
            .hypotheses
            .iter()
            .zip(&shares)
            .map(|(one, share)| share * one.good[number])
            .sum();
        Ok(if self.hypotheses.is_empty() { 1.0 } else { sum })
    }
}
