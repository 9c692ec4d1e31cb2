//! Minimum, maximum, number and mean of values, as the index has them of each block.

use crate::block::Cells;
use crate::error::{Damage, ensure};
use crate::ranges::wider;
use crate::wire::Fields;

/// Number, smallest, largest and mean of finite values. Gaps, NaN and infinities are left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aggregate {
    count: u64,
    low: f64,
    high: f64,
    mean: f64,
}

impl Default for Aggregate {
    fn default() -> Self {
        Self {
            count: 0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            mean: 0.0,
        }
    }
}

/// Number of values whose sum is added to the others.
const PART: u64 = 256;
/// Largest size of the fields of an aggregate in bytes.
pub(crate) const MAX_BYTES: usize = 34;

impl Aggregate {
    /// Of the finite ones of these values.
    pub fn of(values: impl IntoIterator<Item = f64, IntoIter: Clone>) -> Self {
        let values = values.into_iter();
        Self::of_sum(values.clone()).unwrap_or_else(|| {
            let mut all = Self::default();
            values.for_each(|value| all.add(value));
            all
        })
    }

    /// By the sum of the values; `None` if it overflows.
    fn of_sum(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut all = Self::default();
        // Sums of parts first: the rounding error does not grow with the number of parts, and there is one division.
        let (mut sum, mut part) = (0.0, 0.0);
        let finite = values.filter(|value| value.is_finite());
        for value in finite {
            (all.low, all.high) = wider((all.low, all.high), value);
            part += value;
            all.count += 1;
            if all.count % PART == 0 {
                sum += part;
                part = 0.0;
            }
        }
        let sum = sum + part;
        if all.count > 0 {
            all.mean = (sum / all.count as f64).clamp(all.low, all.high);
        }
        sum.is_finite().then_some(all)
    }

    /// Includes a value, if it is finite.
    pub fn add(&mut self, value: f64) {
        if value.is_finite() {
            let (count, low, high, mean) = (1, value, value, value);
            self.merge(&Self { count, low, high, mean });
        }
    }

    /// Includes all values of another one.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let count = self.count.saturating_add(other.count);
        let share = other.count as f64 / count as f64;
        (self.low, self.high) = (self.low.min(other.low), self.high.max(other.high));
        // Halves cannot overflow, whatever the values.
        let halves = 0.5 * other.mean - 0.5 * self.mean;
        let mean = self.mean + share * halves + share * halves;
        // Rounding may put the mean of nearly equal values beside them.
        self.mean = mean.clamp(self.low, self.high);
        self.count = count;
    }

    /// Number of finite values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Smallest and largest value; `None` without values.
    pub fn ends(&self) -> Option<(f64, f64)> {
        (self.count > 0).then_some((self.low, self.high))
    }

    /// Mean of the values; `None` without values. Its rounding error is about `1e-16` of the largest size of a value per merged part.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then_some(self.mean)
    }

    /// The fields of an aggregate of a block of so many rows; a reader may be given any.
    pub(crate) fn code<F: Fields>(fields: &mut F, own: Self, rows: u64) -> Result<Self, Damage> {
        let damaged = Damage::Content("aggregate of a block");
        let is_constant = own.low.to_bits() == own.high.to_bits();
        let head = fields.varint(rows.saturating_sub(own.count) << 1 | u64::from(is_constant))?;
        let count = rows.checked_sub(head >> 1).ok_or(damaged)?;
        if count == 0 {
            return Ok(Self::default());
        }
        let low = fields.f64(own.low)?;
        let (high, mean) = if head & 1 == 1 {
            (low, low)
        } else {
            (fields.f64(own.high)?, fields.f64(own.mean)?)
        };
        ensure!(low.is_finite() && high.is_finite() && low <= mean && mean <= high, damaged);
        Ok(Self { count, low, high, mean })
    }
}

/// Of the cells of each column; a column that was not requested has none.
pub(crate) fn of_columns(columns: &[Cells]) -> Vec<Aggregate> {
    let of = |cells: &Cells| Aggregate::of(cells.iter().flatten().copied());
    columns.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::wire::{Bytes, written};

    #[test]
    fn aggregates_return_from_bytes() {
        for values in [
            vec![],
            vec![3.5],
            vec![-0.0, 0.0],
            vec![f64::MAX, f64::MIN, f64::NAN],
            vec![0.1; 7],
        ] {
            let aggregate = Aggregate::of(values.iter().copied());
            let rows = values.len() as u64 + 2;
            let bytes = written(|bytes| Aggregate::code(bytes, aggregate, rows));
            assert!(bytes.len() <= MAX_BYTES);
            let mut reader = Bytes(&bytes);
            assert_eq!(Aggregate::code(&mut reader, Aggregate::default(), rows).unwrap(), aggregate);
            assert!(reader.0.is_empty());
        }
    }

    #[test]
    fn mean_of_parts_is_that_of_all() {
        let values: Vec<f64> = (0..1000).map(|i| f64::from(i * i % 77) - 20.0).collect();
        let mut parts = Aggregate::default();
        values
            .chunks(13)
            .for_each(|part| parts.merge(&Aggregate::of(part.iter().copied())));
        let mean = values.iter().sum::<f64>() / 1000.0;
        assert!((parts.mean().unwrap() - mean).abs() < 1e-12);
        let ends = values
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), x| (x.min(l), x.max(h)));
        assert_eq!((parts.count(), parts.ends()), (1000, Some(ends)));
        let large = Aggregate::of([f64::MAX, f64::MIN, f64::MAX, f64::MIN]);
        assert!(large.mean().unwrap().abs() < 1e293);
    }
}
