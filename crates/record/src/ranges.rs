//! Ranges of the columns so far, and the error bounds that follow from shares of them.

use crate::bound::Bound;
use crate::header::{Header, rounded_down};
use crate::schema::Schema;

/// A block states its own bound if that exceeds the header's by this factor.
const WIDER: f64 = 1.25;

/// Smallest and largest of some values; `None` without values.
pub(crate) type Ends = Option<(f64, f64)>;

/// The ends including more cells, of those that are finite.
pub(crate) fn with(ends: Ends, cells: &[Option<f64>]) -> Ends {
    let finite = cells.iter().flatten().filter(|value| value.is_finite());
    let none = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = finite.fold(ends.unwrap_or(none), |ends, value| wider(ends, *value));
    (low <= high).then_some((low, high))
}

/// The ends including one more number. Comparisons, since `f64::min` is a call in WebAssembly.
pub(crate) fn wider((low, high): (f64, f64), value: f64) -> (f64, f64) {
    (if value < low { value } else { low }, if value > high { value } else { high })
}

/// The ends of each column's finite cells so far.
#[derive(Debug)]
pub(crate) struct Ranges(Vec<Ends>);

impl Ranges {
    pub(crate) fn new(columns: usize) -> Self {
        Self(vec![None; columns])
    }

    /// Includes cells of a column.
    pub(crate) fn add(&mut self, column: usize, cells: &[Option<f64>]) {
        self.0[column] = with(self.0[column], cells);
    }

    /// A bound that does not exceed the column's share of the present range; 0 if the range is empty or overflows. `None` for columns
    /// without a share.
    fn share_bound(&self, schema: &Schema, column: usize) -> Option<f64> {
        let spec = &schema.columns[column];
        let Bound::ShareOfRange(share) = spec.bound else {
            return None;
        };
        let range = spec
            .known_range()
            .or_else(|| self.0[column].map(|(low, high)| high - low));
        // The product may have been rounded up, which a bound must not be.
        let bound = (share * range.unwrap_or(0.0)).next_down().max(0.0);
        Some(if (2.0 * bound).is_finite() { bound } else { 0.0 })
    }

    /// The bounds of shares for a header; 0 for other columns.
    pub(crate) fn bounds(&self, schema: &Schema) -> Vec<f64> {
        (0..self.0.len())
            .map(|i| self.share_bound(schema, i).unwrap_or(0.0))
            .collect()
    }

    /// The bounds that a block must state itself, because the header's are much smaller.
    pub(crate) fn own_bounds(&self, header: &Header) -> Vec<Option<f64>> {
        let own = |i: usize| {
            let bound = rounded_down(self.share_bound(&header.schema, i)?);
            (bound > WIDER * header.share_bounds[i]).then_some(bound)
        };
        (0..self.0.len()).map(own).collect()
    }
}
