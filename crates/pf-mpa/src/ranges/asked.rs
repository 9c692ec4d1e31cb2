//! What a tracker of ranges is asked beside its estimates.

use super::RangeTracker;
use super::bank::Hypothesis;
use super::odds::shares_of;
use crate::Error;

/// An anchor's own bias is told if it is so many deviations from zero.
const APPARENT: f64 = 3.0;

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
        let shares = shares_of(&self.hypotheses);
        let sum: f64 = self
            .hypotheses
            .iter()
            .zip(&shares)
            .map(|(one, share)| share * one.good[number])
            .sum();
        Ok(if self.hypotheses.is_empty() { 1.0 } else { sum })
    }

    /// The bias that an anchor has alone, beside the common one, if it is more probable than not that it has one, and its estimate is more than
    /// three deviations from zero: the anchor stands elsewhere than said, or its ranges take another way. They are used less this bias.
    ///
    /// # Errors
    /// If there is no such anchor.
    pub fn own_bias(&self, anchor: &str) -> Result<Option<f64>, Error> {
        let number = self.number(anchor)?;
        let (mut probability, mut bias, mut square) = (0.0, 0.0, 0.0);
        for (one, share) in self.hypotheses.iter().zip(shares_of(&self.hypotheses)) {
            if one.apart == Some(number) {
                let ([own], [[variance]]) = one.marginal(&[2 * self.known.axes + 2]);
                probability += share;
                bias += share * own;
                square += share * (variance + own * own);
            }
        }
        let (bias, square) = (bias / probability, square / probability);
        Ok((probability > 0.5 && bias * bias > APPARENT * APPARENT * (square - bias * bias)).then_some(bias))
    }

    /// The same tracker, to which biases of anchors are constant: trackers that are compared on the same ranges explain them by what they suppose.
    pub(super) fn rigid(mut self) -> Self {
        self.has_walks = false;
        self
    }

    /// How the biases of single anchors walk, if it is more probable than not that they do: their standard deviation beside the common bias, and
    /// the seconds after which one is forgotten. Then errors last from range to range, as those of drifting clocks or behind people, or the table of
    /// anchors is wrong. The bands allow for it.
    pub fn walking_biases(&self) -> Option<(f64, f64)> {
        let mut found = None;
        let mut probability = 0.0;
        let mut most = 0.0;
        for (one, share) in self.hypotheses.iter().zip(shares_of(&self.hypotheses)) {
            let Some(walk) = one.walk else { continue };
            probability += share;
            if share > most {
                (most, found) = (share, Some((walk.deviation, walk.seconds)));
            }
        }
        found.filter(|_| probability > 0.5)
    }

    /// The mean product of successive residuals of an anchor, each in its predicted deviation, if it is far above the zero of a right geometry:
    /// the anchor does not stand where it is said to, or ranges have errors that last, and the bands are too narrow. Far is .25, and
    /// six standard deviations of the mean of independent ones. `None` otherwise, and for fewer than 40 ranges in full since places were found.
    ///
    /// # Errors
    /// If there is no such anchor.
    pub fn lasting_residuals(&self, anchor: &str) -> Result<Option<f64>, Error> {
        Ok(self.residuals[self.number(anchor)?].lasting())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranges::{RangeSettings, Travel};
    use nalgebra::Vector3;

    /// A density of `n` lengths is `1000^-n` of its value when lengths are stated in a unit of a thousandth. Defect: ranges of three anchors, which
    /// leave a curve of places, had no evidence, so that a wrong height under which anchors contradict each other seemed to explain them best.
    #[test]
    fn the_evidence_of_ranges_is_a_density() {
        let places = [[0.0, 0.0], [12.0, 1.0], [4.0, 9.0], [13.0, 11.0], [-2.0, 6.0]];
        for anchors in [3, 5] {
            let gained = |unit: f64| {
                let anchor = |i: usize| unit * Vector3::new(places[i][0], places[i][1], 0.0);
                let named = (0..anchors).map(|i| (i.to_string(), anchor(i)));
                let mut tracker = RangeTracker::new(named, Travel::Full, RangeSettings::default())
                    .unwrap()
                    .rigid();
                let mut first = None;
                for k in 0..90 {
                    let time = 0.2 * k as f64;
                    let truth =
                        unit * Vector3::new(6.0 + 3.0 * (0.3 * time).sin(), 4.0 + 2.0 * (0.2 * time).cos(), 0.0);
                    let error = unit * 0.05 * (1.7 * k as f64).sin();
                    let range = (truth - anchor(k % anchors)).norm() + error;
                    tracker.push(time, &(k % anchors).to_string(), range).unwrap();
                    first = first.or(tracker.log_evidence().map(|evidence| (k, evidence)));
                }
                let (from, evidence) = first.unwrap();
                ((89 - from) as f64, tracker.log_evidence().unwrap() - evidence)
            };
            let ((ranges, metres), (_, millimetres)) = (gained(1.0), gained(1000.0));
            let expected = -ranges * 1000.0_f64.ln();
            let error = millimetres - metres - expected;
            assert!(error.abs() < 1e-2, "{anchors} anchors: {metres} and {millimetres}, {expected} apart");
        }
    }
}
