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

use super::counts::REPORTED;
use super::replica::{Replica, Slot};

/// Bits of a frequency.
pub const PRECISION: u32 = 24;
const TOTAL: u32 = 1 << PRECISION;
/// Residuals of this size and below have frequencies of their own.
pub const REACH: i64 = 4096;
/// Number of the escape.
pub const ESCAPE: u32 = 2 * REACH as u32;
/// Least frequency of the escape: 16 bits.
const ESCAPE_SHARE: u32 = 256;
/// Least frequency of a residual.
const EACH: u32 = 2;

/// Frequencies of the symbols of one slot.
#[derive(Debug, Clone, Copy)]
pub struct Law<'a> {
    replica: &'a Replica,
    slot: &'a Slot,
    /// The bank's probability of an index other than the prediction, below it and above it.
    lower: f64,
    upper: f64,
    /// Count of the prediction among the values.
    silent: u32,
}

/// A symbol's place among the frequencies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Units below it.
    pub left: u32,
    /// Units of its own.
    pub width: u32,
}

impl Place {
    /// The shortest word, of at least one bit, that lies within the place once zeros follow it: value and length. It is less than
    /// one bit longer than the information, for its end is known from the frame.
    pub fn last_word(&self) -> (u32, u32) {
        self.shortest(|value, unit, end| value * unit < end)
    }

    /// The shortest word whose every continuation lies within the place: more follows.
    pub fn word(&self) -> (u32, u32) {
        self.shortest(|value, unit, end| (value + 1) * unit <= end)
    }

    fn shortest(&self, fits: impl Fn(u32, u32, u32) -> bool) -> (u32, u32) {
        let end = self.left + self.width;
        for bits in 1..PRECISION {
            // Division by `unit`, upwards.
            let (unit, shift) = (TOTAL >> bits, PRECISION - bits);
            let value = (self.left + unit - 1) >> shift;
            if fits(value, unit, end) {
                return (value, bits);
            }
        }
        (self.left, PRECISION)
    }
}

impl<'a> Law<'a> {
    pub(super) fn new(replica: &'a Replica, slot: &'a Slot) -> Self {
        let p = slot.prediction as f64;
        Self {
            replica,
            slot,
            lower: replica.bank.below(&slot.ahead, p - 0.5),
            upper: replica.bank.above(&slot.ahead, p + 0.5),
            silent: replica.values.count(replica.lattice.canonical(slot.prediction)),
        }
    }

    /// The bank's probability of a report.
    pub fn bank_outside(&self) -> f64 {
        self.lower + self.upper
    }

    /// The residual of a symbol; of the escape, one beyond the last.
    fn residual(symbol: u32) -> i64 {
        let k = i64::from(symbol) - REACH;
        if k < 0 { k } else { k + 1 }
    }

    /// The symbol of a residual.
    pub fn symbol(k: i64) -> u32 {
        match k {
            0 => ESCAPE,
            k if k.abs() > REACH => ESCAPE,
            k if k < 0 => (k + REACH) as u32,
            k => (k + REACH - 1) as u32,
        }
    }

    /// Counts of the values whose residual is in `-REACH..k` and not 0.
    fn values_below(&self, k: i64) -> u32 {
        let (values, p) = (&self.replica.values, self.slot.prediction);
        let (low, high, count) = match self.replica.lattice.cells() {
            None => (-REACH, k, values.between(p - REACH, p + k)),
            Some(cells) => {
                // Residuals around the circle are the shortest way.
                let (low, high) = ((cells / 2 + 1 - cells).max(-REACH), k.min(cells / 2 + 1));
                if high <= low {
                    return 0;
                }
                let first = self.replica.lattice.canonical(p + low);
                let end = first + high - low;
                let around = if end > cells { values.between(0, end - cells) } else { 0 };
                (low, high, values.between(first, end.min(cells)) + around)
            }
        };
        if low <= 0 && high > 0 {
            count - self.silent
        } else {
            count
        }
    }

    /// Total frequency below `symbol`.
    fn cumulative(&self, symbol: u32) -> u32 {
        if symbol == 0 {
            return 0;
        }
        if symbol > ESCAPE {
            return TOTAL;
        }
        let (replica, slot) = (self.replica, self.slot);
        let k = Self::residual(symbol);
        let (edge, outside) = ((slot.prediction + k) as f64 - 0.5, self.bank_outside());
        let bank = if symbol == ESCAPE {
            1.0
        } else if k < 0 {
            replica.bank.below(&slot.ahead, edge) / outside
        } else if k == 1 {
            1.0 - self.upper / outside
        } else {
            1.0 - replica.bank.above(&slot.ahead, edge) / outside
        };
        let residuals = replica.residuals(slot).below(k);
        let seen = f64::from(replica.values.total() - self.silent + REPORTED);
        let values = (f64::from(self.values_below(k)) + f64::from(REPORTED) * bank) / seen;
        let [a, b, c] = replica.coders;
        let share = (a * bank + b * residuals + c * values).clamp(0.0, 1.0);
        EACH * symbol + (f64::from(TOTAL - EACH * ESCAPE - ESCAPE_SHARE) * share) as u32
    }

    /// Where a symbol lies.
    pub fn place(&self, symbol: u32) -> Place {
        let left = self.cumulative(symbol);
        Place {
            left,
            width: self.cumulative(symbol + 1).saturating_sub(left).max(1),
        }
    }

    /// The symbol at a quantile: outwards from the prediction in doubling steps, then by bisection.
    pub fn find(&self, quantile: u32) -> (u32, Place) {
        let middle = REACH as u32;
        let (mut low, mut high) = ((0, 0), (ESCAPE + 1, TOTAL));
        let start = self.cumulative(middle);
        let upwards = start <= quantile;
        *(if upwards { &mut low } else { &mut high }) = (middle, start);
        let mut step = 1;
        while high.0 - low.0 > 1 {
            let probe = if step < high.0 - low.0 {
                if upwards { low.0 + step } else { high.0 - step }
            } else {
                low.0 + (high.0 - low.0) / 2
            };
            let left = self.cumulative(probe);
            let below = left <= quantile;
            *(if below { &mut low } else { &mut high }) = (probe, left);
            step = if below == upwards {
                step.saturating_mul(2)
            } else {
                u32::MAX
            };
        }
        let width = high.1.saturating_sub(low.1).max(1);
        (low.0, Place { left: low.1, width })
    }

    /// The residual of a symbol, if it has one.
    pub fn residual_of(symbol: u32) -> Option<i64> {
        (symbol < ESCAPE).then(|| Self::residual(symbol))
    }
}
