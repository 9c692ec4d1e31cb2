//! The state that sensor and receiver share and update identically: lattice, bank, predictors and frequencies.

use super::Config;
use super::bank::{Ahead, Bank, LONGEST_GAP};
use super::counts::{REPORTED, Residuals, Values};
use super::lattice::Lattice;
use super::law::Law;
use crate::elementary::{greater, lesser, round};

/// Number of predictors of the next index: the bank's mean, the last index, the line through the last two.
pub(super) const PREDICTORS: usize = 3;
/// Share of the predictors' weight that is distributed evenly after each slot.
const PREDICTOR_SWITCHING: f32 = 0.01;
/// Smallest factor of a predictor's weight in one slot, `2^-40`.
const LEAST_FACTOR: f32 = 1.0 / (1_u64 << 40) as f32;
/// Number of coders: the bank, the residuals' frequencies, the values' frequencies.
pub(super) const CODERS: usize = 3;
const FIRST_CODERS: [f32; CODERS] = [0.4, 0.4, 0.2];
/// Share of the coders' weight that is distributed evenly after each report.
const CODER_SWITCHING: f32 = 0.02;
/// Indices of a circular signal that exceed this size are reduced by whole turns.
const TURN: i64 = 1 << 38;

/// Largest size of a prediction: far beyond any index, and far below the limits of an `i64`.
const FARTHEST: i64 = 1 << 42;
/// Largest size of the step from the last index to the bank's mean: `f32` still represents halves there and rounds to even.
const FARTHEST_STEP: f32 = 4e6;

/// The state that sensor and receiver share.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(try_from = "super::stored::StoredReplica", into = "super::stored::StoredReplica")
)]
pub struct Replica {
    pub(super) lattice: Lattice,
    pub(super) bank: Bank,
    pub(super) last: i64,
    pub(super) before: i64,
    /// Slots between the last two indices.
    pub(super) gap: u32,
    pub(super) predictors: [f32; PREDICTORS],
    pub(super) residuals: [Residuals; PREDICTORS],
    pub(super) values: Values,
    pub(super) coders: [f32; CODERS],
}

/// Predictions for the next slot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slot {
    pub(super) ahead: Ahead,
    candidates: [i64; PREDICTORS],
    /// Number of the predictor with the largest weight.
    pub(super) pick: usize,
    pub(super) prediction: i64,
}

impl Replica {
    /// All zeros: memory before the first sample. [`restart`](Self::restart) makes it a replica.
    pub(crate) const UNSET: Self = Self {
        lattice: Lattice::UNSET,
        bank: Bank::UNSET,
        last: 0,
        before: 0,
        gap: 0,
        predictors: [0.0; PREDICTORS],
        residuals: [Residuals::NONE; PREDICTORS],
        values: Values::NONE,
        coders: [0.0; CODERS],
    };

    /// A replica at index 0 of a lattice. The model `believed`, if there is one, has half of the weight.
    pub fn new(lattice: Lattice, believed: Option<usize>) -> Self {
        let mut replica = Self::UNSET;
        replica.restart(lattice, believed);
        replica
    }

    /// As [`new`](Self::new), in the same memory.
    pub fn restart(&mut self, lattice: Lattice, believed: Option<usize>) {
        self.move_to(lattice);
        self.bank.restart(believed);
        self.predictors = [1.0; PREDICTORS];
        self.residuals.iter_mut().for_each(Residuals::clear);
        self.coders = FIRST_CODERS;
    }

    /// The bank of models.
    pub fn bank(&self) -> &Bank {
        &self.bank
    }

    /// Replaces the bank by an earlier copy, which undoes [`predict`](Self::predict).
    pub fn restore_bank(&mut self, saved: Bank) {
        self.bank = saved;
    }

    /// The reconstruction of the last slot.
    pub fn value(&self) -> f64 {
        self.lattice.value(self.last)
    }

    /// Predicts `elapsed` slots ahead.
    pub fn predict(&mut self, elapsed: u32) -> Slot {
        let ahead = self.bank.predict(elapsed);
        let step = round(greater(lesser(ahead.mean, FARTHEST_STEP), -FARTHEST_STEP)) as i32;
        let rounded = (self.last + i64::from(step)).clamp(-FARTHEST, FARTHEST);
        // The gap is at least one.
        let (slots, gap) = (i64::from(ahead.slots), i64::from(self.gap.max(1)));
        let rise = self.lattice.shortest(self.last - self.before) * slots + gap / 2;
        let step = rise.checked_div_euclid(gap).unwrap_or(0);
        let line = (self.last + step).clamp(-FARTHEST, FARTHEST);
        let candidates = [rounded, self.last, line];
        let mut picked = (0, rounded, self.predictors[0]);
        for (i, (weight, candidate)) in self.predictors.iter().zip(candidates).enumerate().skip(1) {
            if *weight >= picked.2 {
                picked = (i, candidate, *weight);
            }
        }
        Slot {
            ahead,
            candidates,
            pick: picked.0,
            prediction: picked.1,
        }
    }

    /// The probability law of the residual of a report in this slot.
    pub fn law<'a>(&'a self, slot: &'a Slot) -> Law<'a> {
        Law::new(self, slot)
    }

    /// Frequencies of the residuals from the predictor of this slot.
    pub(super) fn residuals(&self, slot: &Slot) -> &Residuals {
        let [first, ..] = &self.residuals;
        self.residuals.get(slot.pick).unwrap_or(first)
    }

    /// Updates with a silent slot.
    pub fn silent(&mut self, slot: &Slot) {
        self.update(slot, slot.prediction, 1.0);
    }

    /// Updates with the index of this slot. `outside` is the bank's probability of a report.
    pub(super) fn update(&mut self, slot: &Slot, j: i64, outside: f32) {
        let reported = j != slot.prediction;
        let name = self.lattice.canonical(j);
        let cell = self.bank.update(&slot.ahead, (j - self.last) as f32);
        if reported {
            let from_bank = greater(lesser(cell / outside, 1.0), 1e-12);
            let silent = self.values.count(self.lattice.canonical(slot.prediction));
            let seen = (self.values.total() - silent + REPORTED) as f32;
            let from_values = (self.values.count(name) as f32 + REPORTED as f32 * from_bank) / seen;
            let from_residuals = self.residuals(slot).probability(j - slot.prediction);
            let found = [from_bank, from_residuals, from_values];
            spread(&mut self.coders, found, CODER_SWITCHING);
        }
        // A predictor that was right keeps its weight; another one's is multiplied by the probability of its error.
        let mut factors = [1.0; PREDICTORS];
        let predictors = slot.candidates.iter().zip(&mut self.residuals);
        for (factor, (candidate, residuals)) in factors.iter_mut().zip(predictors) {
            let k = self.lattice.shortest(j - candidate);
            if k != 0 {
                *factor = greater(residuals.probability(k), LEAST_FACTOR);
                residuals.add(k);
            }
        }
        spread(&mut self.predictors, factors, PREDICTOR_SWITCHING);
        self.values.add(name, if reported { REPORTED } else { 1 });
        (self.before, self.last, self.gap) = (self.last, j, slot.ahead.slots);
        if let (Some(cells), true) = (self.lattice.cells(), j.abs() > TURN) {
            // Subtract whole turns before the index becomes large.
            let turns = j - j.checked_rem_euclid(cells).unwrap_or(0);
            self.last -= turns;
            self.before -= turns;
        }
    }

    /// Starts a new lattice at a sample that no point of the old one represents. The frequencies of residuals are kept.
    pub(super) fn move_to(&mut self, lattice: Lattice) {
        self.lattice = lattice;
        let best = self.bank.best();
        self.bank.restart(Some(best));
        self.values.clear();
        (self.last, self.before, self.gap) = (0, 0, 1);
    }

    /// Whether stored numbers can be those of a replica of this configuration.
    pub fn is_valid(&self, config: &Config) -> bool {
        let weights = self.predictors.iter().chain(&self.coders);
        let indices = [self.last, self.before].iter().all(|j| j.abs() <= 2 * FARTHEST);
        self.lattice.is_valid(config)
            && (1..=LONGEST_GAP).contains(&self.gap)
            && self.bank.is_valid()
            && indices
            && weights.into_iter().all(|w| *w > 0.0 && *w <= 1.0)
    }
}

/// Bayes' rule, then a share that is distributed evenly, so that no weight becomes zero.
fn spread<const N: usize>(weights: &mut [f32; N], factors: [f32; N], share: f32) {
    let mut total = 0.0;
    for (weight, factor) in weights.iter_mut().zip(factors) {
        *weight *= factor;
        total += *weight;
    }
    for weight in weights.iter_mut() {
        *weight = *weight / total * (1.0 - share) + share / N as f32;
    }
}
