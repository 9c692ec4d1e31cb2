//! Integer frequency tables that are the same on every machine.

use constriction::stream::model::{DecoderModel, EncoderModel, EntropyModel};
use std::borrow::Borrow;
use std::cell::Cell;
use std::num::NonZeroU32;

/// Number of bits of a frequency.
pub(super) const PRECISION: usize = 16;
/// Sum of all frequencies of a table.
pub(super) const TOTAL: u32 = 1 << PRECISION;

/// Frequency of the escape symbol; it takes about 11 bits.
const ESCAPE: u32 = 32;
/// A logistic table ends at this many scales from its centre; values beyond use the escape symbol. At the largest scale, 64, the table
/// has about 1300 symbols, whose frequencies of at least one take 2 % of the total.
const REACH: f64 = 10.0;
/// Weight of the wide density in the mixture, and its scale relative to the narrow one.
const WIDE_SHARE: f64 = 0.01;
const WIDE: f64 = 8.0;

/// Cumulative frequencies of the symbols `0..count`, out of 2^16; every symbol has at least 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Table {
    /// `count` symbols with frequencies as equal as integers allow; `count` from 2 to 2^12.
    Uniform { count: u32 },
    /// Integers `centre - half ..= centre + half` with a logistic distribution of the given location and scale, mixed with one 8 times
    /// as wide, then the escape symbol.
    Logistic {
        centre: i64,
        half: u32,
        location: f64,
        scale: f64,
    },
}

impl Table {
    /// A logistic table; `scale` is at most 64.
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

    /// Total frequency of the symbols below `index`. Uses only a software exponential and IEEE arithmetic, so that every
    /// machine gets the same bits.
    fn cumulative(&self, index: u32) -> u32 {
        match *self {
            // At most 2^12 times 2^16: the product does not overflow.
            Self::Uniform { count } => index * TOTAL / count,
            Self::Logistic {
                centre,
                half,
                location,
                scale,
            } => {
                let symbols = 2 * half + 1;
                // The end symbols also take the mass beyond the table, and the escape symbol follows them.
                if index == 0 || index >= symbols {
                    return match index {
                        0 => 0,
                        _ if index == symbols => TOTAL - ESCAPE,
                        _ => TOTAL,
                    };
                }
                let edge = (centre - i64::from(half) + i64::from(index)) as f64 - 0.5;
                let z = (edge - location) / scale;
                // `e^-z` is the eighth power of the exponential that the wide density needs.
                let wide = libm::exp(-z / WIDE);
                let fourth = (wide * wide) * (wide * wide);
                let share = (1.0 - WIDE_SHARE) / (1.0 + fourth * fourth) + WIDE_SHARE / (1.0 + wide);
                // Frequency one for every symbol; the rest is distributed by the density.
                index + (f64::from(TOTAL - ESCAPE - symbols) * share) as u32
            }
        }
    }

    /// Index of the escape symbol; `None` if the table has none.
    pub(super) fn escape(&self) -> Option<u32> {
        match *self {
            Self::Uniform { .. } => None,
            Self::Logistic { half, .. } => Some(2 * half + 1),
        }
    }
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

impl Table {
    /// Approximate symbol of a quantile. Only the duration of the search depends on it.
    fn guess(&self, quantile: u32) -> u32 {
        match *self {
            Self::Uniform { count } => (quantile * count / TOTAL).min(count - 1),
            Self::Logistic {
                centre,
                half,
                location,
                scale,
            } => {
                let share = (f64::from(quantile) + 0.5) / f64::from(TOTAL);
                let value = location + scale * (share / (1.0 - share)).ln();
                (value.round() - centre as f64 + f64::from(half)).clamp(0.0, f64::from(2 * half + 1)) as u32
            }
        }
    }

    /// The symbol of a quantile, the cumulative frequency below it, and its frequency.
    pub(super) fn find(&self, quantile: u32) -> (u32, u32, NonZeroU32) {
        // Brackets the last index whose cumulative frequency does not exceed the quantile, with growing steps from the guess.
        let count = self.count();
        let guess = self.guess(quantile);
        let (mut low, mut high) = (guess, guess);
        let (mut left, mut right) = (self.cumulative(guess), 0);
        let mut stride = 1;
        if left <= quantile {
            while right <= quantile {
                high = (high + stride).min(count);
                right = self.cumulative(high);
                if right <= quantile {
                    (low, left) = (high, right);
                }
                stride *= 2;
            }
        } else {
            while left > quantile {
                (high, right) = (low, left);
                low = low.saturating_sub(stride);
                left = self.cumulative(low);
                stride *= 2;
            }
        }
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

/// A table that stores the frequency of the last symbol that was looked up.
pub(super) struct Found<'a> {
    table: &'a Table,
    pub(super) frequency: Cell<NonZeroU32>,
}

impl<'a> Found<'a> {
    pub(super) fn of(table: &'a Table) -> Self {
        Self {
            table,
            frequency: Cell::new(NonZeroU32::MIN),
        }
    }
}

impl EntropyModel<PRECISION> for &Found<'_> {
    type Symbol = u32;
    type Probability = u32;
}

impl DecoderModel<PRECISION> for &Found<'_> {
    fn quantile_function(&self, quantile: u32) -> (u32, u32, NonZeroU32) {
        let found = self.table.find(quantile);
        self.frequency.set(found.2);
        found
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The search from the guess takes few steps where the symbols mostly are.
    #[test]
    fn guesses_are_near() {
        let logistic = [(0.0, 0.3), (0.3, 0.5), (-7.6, 2.2), (1e6, 11.0), (0.5, 64.0)];
        for (location, scale) in logistic {
            let table = Table::logistic(location, scale);
            for quantile in (TOTAL / 20..TOTAL - TOTAL / 20).step_by(97) {
                let (guess, found) = (table.guess(quantile), table.find(quantile).0);
                assert!(f64::from(guess.abs_diff(found)) <= 1.0 + 0.3 * scale, "{table:?} {quantile}: {guess} {found}");
            }
            assert!(table.guess(0) < table.count() && table.guess(TOTAL - 1) < table.count());
        }
        for count in [2, 3, 64, 1000, 4096] {
            let table = Table::Uniform { count };
            for quantile in (0..TOTAL).step_by(97).chain([TOTAL - 1]) {
                let (guess, found) = (table.guess(quantile), table.find(quantile).0);
                assert!(guess < count && guess.abs_diff(found) <= 1, "{table:?} {quantile}: {guess} {found}");
            }
        }
    }

    /// Against the logistic law and the wide one in their textbook form.
    #[test]
    fn frequencies_follow_the_law() {
        for (location, scale) in [(0.0, 0.3), (0.4, 2.5), (-17.3, 30.0), (1e6, 64.0)] {
            let table = Table::logistic(location, scale);
            let Table::Logistic { centre, half, .. } = table else {
                unreachable!()
            };
            assert_eq!((centre, half), (location.round() as i64, (10.0 * scale).ceil() as u32 + 4));
            assert_eq!((table.count(), table.escape()), (2 * half + 2, Some(2 * half + 1)));
            for index in 1..=2 * half {
                let (_, frequency) = table.left_cumulative_and_probability(index).unwrap();
                let cdf = |x: f64| 0.5 + 0.5 * (0.5 * (x - location) / scale).tanh();
                let wide = |x: f64| 0.5 + 0.5 * (0.0625 * (x - location) / scale).tanh();
                let at = (centre - i64::from(half) + i64::from(index)) as f64;
                let share = 0.99 * (cdf(at + 0.5) - cdf(at - 0.5)) + 0.01 * (wide(at + 0.5) - wide(at - 0.5));
                // The last symbol before the escape has what lies beyond it, too.
                if index < 2 * half {
                    let exact = 1.0 + share * f64::from(TOTAL - 32 - (2 * half + 1));
                    assert!(
                        (f64::from(frequency.get()) - exact).abs() < 1.01,
                        "{table:?} {index}: {frequency} {exact}"
                    );
                }
            }
            assert!(table.left_cumulative_and_probability(table.count()).is_none());
            assert_eq!(table.left_cumulative_and_probability(2 * half + 1).unwrap().1.get(), 32);
        }
        assert_eq!(Table::Uniform { count: 7 }.escape(), None);
    }

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
                    assert_eq!(table.find(quantile), (index, left, p), "{table:?}");
                }
            }
            assert_eq!(total, TOTAL);
        }
    }
}
