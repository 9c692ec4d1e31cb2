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
    /// Count of the prediction among the values.
    silent: u32,
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
            silent: replica.values.count(replica.lattice.canonical(slot.prediction)),
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
                let first = (p + low).rem_euclid(cells);
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
        let (replica, slot) = (self.replica, &self.slot);
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
        let residuals = replica.residuals[slot.pick].below(k);
        let seen = f64::from(replica.values.total() - self.silent + REPORTED);
        let values = (f64::from(self.values_below(k)) + f64::from(REPORTED) * bank) / seen;
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

    /// The symbol at a quantile: outwards from the prediction in doubling steps, then by bisection.
    pub(crate) fn find(&self, quantile: u32) -> (u32, Place) {
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
    pub(crate) fn residual_of(symbol: u32) -> Option<i64> {
        (symbol < ESCAPE).then(|| Self::residual(symbol))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{Config, Sensor};

    /// Frequencies rise, fill the total, and are found again, on a line, on circles of few and many points, and far out.
    #[test]
    fn every_symbol_is_found_where_it_lies() {
        let line = Config::new(0.01).unwrap();
        let circle = |delta: f64| Config::new(delta).unwrap().circular(360.0).unwrap();
        for config in [line, circle(0.001), circle(0.4), circle(100.0), circle(400.0)] {
            let mut sensor = Sensor::new(config);
            for n in 0..700 {
                let x = f64::from(n);
                sensor
                    .encode((x * 0.3).sin() * 7.0 + f64::from(n % 7) + 0.1 * x)
                    .unwrap();
                if n % 60 != 59 {
                    continue;
                }
                let (replica, slot) = sensor.ahead(1).unwrap();
                let law = replica.law(&slot);
                let mut end = 0;
                for symbol in 0..=ESCAPE {
                    let place = law.place(symbol);
                    assert!(place.left == end && place.width >= 1, "{symbol}");
                    end = place.left + place.width;
                    let near = (i64::from(symbol) - REACH).abs() < 40 || symbol % 97 == 0 || symbol == ESCAPE;
                    for quantile in [place.left, end - 1].into_iter().filter(|_| near) {
                        assert_eq!(law.find(quantile), (symbol, place));
                    }
                }
                assert_eq!(end, TOTAL);
            }
        }
    }
}
