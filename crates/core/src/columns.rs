//! States side by side: one contiguous column a coordinate, so that inner loops vectorise.

use nalgebra::SVector;

/// Borrowed structure-of-arrays states: `columns[d][i]` is coordinate `d` of state `i`.
pub type Columns<'a, const D: usize> = [&'a [f64]; D];

/// Mutable structure-of-arrays states.
pub type ColumnsMut<'a, const D: usize> = [&'a mut [f64]; D];

/// State `i` of a structure of arrays.
#[inline]
pub fn state_at<const D: usize>(columns: &Columns<'_, D>, i: usize) -> SVector<f64, D> {
    SVector::from_fn(|d, _| columns[d][i])
}

/// Writes `state` as state `i`.
#[inline]
pub fn set_state<const D: usize>(columns: &mut ColumnsMut<'_, D>, i: usize, state: &SVector<f64, D>) {
    for (column, x) in columns.iter_mut().zip(state.iter()) {
        column[i] = *x;
    }
}

/// Number of states: the length of the shortest column, 0 where `D` is 0.
#[inline]
pub fn count<T: AsRef<[f64]>>(columns: &[T]) -> usize {
    columns.iter().map(|column| column.as_ref().len()).min().unwrap_or(0)
}
