//! States in columns: one contiguous slice per coordinate, so that inner loops run in vector registers.

use nalgebra::SVector;

/// Borrowed states: `columns[d][i]` is coordinate `d` of state `i`.
pub type Columns<'a, const D: usize> = [&'a [f64]; D];

/// The same, mutable.
pub type ColumnsMut<'a, const D: usize> = [&'a mut [f64]; D];

/// State `i` of the columns.
#[inline]
pub fn state_at<const D: usize>(columns: &[impl AsRef<[f64]>; D], i: usize) -> SVector<f64, D> {
    SVector::from_fn(|d, _| columns[d].as_ref()[i])
}

/// Writes `state` as state `i`.
#[inline]
pub fn set_state<const D: usize>(columns: &mut ColumnsMut<'_, D>, i: usize, state: &SVector<f64, D>) {
    for (column, x) in columns.iter_mut().zip(state.iter()) {
        column[i] = *x;
    }
}

/// Whether all slices have one length, so that a sweep from `columns` to `out` may run. If not, all of `out` is set to NaN.
///
/// All sweeps treat slices of unequal lengths in this way: nothing is truncated and nothing panics. The NaN then becomes
/// [`crate::Error::NotANumber`] when weights are formed. Every sweep begins with this check.
#[inline]
pub fn lengths_agree<const D: usize>(columns: &Columns<'_, D>, out: &mut [f64]) -> bool {
    let agree = columns.iter().all(|column| column.len() == out.len());
    if !agree {
        out.fill(f64::NAN);
    }
    agree
}

/// As [`lengths_agree`], for a sweep that changes the states of `columns` in place.
#[inline]
pub fn columns_agree<const D: usize>(columns: &mut ColumnsMut<'_, D>) -> bool {
    let agree = columns.windows(2).all(|pair| pair[0].len() == pair[1].len());
    if !agree {
        columns.iter_mut().for_each(|column| column.fill(f64::NAN));
    }
    agree
}

/// Applies a function to every state in place, in order. Writes NaN everywhere if columns differ in length ([`columns_agree`]).
#[inline]
pub fn change_each<const D: usize>(
    mut columns: ColumnsMut<'_, D>,
    mut change: impl FnMut(SVector<f64, D>) -> SVector<f64, D>,
) {
    if columns_agree(&mut columns) {
        for i in 0..count(&columns) {
            let changed = change(state_at(&columns, i));
            set_state(&mut columns, i, &changed);
        }
    }
}

/// As [`lengths_agree`], for a sweep from states to measurements.
#[inline]
pub fn measurements_agree<const D: usize, const M: usize>(
    states: &Columns<'_, D>,
    means: &mut ColumnsMut<'_, M>,
) -> bool {
    let agree = means
        .iter()
        .all(|mean| states.iter().all(|state| state.len() == mean.len()));
    if !agree {
        means.iter_mut().for_each(|mean| mean.fill(f64::NAN));
    }
    agree
}

/// Number of states: the length of the shortest column, 0 where `D` is 0.
#[inline]
pub fn count<T: AsRef<[f64]>>(columns: &[T]) -> usize {
    columns.iter().map(|column| column.as_ref().len()).min().unwrap_or(0)
}
