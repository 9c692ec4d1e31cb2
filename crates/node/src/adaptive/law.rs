//! The probability law of a report, as integer frequencies that both ends compute identically.
//!
//! The symbols are the residuals `k` in `-4096..=4096` except 0, in increasing order, and an escape. They share `2^24` units: each residual
//! has at least four, the escape 256. The rest is distributed by a mixture of three coders (the bank's predictive law, the frequencies of
//! residuals, the frequencies of values), weighted by the probabilities that they gave to past reports:
//!
//! ```text
//! P(k) = a P_bank(k | k != 0) + b (n_k + 2^-|k| / 4) / (n + 1/2) + c (m_j + 10 P_bank(k | k != 0)) / (m - m_p + 10)
//! ```
//!
//! Compared with the best of the three, the mixture costs at most `log2(1 / weight)` bits in total, and a little at each change of the
//! best.
//!
//! Cumulative frequencies must increase. The tails of the bank's models are `f32`, but they are added and mixed as integers. Only the
//! rounding of the exponentials (`3e-7` of a term, which is at most a quarter of its model's weight) can make them decrease, by at most
//! three units. The four units of each residual exceed that.

use super::counts::REPORTED;
use super::replica::{Replica, Slot};

/// Bits of a frequency.
pub const PRECISION: u32 = 24;
const TOTAL: u32 = 1 << PRECISION;
/// Largest size of a residual that has its own frequency.
pub const REACH: i64 = 4096;
/// Symbol of the escape.
pub const ESCAPE: u32 = 2 * REACH as u32;
/// Smallest frequency of the escape (16 bits).
const ESCAPE_SHARE: u32 = 256;
/// Smallest frequency of a residual.
const EACH: u32 = 4;
/// Sum of the coders' weights.
const WEIGHTS: u32 = 1 << 16;

/// Frequencies of the symbols of one slot.
#[derive(Debug, Clone, Copy)]
pub struct Law<'a> {
    replica: &'a Replica,
    slot: &'a Slot,
    /// The bank's probability of an index other than the prediction.
    outside: f32,
    /// Factor of the models' tails before they are added as integers: a power of two.
    scale: f32,
    /// Factor that converts such a sum to a frequency: the probability of a report corresponds to `2^24`.
    inverse: f32,
    /// The bank's shares below (`lower`) and above (`upper`) the prediction, as frequencies.
    lower: u32,
    upper: u32,
    /// Count of the prediction among the values.
    silent: u32,
}

/// Interval of a symbol in the cumulative frequencies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Total frequency of the symbols below it.
    pub left: u32,
    /// Its own frequency.
    pub width: u32,
}

impl Place {
    /// The shortest word of at least one bit that lies within the interval if zeros follow it: value and length. It is less than
    /// one bit longer than the information, because the receiver knows its end from the frame.
    pub fn last_word(&self) -> (u32, u32) {
        self.shortest(|value, unit, end| value * unit < end)
    }

    /// The shortest word that lies within the interval whatever follows: for a packet that continues.
    pub fn word(&self) -> (u32, u32) {
        self.shortest(|value, unit, end| (value + 1) * unit <= end)
    }

    fn shortest(&self, fits: impl Fn(u32, u32, u32) -> bool) -> (u32, u32) {
        let end = self.left + self.width;
        for bits in 1..PRECISION {
            // Division by `unit`, rounded up.
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
    // A function of its own on small processors, so that its stack memory is released.
    #[cfg_attr(not(feature = "std"), inline(never))]
    pub(super) fn new(replica: &'a Replica, slot: &'a Slot) -> Self {
        let at = (slot.prediction - replica.last) as f32;
        let [lower, upper] = replica.bank.outside(&slot.ahead, at);
        let outside = lower + upper;
        // Scaled to 2^28 up to 2^29, the sums stay below 2^30. The exponent is above that of 2^-61, where tails are constant.
        let scale = f32::from_bits((282 - (outside.to_bits() >> 23)).clamp(1, 254) << 23);
        let share = |tail: f32| (tail / outside * TOTAL as f32) as u32;
        let lower = share(lower).min(TOTAL);
        Self {
            replica,
            slot,
            outside,
            scale,
            inverse: TOTAL as f32 / (outside * scale),
            lower,
            upper: share(upper).min(TOTAL - lower),
            silent: replica.values.count(replica.lattice.canonical(slot.prediction)),
        }
    }

    /// The bank's probability of a report.
    pub fn bank_outside(&self) -> f32 {
        self.outside
    }

    /// The bank's probability below an edge (above it, if `side` is -1), divided by that of a report, as a frequency of at most `most`.
    fn share(&self, edge: f32, side: f32, most: u32) -> u32 {
        let counted = self.replica.bank.counted(&self.slot.ahead, edge, side, self.scale);
        ((counted as f32 * self.inverse) as u32).min(most)
    }

    /// The residual of a symbol; for the escape, one more than the last.
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

    /// Sum of the counts of the values whose residual is in `-REACH..k` and not 0.
    fn values_below(&self, k: i64) -> u32 {
        let (values, p) = (&self.replica.values, self.slot.prediction);
        let (low, high, count) = match self.replica.lattice.cells() {
            None => (-REACH, k, values.between(p - REACH, p + k)),
            Some(cells) => {
                // On a circle residuals are the shorter way.
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
        let edge = (slot.prediction - replica.last + k) as f32 - 0.5;
        let bank = if symbol == ESCAPE {
            TOTAL
        } else if k < 0 {
            self.share(edge, 1.0, self.lower)
        } else if k == 1 {
            TOTAL - self.upper
        } else {
            TOTAL - self.share(edge, -1.0, self.upper)
        };
        let frequency = |share: f32| ((share * TOTAL as f32) as u32).min(TOTAL);
        let residuals = frequency(replica.residuals(slot).below(k));
        let seen = (replica.values.total() - self.silent + REPORTED) as f32;
        let from_bank = bank as f32 * (REPORTED as f32 / TOTAL as f32);
        let values = frequency((self.values_below(k) as f32 + from_bank) / seen);
        let [a, b, _] = replica.coders.map(|weight| (weight * WEIGHTS as f32) as u32);
        let a = a.min(WEIGHTS);
        let b = b.min(WEIGHTS - a);
        // Mixture of the three coders in integers: sensor and receiver must agree to the last bit.
        let mixed = [(a, bank), (b, residuals), (WEIGHTS - a - b, values)];
        let share: u64 = mixed
            .iter()
            .map(|(weight, share)| u64::from(*weight) * u64::from(*share))
            .sum();
        let free = u64::from(TOTAL - EACH * ESCAPE - ESCAPE_SHARE);
        EACH * symbol + ((free * (share >> 16)) >> PRECISION) as u32
    }

    /// The interval of a symbol.
    pub fn place(&self, symbol: u32) -> Place {
        let left = self.cumulative(symbol);
        Place {
            left,
            width: self.cumulative(symbol + 1).saturating_sub(left).max(1),
        }
    }

    /// The symbol whose interval contains `quantile`, and the interval.
    pub fn find(&self, quantile: u32) -> (u32, Place) {
        let middle = REACH as u32;
        let (mut low, mut high) = ((0, 0), (ESCAPE + 1, TOTAL));
        let start = self.cumulative(middle);
        let upwards = start <= quantile;
        *(if upwards { &mut low } else { &mut high }) = (middle, start);
        // Most symbols are near the middle: double the step until the quantile is passed, then bisect.
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

    /// The residual of a symbol; `None` for the escape.
    pub fn residual_of(symbol: u32) -> Option<i64> {
        (symbol < ESCAPE).then(|| Self::residual(symbol))
    }
}
