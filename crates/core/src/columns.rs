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

/// Whether a sweep from `columns` to `out` may run: all are of one length.
///
/// The one rule for sweeps over slices of unequal lengths: nothing is truncated and nothing panics, but all of `out` becomes NaN, which
/// whoever weighs refuses ([`crate::Error::NotANumber`]). Every sweep begins with this check.
#[inline]
pub fn lengths_agree<const D: usize>(columns: &Columns<'_, D>, out: &mut [f64]) -> bool {
    let agree = columns.iter().all(|column| column.len() == out.len());
    if !agree {
        out.fill(f64::NAN);
    }
    agree
}

/// The same for a sweep over the states of `columns` in place.
#[inline]
pub fn columns_agree<const D: usize>(columns: &mut ColumnsMut<'_, D>) -> bool {
    let agree = columns.windows(2).all(|pair| pair[0].len() == pair[1].len());
    if !agree {
        columns.iter_mut().for_each(|column| column.fill(f64::NAN));
    }
    agree
}

/// Changes every state of a cloud, the first first; NaN where columns differ in length ([`columns_agree`]).
#[inline]
pub fn change_each<const D: usize>(
    mut columns: ColumnsMut<'_, D>,
    mut change: impl FnMut(SVector<f64, D>) -> SVector<f64, D>,
) {
    if columns_agree(&mut columns) {
        for i in 0..count(&columns) {
            let changed = change(SVector::from_fn(|d, _| columns[d][i]));
            set_state(&mut columns, i, &changed);
        }
    }
}

/// As [`lengths_agree`] for a sweep from states to measurements.
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
