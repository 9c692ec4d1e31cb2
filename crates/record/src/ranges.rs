//! Ranges of the columns so far, and the error bounds that follow from shares of them.

use crate::block::Cells;
use crate::bound::Bound;
use crate::header::{Header, rounded_down};
use crate::schema::Schema;
use std::ops::Range;

/// A block states its own bound if that exceeds the header's by this factor.
const WIDER: f64 = 1.25;

/// Smallest and largest of some values; `None` without values.
pub(crate) type Ends = Option<(f64, f64)>;

/// The ends including one more cell, if it is finite.
pub(crate) fn with(ends: Ends, cell: Option<f64>) -> Ends {
    match (ends, cell.filter(|value| value.is_finite())) {
        (None, value) => value.map(|value| (value, value)),
        (ends, None) => ends,
        (Some((low, high)), Some(value)) => Some((smaller(low, value), larger(high, value))),
    }
}

/// The smaller one of two numbers, the first one if neither is. On all machines one comparison, of zeros of unequal signs too.
#[inline(always)]
pub(crate) fn smaller(one: f64, other: f64) -> f64 {
    if other < one { other } else { one }
}

/// The larger one, as [`smaller`].
#[inline(always)]
pub(crate) fn larger(one: f64, other: f64) -> f64 {
    if other > one { other } else { one }
}

/// The ends of the finite cells so far, of each column whose bound is a share of a range that is not known.
#[derive(Debug)]
pub(crate) struct Ranges(Vec<(usize, Ends)>);

impl Ranges {
    pub(crate) fn new(schema: &Schema) -> Self {
        let columns = schema.columns.iter().enumerate();
        let unknown =
            columns.filter(|(_, spec)| matches!(spec.bound, Bound::ShareOfRange(_)) && spec.known_range().is_none());
        Self(unknown.map(|(column, _)| (column, None)).collect())
    }

    /// Includes one row.
    pub(crate) fn add(&mut self, row: &[Option<f64>]) {
        for (column, ends) in &mut self.0 {
            *ends = with(*ends, row[*column]);
        }
    }

    /// Includes some rows of these columns.
    pub(crate) fn extend(&mut self, columns: &[Cells], rows: Range<usize>) {
        for (column, ends) in &mut self.0 {
            *ends = columns[*column][rows.clone()]
                .iter()
                .fold(*ends, |ends, cell| with(ends, *cell));
        }
    }

    fn ends(&self, column: usize) -> Ends {
        let place = self.0.binary_search_by_key(&column, |(of, _)| *of);
        place.ok().and_then(|place| self.0[place].1)
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
            .or_else(|| self.ends(column).map(|(low, high)| high - low));
        // The product may have been rounded up, which a bound must not be.
        let bound = (share * range.unwrap_or(0.0)).next_down().max(0.0);
        Some(if (2.0 * bound).is_finite() { bound } else { 0.0 })
    }

    /// The bounds of shares for a header; 0 for other columns.
    pub(crate) fn bounds(&self, schema: &Schema) -> Vec<f64> {
        (0..schema.columns.len())
            .map(|i| self.share_bound(schema, i).unwrap_or(0.0))
            .collect()
    }

    /// The bounds that a block must state itself, because the header's are much smaller.
    pub(crate) fn own_bounds(&self, header: &Header) -> Vec<Option<f64>> {
        let own = |i: usize| {
            let bound = rounded_down(self.share_bound(&header.schema, i)?);
            (bound > WIDER * header.share_bounds[i]).then_some(bound)
        };
        (0..header.schema.columns.len()).map(own).collect()
    }
}
