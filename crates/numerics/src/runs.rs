//! Runs of equal values in a series.

use serde::{Deserialize, Serialize};

/// How often the values of a series equal the one before them.
///
/// A pair of successive values is counted when the run of its first value has ended, so that the present run can be compared with those before it.
///
/// ```
/// use fewbits_numerics::Runs;
/// let mut runs = Runs::default();
/// for value in [1.0, 1.0, 3.0, 2.0, 2.0, 2.0] {
///     runs.add(value);
/// }
/// assert_eq!((runs.pairs, runs.equal, runs.repetitions), (3, 1, 2));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Runs {
    /// The last value.
    #[serde(default, with = "crate::stored")]
    pub last: Option<f64>,
    /// Pairs of successive values before the present run: as many as values before it.
    pub pairs: u32,
    /// How many of these pairs are equal.
    pub equal: u32,
    /// Values of the present run that equal the one before them.
    #[serde(rename = "run")]
    pub repetitions: u32,
}

impl Runs {
    /// Adds a value and returns the one before it. Counts stop at the largest `u32`.
    pub fn add(&mut self, value: f64) -> Option<f64> {
        let last = self.last.replace(value);
        if last == Some(value) {
            self.repetitions = self.repetitions.saturating_add(1);
        } else if last.is_some() {
            self.pairs = self.pairs.saturating_add(self.repetitions).saturating_add(1);
            self.equal = self.equal.saturating_add(self.repetitions);
            self.repetitions = 0;
        }
        last
    }
}
