//! Minimum, maximum, number and mean of whole numbers of 64 bits, exactly.

/// Number, smallest, largest and sum of whole numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WholeAggregate {
    count: u64,
    ends: Option<(i64, i64)>,
    /// Of fewer than 2^64 numbers of 64 bits.
    sum: i128,
}

impl WholeAggregate {
    /// Includes a number.
    pub fn add(&mut self, number: i64) {
        self.merge(&Self {
            count: 1,
            ends: Some((number, number)),
            sum: number.into(),
        });
    }

    /// Includes all numbers of another one.
    pub fn merge(&mut self, other: &Self) {
        self.count = self.count.saturating_add(other.count);
        self.sum = self.sum.saturating_add(other.sum);
        self.ends = match (self.ends, other.ends) {
            (Some((low, high)), Some((a, b))) => Some((low.min(a), high.max(b))),
            (own, other) => own.or(other),
        };
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The smallest and the largest; `None` if there are none.
    pub fn ends(&self) -> Option<(i64, i64)> {
        self.ends
    }

    /// The double next to the mean, or the one beside it; `None` if there are none.
    pub fn mean(&self) -> Option<f64> {
        let count = i128::from(self.count);
        // The whole part and the rest apart: the sum of many large numbers has more digits than a double.
        (count > 0).then(|| self.sum.div_euclid(count) as f64 + self.sum.rem_euclid(count) as f64 / count as f64)
    }
}
