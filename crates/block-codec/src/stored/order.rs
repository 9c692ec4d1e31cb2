//! What symbols code: indices less a common centre, their differences, or differences of differences.

use crate::error::Damaged;
use crate::rows::{LARGEST, damaged};

/// What is coded of each index behind the first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// The index less the centre.
    Values { centre: i64 },
    /// The index less the one before.
    First,
    /// The difference less the one before, which is zero at first.
    Second,
}

impl Order {
    /// What is coded of all indices but the first.
    pub(crate) fn differences(self, indices: &[i64]) -> Vec<i64> {
        let Some((first, others)) = indices.split_first() else {
            return Vec::new();
        };
        let slopes = || others.iter().zip(indices).map(|(index, last)| index - last);
        match self {
            Self::Values { centre } => others.iter().map(|index| index - centre).collect(),
            Self::First => slopes().collect(),
            Self::Second => {
                let first = others.first().map(|second| second - first);
                let bends = indices.windows(3).map(|row| row[2] - row[1] - (row[1] - row[0]));
                first.into_iter().chain(bends).collect()
            }
        }
    }

    /// Appends the indices of these differences, the inverse of [`differences`](Self::differences).
    pub(crate) fn push_indices(self, indices: &mut Vec<i64>, differences: &[i64]) -> Result<(), Damaged> {
        let last = indices[indices.len() - 1];
        let slope = last - indices[indices.len().max(2) - 2];
        let start = indices.len();
        indices.extend_from_slice(differences);
        let found = &mut indices[start..];
        // Differences that no writer writes may have sums beyond 64 bits: larger indices among them end the block.
        match self {
            Self::Values { centre } => found.iter_mut().for_each(|index| *index += centre),
            Self::First => {
                found.iter_mut().fold(last, |last, index| {
                    *index += last;
                    *index
                });
            }
            Self::Second => {
                found.iter_mut().fold((last, slope), |(last, slope), index| {
                    let slope = index.wrapping_add(slope);
                    *index = last.wrapping_add(slope);
                    (*index, slope)
                });
            }
        }
        let is_large = |index: &i64| index.unsigned_abs() > LARGEST as u64;
        if found.iter().fold(false, |any, index| any | is_large(index)) {
            return Err(damaged(found.iter().copied().find(is_large).unwrap_or(0)));
        }
        Ok(())
    }
}
