//! What symbols code: indices less a common centre, their differences, or differences of differences.

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
}
