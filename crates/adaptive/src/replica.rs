//! What both ends hold and move alike: the lattice, the bank, the predictors and the frequencies.

use crate::Config;
use crate::bank::{Ahead, Bank, LONGEST_GAP};
use crate::counts::{REPORTED, Residuals, Values};
use crate::lattice::Lattice;
use crate::law::Law;
use serde::{Deserialize, Serialize};

/// Ways to predict the next index: the bank's mean, the last index, the line through the last two.
pub(crate) const PREDICTORS: usize = 3;
/// Share of the predictors' weights that is spread evenly after each slot.
const PREDICTOR_SWITCHING: f64 = 0.01;
/// The least factor of a predictor's weight in one slot, `2^-40`.
const LEAST_FACTOR: f64 = 1.0 / (1_u64 << 40) as f64;
/// Coders: the bank, the residuals' frequencies, the values' frequencies.
pub(crate) const CODERS: usize = 3;
const FIRST_CODERS: [f64; CODERS] = [0.4, 0.4, 0.2];
/// Share of the coders' weights that is spread evenly after each report.
const CODER_SWITCHING: f64 = 0.02;
/// Unwrapped indices of a circular signal are brought back beyond this size.
const TURN: i64 = 1 << 38;

/// Predictions are no larger: far beyond any index, and far from the ends of an `i64`.
const FARTHEST: i64 = 1 << 42;

/// The state that sensor and receiver share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Replica {
    pub(crate) lattice: Lattice,
    pub(crate) bank: Bank,
    last: i64,
    before: i64,
    /// Slots between them.
    gap: u32,
    #[serde(with = "fewbits_numerics::stored")]
    predictors: [f64; PREDICTORS],
    pub(crate) residuals: [Residuals; PREDICTORS],
    pub(crate) values: Values,
    #[serde(with = "fewbits_numerics::stored")]
    pub(crate) coders: [f64; CODERS],
}

/// One slot ahead of the last update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slot {
    pub(crate) ahead: Ahead,
    candidates: [i64; PREDICTORS],
    /// The predictor that is believed.
    pub(crate) pick: usize,
    /// Its prediction: silence means this index.
    pub(crate) prediction: i64,
}

impl Replica {
    pub(crate) fn new(lattice: Lattice, believed: Option<usize>) -> Self {
        Self {
            lattice,
            bank: Bank::new(believed),
            last: 0,
            before: 0,
            gap: 1,
            predictors: [1.0; PREDICTORS],
            residuals: std::array::from_fn(|_| Residuals::new()),
            values: Values::new(),
            coders: FIRST_CODERS,
        }
    }

    /// As if made anew, in the memory that it has.
    pub(crate) fn restart(&mut self, lattice: Lattice, believed: Option<usize>) {
        self.move_to(lattice);
        self.bank = Bank::new(believed);
        self.predictors = [1.0; PREDICTORS];
        self.residuals.iter_mut().for_each(Residuals::clear);
        self.coders = FIRST_CODERS;
    }

    /// The reconstruction of the last slot.
    pub(crate) fn value(&self) -> f64 {
        self.lattice.value(self.last)
    }

    /// The time update over `elapsed` slots.
    pub(crate) fn predict(&mut self, elapsed: u32) -> Slot {
        let ahead = self.bank.predict(elapsed);
        let rounded = ahead.mean.round().clamp(-(FARTHEST as f64), FARTHEST as f64) as i64;
        let (slots, gap) = (i64::from(ahead.slots), i64::from(self.gap));
        let step = (self.lattice.shortest(self.last - self.before) * slots + gap / 2).div_euclid(gap);
        let line = (self.last + step).clamp(-FARTHEST, FARTHEST);
        let candidates = [rounded, self.last, line];
        let pick = (1..PREDICTORS).fold(0, |best, i| {
            if self.predictors[i] >= self.predictors[best] {
                i
            } else {
                best
            }
        });
        Slot {
            ahead,
            candidates,
            pick,
            prediction: candidates[pick],
        }
    }

    /// The law of the residual of a report in this slot.
    pub(crate) fn law(&self, slot: &Slot) -> Law<'_> {
        Law::new(self, *slot)
    }

    /// Everything that follows from a silent slot.
    pub(crate) fn silent(&mut self, slot: &Slot) {
        self.update(slot, slot.prediction, 1.0);
    }

    /// Everything that follows from the index of this slot; `outside` is the bank's probability of a report.
    pub(crate) fn update(&mut self, slot: &Slot, j: i64, outside: f64) {
        let reported = j != slot.prediction;
        let name = self.lattice.canonical(j);
        if reported {
            let k = j - slot.prediction;
            let from_bank = (self.bank.update(&slot.ahead, j) / outside).clamp(1e-12, 1.0);
            let silent = self.values.count(self.lattice.canonical(slot.prediction));
            let seen = f64::from(self.values.total() - silent + REPORTED);
            let from_values = (f64::from(self.values.count(name)) + f64::from(REPORTED) * from_bank) / seen;
            let from_residuals = self.residuals[slot.pick].probability(k);
            let found = [from_bank, from_residuals, from_values];
            spread(&mut self.coders, found, CODER_SWITCHING);
        } else {
            self.bank.update(&slot.ahead, j);
        }
        let mut factors = [1.0; PREDICTORS];
        for (i, candidate) in slot.candidates.iter().enumerate() {
            let k = self.lattice.shortest(j - candidate);
            if k != 0 {
                factors[i] = self.residuals[i].probability(k).max(LEAST_FACTOR);
                self.residuals[i].add(k);
            }
        }
        spread(&mut self.predictors, factors, PREDICTOR_SWITCHING);
        self.values.add(name, if reported { REPORTED } else { 1 });
        (self.before, self.last, self.gap) = (self.last, j, slot.ahead.slots);
        if let (Some(cells), true) = (self.lattice.cells(), j.abs() > TURN) {
            let turns = j - j.rem_euclid(cells);
            self.bank.shift(turns);
            self.last -= turns;
            self.before -= turns;
        }
    }

    /// A sample that no lattice point represents becomes the origin of a new lattice. What was learned of residuals stays.
    pub(crate) fn move_to(&mut self, lattice: Lattice) {
        self.lattice = lattice;
        self.bank = Bank::new(Some(self.bank.best()));
        self.values.clear();
        (self.last, self.before, self.gap) = (0, 0, 1);
    }

    pub(crate) fn is_valid(&self, config: &Config) -> bool {
        let weights = self.predictors.iter().chain(&self.coders);
        let indices = [self.last, self.before].iter().all(|j| j.abs() <= 2 * FARTHEST);
        self.lattice.is_valid(config)
            && (1..=LONGEST_GAP).contains(&self.gap)
            && self.bank.is_valid()
            && indices
            && weights.into_iter().all(|w| *w > 0.0 && *w <= 1.0)
            && self.residuals.iter().all(Residuals::is_valid)
            && self.values.is_valid()
    }
}

/// Bayes' rule, then an even share for every expert, so that none is ever given up.
fn spread<const N: usize>(weights: &mut [f64; N], factors: [f64; N], share: f64) {
    let mut total = 0.0;
    for (weight, factor) in weights.iter_mut().zip(factors) {
        *weight *= factor;
        total += *weight;
    }
    for weight in weights.iter_mut() {
        *weight = *weight / total * (1.0 - share) + share / N as f64;
    }
}
