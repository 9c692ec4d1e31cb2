//! The law of a report: integer frequencies that both ends compute alike.
//!
//! Residuals `k` in `-4096..=4096` but 0, in increasing order, and an escape share `2^24` units: each has two, the escape 256,
//! the rest is theirs by a mixture of three coders (the bank's predictive law, the frequencies of residuals, the frequencies of
//! values), weighted by what they predicted:
//!
//! ```text
//! P(k) = a P_bank(k | k != 0) + b (n_k + 2^-|k| / 4) / (n + 1/2) + c (m_j + 10 P_bank(k | k != 0)) / (m - m_p + 10)
//! ```
//!
//! The mixture loses at most `log2(1 / weight)` bits in all against the best of the three, and a little at each change of the
//! best. Two units each are more than the rounding of the cumulative sums, so every residual keeps a frequency above zero.

use crate::counts::REPORTED;
use crate::replica::{Replica, Slot};

/// Bits of a frequency.
pub(crate) const PRECISION: u32 = 24;
const TOTAL: u32 = 1 << PRECISION;
/// Residuals of this size and below have frequencies of their own.
pub(crate) const REACH: i64 = 4096;
/// Number of the escape.
pub(crate) const ESCAPE: u32 = 2 * REACH as u32;
/// Least frequency of the escape: 16 bits.
const ESCAPE_SHARE: u32 = 256;
/// Least frequency of a residual.
const EACH: u32 = 2;

/// Frequencies of the symbols of one slot.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Law<'a> {
    replica: &'a Replica,
    slot: Slot,
    /// The bank's probability of an index other than the prediction, below it and above it.
    lower: f64,
    upper: f64,
}

/// A symbol's place among the frequencies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) left: u32,
    pub(crate) width: u32,
}

impl Place {
    /// `-log2` of the probability.
    pub(crate) fn information(&self) -> f64 {
        f64::from(PRECISION) - f64::from(self.width).log2()
    }

    /// The shortest word, of at least one bit, that lies within the place once zeros follow it: value and length. It is less than
    /// one bit longer than the information, for its end is known from the frame.
    pub(crate) fn last_word(&self) -> (u32, u32) {
        self.shortest(|value, unit, end| value * unit < end)
    }

    /// The shortest word whose every continuation lies within the place: more follows.
    pub(crate) fn word(&self) -> (u32, u32) {
        self.shortest(|value, unit, end| (value + 1) * unit <= end)
    }

    fn shortest(&self, fits: impl Fn(u32, u32, u32) -> bool) -> (u32, u32) {
        let end = self.left + self.width;
        (1..=PRECISION)
            .map(|bits| (self.left.div_ceil(TOTAL >> bits), bits))
            .find(|(value, bits)| fits(*value, TOTAL >> bits, end))
            .unwrap_or((self.left, PRECISION))
    }
}

impl<'a> Law<'a> {
    pub(crate) fn new(replica: &'a Replica, slot: Slot) -> Self {
        let p = slot.prediction as f64;
        Self {
            replica,
            slot,
            lower: replica.bank.below(&slot.ahead, p - 0.5),
            upper: replica.bank.above(&slot.ahead, p + 0.5),
        }
    }

    /// The bank's probability of a report.
    pub(crate) fn bank_outside(&self) -> f64 {
        self.lower + self.upper
    }

    /// The residual of a symbol; of the escape, one beyond the last.
    fn residual(symbol: u32) -> i64 {
        let k = i64::from(symbol) - REACH;
        if k < 0 { k } else { k + 1 }
    }

    /// The symbol of a residual.
    pub(crate) fn symbol(k: i64) -> u32 {
        match k {
            0 => ESCAPE,
            k if k.abs() > REACH => ESCAPE,
            k if k < 0 => (k + REACH) as u32,
            k => (k + REACH - 1) as u32,
        }
    }

    /// An index around the circle relative to the prediction.
    fn relative(&self, j: i64) -> i64 {
        let k = j - self.slot.prediction;
        self.replica.lattice.cells().map_or(k, |cells| {
            let k = k.rem_euclid(cells);
            if 2 * k > cells { k - cells } else { k }
        })
    }

    /// Total frequency below `symbol`.
    fn cumulative(&self, symbol: u32) -> u32 {
        if symbol == 0 {
            return 0;
        }
        if symbol > ESCAPE {
            return TOTAL;
        }
        let (replica, slot) = (self.replica, &self.slot);
        let k = Self::residual(symbol);
        let (edge, outside) = ((slot.prediction + k) as f64 - 0.5, self.bank_outside());
        let bank = if symbol == ESCAPE {
            1.0
        } else if k < 0 {
            replica.bank.below(&slot.ahead, edge) / outside
        } else {
            1.0 - replica.bank.above(&slot.ahead, edge) / outside
        };
        let residuals = replica.residuals[slot.pick].below(k);
        let chosen = |j| {
            let r = self.relative(j);
            (-REACH..k).contains(&r) && r != 0
        };
        let silent = replica.values.count(replica.lattice.canonical(slot.prediction));
        let seen = f64::from(replica.values.total() - silent + REPORTED);
        let values = (f64::from(replica.values.sum(chosen)) + f64::from(REPORTED) * bank) / seen;
        let [a, b, c] = replica.coders;
        let share = (a * bank + b * residuals + c * values).clamp(0.0, 1.0);
        EACH * symbol + (f64::from(TOTAL - EACH * ESCAPE - ESCAPE_SHARE) * share) as u32
    }

    /// Where a symbol lies.
    pub(crate) fn place(&self, symbol: u32) -> Place {
        let left = self.cumulative(symbol);
        Place {
            left,
            width: self.cumulative(symbol + 1).saturating_sub(left).max(1),
        }
    }

    /// The symbol at a quantile.
    pub(crate) fn find(&self, quantile: u32) -> (u32, Place) {
        let (mut low, mut high) = (0, ESCAPE + 1);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if self.cumulative(middle) <= quantile {
                low = middle;
            } else {
                high = middle;
            }
        }
        (low, self.place(low))
    }

    /// The residual of a symbol, if it has one.
    pub(crate) fn residual_of(symbol: u32) -> Option<i64> {
        (symbol < ESCAPE).then(|| Self::residual(symbol))
    }
}
