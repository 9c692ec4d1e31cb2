//! Anchors whose ranges become late: the direct path is hidden for a while, as behind a person or a shelf.
//!
//! The first range of a little lateness may be one that the target has moved, and what is taken for that moves the place, so that good anchors
//! contradict it afterwards. So a range that is longer than expected also begins a hypothesis in which it says nothing, until the next ranges decide.

use super::bank::Hypothesis;
use super::settings::Known;
use super::spare::Spare;
use super::update::ANCHOR_CHANGES;

/// A range is suspect from so many deviations above the expected one.
const SUSPECT: f64 = 1.0;
/// Probability that an anchor becomes late in a range, and the mean of its lateness in spreads of the anchors, or in a logarithm.
const BEGINS: f64 = 0.01;
const LATENESS: f64 = 0.15;
/// Hypotheses of less than this share do not branch, nor if there are this many.
const PROBABLE: f64 = 0.02;
const MOST: usize = 24;

/// The hypotheses in which the range of an anchor is late. `expectations`: mean and variance of the range by each. `has_enough`: whether there are
/// anchors to spare.
pub(super) fn with_late(
    known: &Known,
    hypotheses: &[Hypothesis],
    expectations: &[(f64, f64)],
    shares: &[f64],
    (anchor, range): (usize, f64),
    has_enough: impl Fn(&Hypothesis) -> bool,
    spare: &mut Spare,
) -> Vec<Hypothesis> {
    let mut found = Vec::new();
    let mean = LATENESS * known.size;
    for ((one, (expected, variance)), share) in hypotheses.iter().zip(expectations).zip(shares) {
        let off = range - expected;
        let is_suspect = off > 0.0 && off * off > SUSPECT * SUSPECT * variance;
        let is_asked = *share > PROBABLE && hypotheses.len() + found.len() < MOST;
        if is_suspect && is_asked && one.good[anchor] > 0.5 && one.apart != Some(anchor) && has_enough(one) {
            let log_density = BEGINS.ln() - mean.ln() - off / mean;
            let mut late = spare.copy(one);
            late.good[anchor] = ANCHOR_CHANGES;
            late.weigh(log_density);
            found.push(late);
        }
    }
    found
}
