//! Minimum, maximum, number and mean of the values of stretches of time, by the index where it has them.

use crate::aggregate::Aggregate;
use crate::block::Block;
use crate::blocks::{Blocks, Part};
use crate::error::Error;
use crate::index::BlockInfo;
use crate::integers::Integers;
use crate::playback::Playback;
use crate::whole::WholeAggregate;
use fewbits_block_codec::ArgumentError;
use std::collections::BTreeMap;
use std::io::{Read, Seek};

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
    /// Of the requested columns of whole numbers of 64 bits ([`Column::integers`](crate::Column::integers)), whose values are codes, the
    /// aggregate of the numbers; `None` for the others.
    pub wholes: Vec<Option<WholeAggregate>>,
}

/// Stretches by number.
struct Stretches {
    every: i64,
    ticks: (i64, i64),
    /// The requested columns, and how they code whole numbers.
    chosen: Vec<(usize, Option<Integers>)>,
    found: BTreeMap<i64, Stretch>,
}

impl Stretches {
    fn at(&mut self, number: i64) -> &mut Stretch {
        let whole = |(_, integers): &(_, Option<Integers>)| integers.map(|_| WholeAggregate::default());
        self.found.entry(number).or_insert_with(|| Stretch {
            // The first stretch may begin before the smallest tick.
            tick: number.saturating_mul(self.every),
            rows: 0,
            columns: vec![Aggregate::default(); self.chosen.len()],
            wholes: self.chosen.iter().map(whole).collect(),
        })
    }

    /// The number of the stretch that all these ticks belong to, if all are asked for.
    fn of_all(&self, (first, last): (i64, i64)) -> Option<i64> {
        let is_inside = self.ticks.0 <= first && last <= self.ticks.1;
        let number = first.div_euclid(self.every);
        (is_inside && number == last.div_euclid(self.every)).then_some(number)
    }

    /// Includes the aggregates of a block, if the index has them and it lies in one stretch.
    fn merge(&mut self, entry: &BlockInfo, tolerance: i64) -> bool {
        // The ticks of a reader may differ from those of the index by the tolerance.
        let (first, last) = (entry.ticks.0.saturating_sub(tolerance), entry.ticks.1.saturating_add(tolerance));
        let is_indexed = self.chosen.iter().all(|(_, integers)| integers.is_none());
        let number = self.of_all((first, last)).filter(|_| is_indexed);
        let (Some(aggregates), Some(number)) = (&entry.aggregates, number) else {
            return false;
        };
        let chosen = self.chosen.clone();
        let stretch = self.at(number);
        stretch.rows += entry.rows;
        for (sum, (column, _)) in stretch.columns.iter_mut().zip(chosen) {
            sum.merge(&aggregates[column]);
        }
        true
    }

    fn add(&mut self, block: &Block) {
        let chosen = self.chosen.clone();
        for (row, tick) in block.ticks.iter().enumerate() {
            if *tick < self.ticks.0 || *tick > self.ticks.1 {
                continue;
            }
            let stretch = self.at(tick.div_euclid(self.every));
            stretch.rows += 1;
            for (i, (column, integers)) in chosen.iter().enumerate() {
                let Some(value) = block.columns[*column][row] else {
                    continue;
                };
                match (&mut stretch.wholes[i], integers) {
                    (Some(whole), Some(integers)) => whole.add(integers.number(value)),
                    _ => stretch.columns[i].add(value),
                }
            }
        }
    }
}

impl<R: Read + Seek> Playback<R> {
    /// Aggregates of the requested columns over stretches of `every` ticks, which begin at multiples of it, in the order of time. Stretches
    /// without rows are left out. Only rows with ticks in `from..=to` count. A block that lies in one stretch is not decoded if the index
    /// has its aggregates ([`BlockInfo::aggregates`](crate::BlockInfo::aggregates)), and no requested column has whole numbers of 64 bits: the
    /// index has the aggregates of their codes. `damaged` is told each part that cannot be read; the
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
        let columns = self.header.schema.columns();
        let chosen = self.chosen.iter().map(|column| (*column, columns[*column].integers()));
        let mut stretches = Stretches {
            every: length,
            ticks: (from, to),
            chosen: chosen.collect(),
            found: BTreeMap::new(),
        };
        let tolerance = i64::try_from(self.header.schema.time.tolerance()).unwrap_or(i64::MAX);
        let mut blocks = Blocks::new(self, (from, to));
        while let Some(part) = blocks.part().transpose() {
            let block = part.and_then(|part| match &part {
                Part::Known(entry) if stretches.merge(entry, tolerance) => Ok(None),
                _ => blocks.block(part).map(Some),
            });
            match block {
                Ok(block) => block.iter().for_each(|block| stretches.add(block)),
                Err(error @ Error::Block { .. }) => damaged(&error),
                Err(error) => return Err(error),
            }
        }
        Ok(stretches.found.into_values().collect())
    }
}
