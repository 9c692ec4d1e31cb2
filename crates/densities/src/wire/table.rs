//! Integer frequency tables: the same on every machine.

use super::range::{PRECISION, TOTAL};
use constriction::stream::model::{DecoderModel, EncoderModel, EntropyModel};
use std::borrow::Borrow;
use std::num::NonZeroU32;

/// Frequency of the escape: about 11 bits.
const ESCAPE: u32 = 32;
/// A logistic table ends this many scales from its centre; what lies beyond is escaped.
const REACH: f64 = 10.0;
/// Share of the wide density in the mixture, and how much wider it is.
const WIDE_SHARE: f64 = 0.01;
const WIDE: f64 = 8.0;

/// Cumulative frequencies of the symbols `0..count`, out of 2^16, every symbol at least 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Table {
    /// `count` symbols, as equal as integers allow; `count` from 2 to 2^12.
    Uniform { count: u32 },
    /// Integers `centre - half ..= centre + half` under a logistic law of the given location and scale mixed with one 8 times
    /// as wide, then the escape.
    Logistic {
        centre: i64,
        half: u32,
        location: f64,
        scale: f64,
    },
}

impl Table {
    /// A logistic table; `scale` at most 64.
    pub(super) fn logistic(location: f64, scale: f64) -> Self {
        Self::Logistic {
            centre: libm::round(location) as i64,
            half: libm::ceil(REACH * scale) as u32 + 4,
            location,
            scale,
        }
    }

    fn count(&self) -> u32 {
        match *self {
            Self::Uniform { count } => count,
            Self::Logistic { half, .. } => 2 * half + 2,
        }
    }

    /// Total frequency of the symbols below `index`.
    fn cumulative(&self, index: u32) -> u32 {
        match *self {
            Self::Uniform { count } => index * TOTAL / count,
            Self::Logistic {
                centre,
                half,
                location,
                scale,
            } => {
                let symbols = 2 * half + 1;
                if index == 0 {
                    0
                } else if index >= symbols {
                    if index == symbols { TOTAL - ESCAPE } else { TOTAL }
                } else {
                    let edge = (centre - i64::from(half) + i64::from(index)) as f64 - 0.5;
                    let z = (edge - location) / scale;
                    let share = (1.0 - WIDE_SHARE) * logistic(z) + WIDE_SHARE * logistic(z / WIDE);
                    // One for every symbol, the rest by the law.
                    index + (f64::from(TOTAL - ESCAPE - symbols) * share) as u32
                }
            }
        }
    }

    /// The escape's index, if there is one.
    pub(super) fn escape(&self) -> Option<u32> {
        match *self {
            Self::Uniform { .. } => None,
            Self::Logistic { half, .. } => Some(2 * half + 1),
        }
    }
}

/// `1/(1 + e^-z)` from a software exponential and IEEE arithmetic alone, so that every machine gets the same bits.
fn logistic(z: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-z))
}

impl EntropyModel<PRECISION> for Table {
    type Symbol = u32;
    type Probability = u32;
}

impl EncoderModel<PRECISION> for Table {
    fn left_cumulative_and_probability(&self, symbol: impl Borrow<u32>) -> Option<(u32, NonZeroU32)> {
        let index = *symbol.borrow();
        if index >= self.count() {
            return None;
        }
        let left = self.cumulative(index);
        NonZeroU32::new(self.cumulative(index + 1).saturating_sub(left)).map(|p| (left, p))
    }
}

impl DecoderModel<PRECISION> for Table {
    fn quantile_function(&self, quantile: u32) -> (u32, u32, NonZeroU32) {
        // The last index whose cumulative frequency does not exceed the quantile.
        let (mut low, mut high) = (0, self.count());
        let (mut left, mut right) = (0, TOTAL);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            let cumulative = self.cumulative(middle);
            if cumulative <= quantile {
                (low, left) = (middle, cumulative);
            } else {
                (high, right) = (middle, cumulative);
            }
        }
        (low, left, NonZeroU32::new(right - left).unwrap_or(NonZeroU32::MIN))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn frequencies_are_positive_and_complete_and_quantiles_find_their_symbol() {
        let logistic = [(0.0, 0.01), (0.3, 0.5), (-7.6, 2.2), (1e6, 11.0), (0.5, 64.0)];
        let tables = logistic.map(|(l, s)| Table::logistic(l, s)).into_iter();
        for table in tables.chain([2, 3, 64, 1000, 4096].map(|count| Table::Uniform { count })) {
            let mut total = 0;
            for index in 0..table.count() {
                let (left, p) = table.left_cumulative_and_probability(index).unwrap();
                assert_eq!(left, total);
                total += p.get();
                for quantile in [left, total - 1] {
                    assert_eq!(table.quantile_function(quantile), (index, left, p), "{table:?}");
                }
            }
            assert_eq!(total, TOTAL);
        }
    }
}
