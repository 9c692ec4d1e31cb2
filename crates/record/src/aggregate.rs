//! Minimum, maximum, number and mean of values: of a block in the index, and of all rows of a stretch of time.

use crate::block::{Block, Cells};
use crate::blocks::Blocks;
use crate::error::{Damage, Error};
use crate::playback::Playback;
use crate::wire::{Bytes, push_varint};
use fewbits_block_codec::ArgumentError;
use std::collections::BTreeMap;
use std::io::{Read, Seek};

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
/// Largest size of a content of [`Aggregate::push`] in bytes.
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
            (all.low, all.high) = (all.low.min(value), all.high.max(value));
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

    /// Appends it, for a block of so many rows.
    pub(crate) fn push(&self, bytes: &mut Vec<u8>, rows: u64) {
        let is_constant = self.low.to_bits() == self.high.to_bits();
        push_varint(bytes, rows.saturating_sub(self.count) << 1 | u64::from(is_constant));
        if self.count > 0 {
            bytes.extend(self.low.to_le_bytes());
            if !is_constant {
                bytes.extend(self.high.to_le_bytes());
                bytes.extend(self.mean.to_le_bytes());
            }
        }
    }

    /// Reads what [`push`](Self::push) wrote.
    pub(crate) fn read(reader: &mut Bytes<'_>, rows: u64) -> Result<Self, Damage> {
        let damaged = Damage::Content("aggregate of a block");
        let head = reader.varint()?;
        let count = rows.checked_sub(head >> 1).ok_or(damaged)?;
        if count == 0 {
            return Ok(Self::default());
        }
        let low = reader.f64()?;
        let (high, mean) = if head & 1 == 1 {
            (low, low)
        } else {
            (reader.f64()?, reader.f64()?)
        };
        if low.is_finite() && high.is_finite() && low <= mean && mean <= high {
            Ok(Self { count, low, high, mean })
        } else {
            Err(damaged)
        }
    }
}

/// Of the cells of each column; a column that was not requested has none.
pub(crate) fn of_columns(columns: &[Cells]) -> Vec<Aggregate> {
    let of = |cells: &Cells| Aggregate::of(cells.iter().flatten().copied());
    columns.iter().map(of).collect()
}

/// Aggregates of the rows of one stretch of time.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Stretch {
    /// The first tick of the stretch, a multiple of its length.
    pub tick: i64,
    /// Number of rows.
    pub rows: u64,
    /// One aggregate per requested column, in the order of the request.
    pub columns: Vec<Aggregate>,
}

/// Stretches by number.
struct Stretches {
    every: i64,
    ticks: (i64, i64),
    chosen: Vec<usize>,
    found: BTreeMap<i64, Stretch>,
}

impl Stretches {
    fn at(&mut self, number: i64) -> &mut Stretch {
        let Self {
            every, chosen, found, ..
        } = self;
        found.entry(number).or_insert_with(|| Stretch {
            // The first stretch may begin before the smallest tick.
            tick: number.saturating_mul(*every),
            rows: 0,
            columns: vec![Aggregate::default(); chosen.len()],
        })
    }

    /// The number of the stretch that all these ticks belong to, if all are asked for.
    fn of_all(&self, (first, last): (i64, i64)) -> Option<i64> {
        let is_inside = self.ticks.0 <= first && last <= self.ticks.1;
        let number = first.div_euclid(self.every);
        (is_inside && number == last.div_euclid(self.every)).then_some(number)
    }

    fn add(&mut self, block: &Block) {
        let chosen = self.chosen.clone();
        for (row, tick) in block.ticks.iter().enumerate() {
            if *tick < self.ticks.0 || *tick > self.ticks.1 {
                continue;
            }
            let stretch = self.at(tick.div_euclid(self.every));
            stretch.rows += 1;
            for (aggregate, column) in stretch.columns.iter_mut().zip(&chosen) {
                if let Some(value) = block.columns[*column][row] {
                    aggregate.add(value);
                }
            }
        }
    }
}

impl<R: Read + Seek> Playback<R> {
    /// Aggregates of the requested columns over stretches of `every` ticks, which begin at multiples of it, in the order of time. Stretches
    /// without rows are left out. Only rows with ticks in `from..=to` count. A block that lies in one stretch is not decoded if the index
    /// has its aggregates ([`BlockInfo::aggregates`](crate::BlockInfo::aggregates)). `damaged` is told each part that cannot be read; the
    /// rest counts.
    ///
    /// # Errors
    /// If `every` is 0 or above `2^63 - 1`, or reading fails.
    pub fn aggregates(
        &mut self,
        every: u64,
        (from, to): (i64, i64),
        mut damaged: impl FnMut(&Error),
    ) -> Result<Vec<Stretch>, Error> {
        let length = i64::try_from(every).ok().filter(|every| *every > 0);
        let length = length.ok_or_else(|| ArgumentError::new("every", every, "1 to 2^63 - 1 ticks"))?;
        let mut stretches = Stretches {
            every: length,
            ticks: (from, to),
            chosen: self.chosen.clone(),
            found: BTreeMap::new(),
        };
        let tolerance = i64::try_from(self.header.schema.time.tolerance()).unwrap_or(i64::MAX);
        let mut blocks = Blocks::new(self, (from, to));
        loop {
            // The ticks of a reader may differ from those of the index by the tolerance.
            let wide = |(first, last): (i64, i64)| (first.saturating_sub(tolerance), last.saturating_add(tolerance));
            while let Some((entry, aggregates)) = blocks.known(|ticks| stretches.of_all(wide(ticks)).is_some())? {
                let Some(number) = stretches.of_all(wide(entry)) else {
                    break;
                };
                let (rows, chosen) = (aggregates.0, stretches.chosen.clone());
                let stretch = stretches.at(number);
                stretch.rows += rows;
                for (sum, column) in stretch.columns.iter_mut().zip(chosen) {
                    sum.merge(&aggregates.1[column]);
                }
            }
            match blocks.next() {
                None => break,
                Some(Ok(block)) => stretches.add(&block),
                Some(Err(error @ Error::Block { .. })) => damaged(&error),
                Some(Err(error)) => return Err(error),
            }
        }
        Ok(stretches.found.into_values().collect())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

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
            let mut bytes = Vec::new();
            aggregate.push(&mut bytes, values.len() as u64 + 2);
            assert!(bytes.len() <= MAX_BYTES);
            let mut reader = Bytes(&bytes);
            assert_eq!(Aggregate::read(&mut reader, values.len() as u64 + 2).unwrap(), aggregate);
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
