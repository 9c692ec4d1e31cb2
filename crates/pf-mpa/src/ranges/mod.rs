//! Tracking from single ranges at arbitrary times and from arbitrary anchors, as in recordings and from real radios.
//!
//! Real ranges have a bias, an error of scale and outliers, anchors fail, and speed, noise and first position are unknown. [`RangeTracker`]
//! estimates all of these:
//!
//! ```text
//! state        position and velocity in the plane or in space; bias and scale of all ranges; where they are probable, biases of single anchors
//! acquisition  the first range of each anchor is sent in full; all places that explain them become hypotheses, with and without one anchor
//! tracking     each range is sent as the level of its innovation, or in full; with probability `outliers` it is unrelated to the state
//! anchors      each has a probability that its ranges depend on the distance, since one that contradicts the others does so again
//! walks        where residuals last, hypotheses in which the biases of single anchors walk are added
//! speed, noise a bank of filters in each hypothesis, weighted by evidence; works with 1 bit too
//! odometry     a displacement moves all places; speed and its filters are then those of its error
//! output       the moments, and the bands, of all hypotheses together
//! lost         if most ranges of all hypotheses are outliers, or levels agree too long; or after `silence` seconds without a range
//! ```

mod acquisition;
mod again;
mod arrived;
mod asked;
mod band;
mod bank;
mod columns;
mod estimate;
mod fit;
mod gaussian;
mod grid;
mod growth;
mod heights;
mod late;
mod line;
mod measured;
mod members;
mod mirror;
mod mistakes;
mod moved;
mod odds;
mod own;
mod push;
mod residuals;
mod rest;
mod root;
mod rows;
mod search;
mod settings;
mod spare;
mod step;
mod update;
mod walk;
mod walking;

pub use estimate::RangeEstimate;
pub use growth::proportion_of;
pub use heights::height_of;
pub use mistakes::{Mistake, mistake_of};
pub use settings::{Height, RangeSettings};

use crate::Error;
use crate::loading::optimal_loading;
use crate::quantized::{QuantizedRange, RangeReference};
use arrived::Arrived;
use bank::Hypothesis;
use fewbits_core::Gaussian;
use fewbits_core::RangeNoise;
use fewbits_numerics::error::{finite, positive, refuse, within};
use fit::Calibration;
use late::with_late;
use measured::Measured;
use mirror::add_mirrored;
use nalgebra::Vector3;
use odds::{ASIDE, count_contradictions, drop_improbable, is_lost, merge_same, shares_of, uncertainty_of_noise, weigh};
use residuals::Residuals;
use rows::Latest;
use settings::{Known, NEEDLESS_OF_LEVELS, NEGLIGIBLE_OF_LEVELS};
use spare::Spare;
use std::collections::BTreeMap;
use step::Step;
use walking::with_walks;

/// Ranges between two searches for hypotheses that have become the same.
const COMPARED: usize = 8;
/// Bits of a range that is sent in full.
const FULL_BITS: usize = 32;

/// How a range is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Travel {
    /// As a number of 32 bits.
    Full,
    /// As the level of its innovation with this many bits, 1 to 8.
    Bits(u32),
}

/// A tracker of one target from the ranges of fixed anchors.
#[derive(Debug, Clone)]
pub struct RangeTracker {
    names: BTreeMap<String, usize>,
    places: Vec<[f64; 3]>,
    travel: Travel,
    /// Deviations from the expected range to the outermost edge between levels; 0 for ranges in full.
    loading: f64,
    known: Known,
    hypotheses: Vec<Hypothesis>,
    spare: Spare,
    /// The estimate of the hypotheses.
    latest: Option<RangeEstimate>,
    /// When each anchor last sent a range.
    heard: Vec<f64>,
    /// The latest range in full of each anchor.
    collected: BTreeMap<usize, Latest>,
    /// Ranges since acquisition began.
    tried: usize,
    calibration: Calibration,
    last: f64,
    /// The time that the hypotheses are about.
    at: f64,
    pushed: usize,
    bits: usize,
    losses: usize,
    /// `ln` of the evidence that was taken off the hypotheses' weights.
    evidence: f64,
    residuals: Vec<Residuals>,
    /// Whether biases of single anchors may walk.
    has_walks: bool,
}

impl RangeTracker {
    /// A tracker with anchors at known places, by name. Two coordinates: the third is zero.
    ///
    /// # Errors
    /// If there are fewer than three anchors, a place or a setting is not finite or out of range, levels have 0 or more than 8 bits, or ranges
    /// with an unknown clock travel as levels.
    pub fn new(
        anchors: impl IntoIterator<Item = (String, Vector3<f64>)>,
        travel: Travel,
        settings: RangeSettings,
    ) -> Result<Self, Error> {
        let anchors: BTreeMap<String, Vector3<f64>> = anchors.into_iter().collect();
        if anchors.len() < 3 {
            return refuse("anchors", format!("{} anchors", anchors.len()), "at least three, of different names");
        }
        if let Travel::Bits(bits) = travel {
            within("bits", f64::from(bits), 1.0, 8.0)?;
            if settings.unknown_clock {
                return refuse("travel", format!("{bits} bits"), "ranges in full, since their clock is unknown");
            }
        }
        let loading = match travel {
            Travel::Full => 0.0,
            Travel::Bits(bits) => optimal_loading(1 << bits)?,
        };
        let places: Vec<Vector3<f64>> = anchors.values().copied().collect();
        let mut known = settings.known(&places)?;
        if travel != Travel::Full {
            (known.negligible, known.needless) = (NEGLIGIBLE_OF_LEVELS, NEEDLESS_OF_LEVELS);
            known.anchor_biases.retain(|(own, _)| own.only().is_none());
        }
        Ok(Self {
            names: anchors
                .into_keys()
                .enumerate()
                .map(|(number, name)| (name, number))
                .collect(),
            places: places.iter().map(|place| [place.x, place.y, place.z]).collect(),
            travel,
            loading,
            hypotheses: Vec::new(),
            latest: None,
            spare: Spare::default(),
            heard: vec![f64::NEG_INFINITY; places.len()],
            collected: BTreeMap::new(),
            tried: 0,
            calibration: [(0.0, known.bias * known.bias), (0.0, known.scale * known.scale)],
            residuals: vec![Residuals::default(); places.len()],
            has_walks: travel == Travel::Full
                && settings.anchor_bias.is_none()
                && known.bias > 0.0
                && known.clock.is_none(),
            known,
            last: f64::NEG_INFINITY,
            at: f64::NEG_INFINITY,
            pushed: 0,
            bits: 0,
            losses: 0,
            evidence: 0.0,
        })
    }

    fn number(&self, anchor: &str) -> Result<usize, Error> {
        match self.names.get(anchor) {
            Some(number) => Ok(*number),
            None => refuse("anchor", anchor, format!("one of {:?}", self.names.keys().collect::<Vec<_>>())),
        }
    }

    /// Processes one range, whose noise is `share` times that of the bank.
    fn take(&mut self, time: f64, anchor: &str, range: f64, share: f64) -> Result<Option<RangeEstimate>, Error> {
        finite("range", range)?;
        finite("range in 32 bits", f64::from(range as f32))?;
        self.check_time(time)?;
        let anchor = self.number(anchor)?;
        let range = match self.known.measured {
            Measured::Distance => range,
            Measured::Logarithm { unit } => (positive("range", range)? / unit).ln(),
        };
        let (is_new, elapsed) = (time > self.last, time - self.last);
        let since = time - self.heard[anchor];
        if elapsed > self.known.silence {
            self.pause();
            self.collected.clear();
        }
        self.pushed += 1;
        self.heard[anchor] = time;
        if self.hypotheses.is_empty() {
            self.bits += FULL_BITS;
            self.search(time, is_new, anchor, Latest::new(time, f64::from(range as f32), share));
            self.last = time;
            self.latest = self.estimate(false);
            return Ok(self.latest.clone());
        }
        let mut next = std::mem::take(&mut self.hypotheses);
        let mut spare = std::mem::take(&mut self.spare);
        let tracked = self.track((&mut next, &mut spare), time - self.at, is_new, anchor, (range, share));
        self.spare = spare;
        let lost = match tracked {
            Ok((taken, residual, deviation)) => {
                self.evidence += taken;
                if self.travel == Travel::Full && (self.known.clock.is_none() || !is_new) {
                    self.residuals[anchor].observe(residual, deviation, since);
                }
                let variant = self.known.anchor_biases.len() + self.pushed;
                if self.has_walks && self.pushed.is_multiple_of(COMPARED) {
                    let mut walking = with_walks(&self.known, &mut next, &mut self.residuals, variant);
                    next.append(&mut walking);
                }
                is_lost(&next, self.travel != Travel::Full)
            }
            // The range has probability zero under every hypothesis, even as an outlier: none is left.
            Err(_) => {
                next.clear();
                true
            }
        };
        (self.last, self.at) = (time, time);
        self.bits += match self.travel {
            Travel::Full => FULL_BITS,
            Travel::Bits(bits) => bits as usize,
        };
        if self.travel == Travel::Full {
            if self.known.clock.is_some() && is_new {
                self.collected.clear();
            }
            self.collected
                .insert(anchor, Latest::new(time, f64::from(range as f32), share));
        }
        self.hypotheses = next;
        // Without a hypothesis the estimate is the one before.
        let before = self.latest.take().map(|latest| RangeEstimate { lost, ..latest });
        self.latest = self.estimate(lost).or(before);
        let estimate = self.latest.clone();
        if lost {
            self.losses += 1;
            self.forget();
        }
        Ok(estimate)
    }

    /// Moves hypotheses on and updates them with a range. Returns `ln` of the evidence that was taken off their weights, and the range's residual in
    /// its predicted deviation, and that.
    fn track(
        &self,
        (next, spare): (&mut Vec<Hypothesis>, &mut Spare),
        elapsed: f64,
        is_new: bool,
        anchor: usize,
        (range, of_noise): (f64, f64),
    ) -> Result<(f64, f64, f64), Error> {
        let (known, place) = (&self.known, &self.places[anchor]);
        let step = Step::over(elapsed, known.persistence, known.drift);
        let shares = shares_of(next);
        let (mut mean, mut square) = (0.0, 0.0);
        let mut expectations: Vec<(f64, f64)> = Vec::with_capacity(next.len());
        for (one, share) in next.iter_mut().zip(&shares) {
            one.predict(known, &step, *share);
            if let Some(clock) = known.clock.filter(|_| is_new) {
                one.forget_bias(known, clock, place, anchor, range);
            }
            let (expected, variance) = one.expect(known, place, anchor, of_noise);
            mean += share * expected;
            square += share * (variance + expected * expected);
            expectations.push((expected, variance));
        }
        let deviation = (square - mean * mean).max(f64::MIN_POSITIVE).sqrt();
        let residual = (range - mean) / deviation;
        let arrived = match self.travel {
            Travel::Full if known.clock.is_some() && is_new => Arrived::First(f64::from(range as f32)),
            Travel::Full => Arrived::Value(f64::from(range as f32)),
            Travel::Bits(bits) => {
                // All nodes that hear the reports compute the reference themselves, so it is not sent.
                let levels = 1_usize << bits;
                let variance = (square - mean * mean).max(f64::MIN_POSITIVE);
                let aside = if bits == 1 {
                    // Not the same side for an anchor each time.
                    let is_above = (self.pushed + self.pushed / self.places.len()).is_multiple_of(2);
                    let doubt: f64 = next
                        .iter()
                        .zip(&shares)
                        .map(|(one, share)| share * (1.0 - one.good[anchor]))
                        .sum();
                    let size = uncertainty_of_noise(&known.bank, next, &shares).max(ASIDE * doubt) * variance.sqrt();
                    if is_above { size } else { -size }
                } else {
                    0.0
                };
                let expected = Gaussian::scalar(mean + aside, variance)?;
                let reference = RangeReference::about(&expected, self.loading);
                let scheme = QuantizedRange::new(levels, RangeNoise::constant(known.noises[0])?)?;
                let level = scheme.level(range, &reference)?.0;
                Arrived::level(level, levels, &reference)?
            }
        };
        let mut failed = None;
        let (heard, last) = (&self.heard, self.heard[anchor]);
        // Fewer anchors than unknowns: position, common bias, error of scale.
        let is_short = |one: &Hypothesis| {
            known.scale > 0.0 && one.usable(|other| last - heard[other] <= known.silence) < known.axes + 2
        };
        let is_undecided = next.iter().all(is_short);
        let enough = |one: &Hypothesis| one.usable(|other| last - heard[other] <= known.silence) > known.axes + 1;
        let mut late = match arrived {
            Arrived::Value(value) => with_late(known, next, &expectations, &shares, (anchor, value), enough, spare),
            _ => Vec::new(),
        };
        let mut evidences: Vec<(bool, f64)> = Vec::with_capacity(next.len());
        spare.retain(next, |one| {
            let short = is_short(one);
            let holds_scale = one.rests(known, short) || (!one.is_cut && short);
            match one.update(known, anchor, &arrived, holds_scale) {
                Ok(log_evidence) if one.is_finite() => {
                    evidences.push((is_undecided || short && one.apart.is_some(), log_evidence));
                    true
                }
                Ok(_) => false,
                Err(error) => {
                    failed = Some(error);
                    false
                }
            }
        });
        let common = weigh(next, &evidences);
        next.append(&mut late);
        // Anchors that send ranges, but contradict each other so much that those that are left do not determine the position.
        count_contradictions(next, known.axes + 1, |other| last - heard[other] <= known.silence);
        // One anchor that is apart and others that contradict: an explanation that leaves too few anchors for a place is none beside others.
        let is_enough = |one: &Hypothesis| one.apart.is_none() || one.contradicted == 0;
        if next.iter().any(is_enough) {
            spare.retain(next, |one| is_enough(one));
        }
        if next.is_empty() {
            return Err(failed.unwrap_or(Error::Impossible));
        }
        let taken = common + drop_improbable(next, known.negligible, spare);
        if self.pushed.is_multiple_of(COMPARED) {
            merge_same(next, known.axes, spare);
            let is_carried = self.collected.values().any(|latest| latest.moved != [0.0; 3]);
            add_mirrored(known, next, is_carried);
        }
        Ok((taken, residual, deviation))
    }

    fn estimate(&self, lost: bool) -> Option<RangeEstimate> {
        estimate::of(&self.known, &self.hypotheses, lost)
    }
}
