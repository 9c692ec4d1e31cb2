//! What symbols code: indices less a common centre, their differences, or differences of differences.

use crate::error::Damaged;
use crate::rows::{LARGEST, damaged};

/// What is coded of each index behind the first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// The index less the centre.
    Values { centre: i64 },
    /// The index less the one before.
    First,
    /// The difference less the one before, which is zero at first.
    Second,
}

impl Order {
    /// What is coded of all indices but the first.
    pub(super) fn differences(self, indices: &[i64]) -> Vec<i64> {
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
    pub(super) fn push_indices(self, indices: &mut Vec<i64>, differences: &[i64]) -> Result<(), Damaged> {
        let last = indices[indices.len() - 1];
        let slope = last - indices[indices.len().max(2) - 2];
        let start = indices.len();
        match self {
            Self::Values { centre } => indices.extend(differences.iter().map(|difference| centre + difference)),
            Self::First => indices.extend(differences.iter().scan(last, |last, difference| {
                *last += difference;
                Some(*last)
            })),
            Self::Second => indices.extend(differences.iter().scan((last, slope), |(last, slope), difference| {
                *slope = slope.wrapping_add(*difference);
                *last = last.wrapping_add(*slope);
                Some(*last)
            })),
        }
        // Differences that no writer writes may have sums beyond 64 bits: larger indices among them end the block.
        match indices[start..].iter().find(|index| index.abs() > LARGEST) {
            Some(index) => Err(damaged(*index)),
            None => Ok(()),
        }
    }
}
