//! The few cells that make most of the range of a column.
//!
//! A bound that is a share of the range is as wide as the range. One sentinel such as -9999 among temperatures makes `1%` a hundred
//! degrees. Such columns are found by a sample of their values: nine tenths of the cells lie within a tenth of the range.

/// Largest number of values of a column that are kept. If a column has more, every second one is dropped.
const MAX_KEPT: usize = 1 << 13;
/// Largest number of values of all columns that are kept.
const MAX_KEPT_OF_ALL: usize = 1 << 22;
/// Share of the cells that lie close together.
const MANY: f64 = 0.9;
/// Share of the range in which they lie.
const NARROW: f64 = 0.1;

/// A sample of the finite values of a column.
#[derive(Debug, Clone)]
pub(crate) struct Extent {
    count: u64,
    kept: Vec<f64>,
    max_kept: usize,
    /// Every this many values one is kept: a power of two.
    stride: u64,
}

impl Default for Extent {
    fn default() -> Self {
        Self::new(1)
    }
}

/// A few cells that make most of a column's range.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FewCells {
    /// Smallest and largest value of the column.
    pub ends: (f64, f64),
    /// An interval that holds nine tenths of the values.
    pub most: (f64, f64),
    /// Share of the values that lie outside that interval.
    pub share_outside: f64,
}

impl Extent {
    /// The extent of no values; `columns` is the number of columns of the table, which bounds the memory.
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            count: 0,
            kept: Vec::new(),
            max_kept: MAX_KEPT.min(MAX_KEPT_OF_ALL / columns.max(1)).max(64),
            stride: 1,
        }
    }

    /// Takes one finite value in.
    #[inline]
    pub(crate) fn push(&mut self, value: f64) {
        if self.count & (self.stride - 1) == 0 {
            self.kept.push(value);
            if self.kept.len() >= self.max_kept {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
        }
        self.count += 1;
    }

    /// The few cells that make most of the range; `None` if there are none.
    pub(crate) fn few(&self, ends: (f64, f64)) -> Option<FewCells> {
        let mut sorted = self.kept.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let inside = (MANY * sorted.len() as f64).ceil() as usize;
        if inside == 0 || inside == sorted.len() {
            return None;
        }
        // The shortest interval that holds nine tenths of the values. Halves keep the widths of huge ranges finite.
        let width = |pair: (f64, f64)| 0.5 * pair.1 - 0.5 * pair.0;
        let intervals = sorted.windows(inside).map(|part| (part[0], part[inside - 1]));
        let most = intervals.min_by(|a, b| width(*a).total_cmp(&width(*b)))?;
        let outside = sorted
            .iter()
            .filter(|value| **value < most.0 || **value > most.1)
            .count();
        // Equal cells at the ends may lie inside as well. The ends may have been dropped from the sample: then they are rarer still.
        let share_outside = (outside as f64 / sorted.len() as f64).max(1.0 / self.count as f64);
        (width(most) < NARROW * width(ends)).then_some(FewCells {
            ends,
            most,
            share_outside,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn few(values: impl IntoIterator<Item = f64>) -> Option<FewCells> {
        let (mut extent, mut ends) = (Extent::new(3), None);
        for value in values {
            let (low, high): (f64, f64) = ends.unwrap_or((value, value));
            ends = Some((low.min(value), high.max(value)));
            extent.push(value);
        }
        extent.few(ends?)
    }

    #[test]
    fn sentinels_and_outliers_make_most_of_a_range() {
        let temperature = |i: u32| 16.8 + 6.4 * f64::from(i % 100) / 100.0;
        let found = few((0..100_000).map(|i| if i % 50 == 7 { -9999.0 } else { temperature(i) })).unwrap();
        assert!((found.share_outside - 0.02).abs() < 0.09 && found.ends.0 == -9999.0);
        assert!(found.most.0 >= 16.8 && found.most.1 <= 23.2);
        // One cell of a million, and one of twelve.
        assert!(few((0..1_000_000).map(|i| if i == 777_777 { 1e300 } else { temperature(i) })).is_some());
        assert!(few((0..12).map(|i| if i == 7 { 1e6 } else { temperature(9 * i) })).is_some());
        assert!(few((0..20).map(|i| if i == 7 { -f64::MAX } else { f64::MAX * 0.999 })).is_some());
    }

    #[test]
    fn usual_ranges_have_no_few_cells() {
        assert_eq!(few((0..1000).map(f64::from)), None);
        assert_eq!(few((0..1000).map(|i| (0.1 * f64::from(i)).sin())), None);
        assert_eq!(few((0..1000).map(|_| 7.0)), None);
        assert_eq!(few([]), None);
        assert_eq!(few([1.0]), None);
    }
}
