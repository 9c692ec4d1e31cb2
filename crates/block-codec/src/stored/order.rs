//! What symbols code: indices less a common centre, their differences, or differences of differences.

use crate::error::{Damaged, ensure};
use crate::rows::{LARGEST, damaged};

/// Kinds of orders, as blocks state them and as parameters of loops: the index less the one before; that difference less the one before, which is
/// zero at first; the index less the centre.
pub(crate) const FIRST: u8 = 0;
pub(crate) const SECOND: u8 = 1;
pub(crate) const VALUES: u8 = 2;

/// What is coded of each index behind the first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Order {
    pub(crate) kind: u8,
    /// The centre of values.
    pub(crate) centre: i64,
}

impl Order {
    /// What is coded of all indices but the first.
    pub(crate) fn differences(self, indices: &[i64]) -> Vec<i64> {
        let others = indices.get(1..).unwrap_or_default();
        let slopes = || others.iter().zip(indices).map(|(index, last)| index - last);
        match self.kind {
            VALUES => others.iter().map(|index| index - self.centre).collect(),
            FIRST => slopes().collect(),
            _ => {
                let bends = indices.windows(3).map(|row| row[2] - row[1] - (row[1] - row[0]));
                slopes().take(1).chain(bends).collect()
            }
        }
    }

    /// Appends the indices of [`Sums`] that begin behind the last index.
    pub(crate) fn push(self, indices: &mut Vec<i64>, sums: &[i64]) -> Result<(), Damaged> {
        let begun = indices.len();
        let last = indices[begun - 1];
        // Differences that no writer writes may have sums beyond 64 bits, and then any indices.
        if self.kind == SECOND {
            let slope = last - indices[begun.max(2) - 2];
            let lines = (1_i64..).map(|row| last.wrapping_add(slope.wrapping_mul(row)));
            indices.extend(sums.iter().zip(lines).map(|(sum, line)| sum.wrapping_add(line)));
        } else {
            let base = if self.kind == VALUES { self.centre } else { last };
            indices.extend(sums.iter().map(|sum| sum.wrapping_add(base)));
        }
        // Bits of all sizes together.
        let found = &indices[begun..];
        let bits = found.iter().fold(0, |bits, index| bits | index ^ index >> 63);
        let largest = || found.iter().copied().max_by_key(|index| index.unsigned_abs());
        ensure!(bits < 2 * LARGEST, damaged(largest().unwrap_or(0)));
        Ok(())
    }
}

/// The sums of differences, or of their sums, from zero on; values are taken as they are.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    slope: i64,
    sum: i64,
}

impl Sums {
    pub(crate) const START: Self = Self { slope: 0, sum: 0 };

    #[inline(always)]
    pub(crate) fn add(&mut self, kind: u8, difference: i64) -> i64 {
        match kind {
            VALUES => return difference,
            FIRST => self.sum = self.sum.wrapping_add(difference),
            _ => {
                self.slope = self.slope.wrapping_add(difference);
                self.sum = self.sum.wrapping_add(self.slope);
            }
        }
        self.sum
    }
}
