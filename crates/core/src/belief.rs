//! What an estimator knows about the state at one moment: a probability distribution.

use crate::columns::{Columns, ColumnsMut, lengths_agree, state_at};
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// The probability distribution of a state of `D` coordinates, as a value that can be stored, sent, compared and replayed.
///
/// Laws ([`crate::laws::belief`]): samples have the belief's mean and covariance.
pub trait Belief<const D: usize> {
    /// Mean `E x`.
    fn mean(&self) -> SVector<f64, D>;

    /// Covariance `E (x - mean)(x - mean)'`.
    fn covariance(&self) -> SMatrix<f64, D, D>;

    /// Overwrites the columns with independent draws, `states[d][i]` being coordinate `d` of draw `i`. Writes NaN everywhere if columns
    /// differ in length ([`crate::columns::columns_agree`]).
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>);

    /// One draw.
    fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> SVector<f64, D> {
        let mut point = [[0.0]; D];
        self.sample_columns(rng, point.each_mut().map(|x| x.as_mut_slice()));
        SVector::from_fn(|d, _| point[d][0])
    }
}

/// A belief with a density.
///
/// Laws ([`crate::laws::belief`]): the density integrates to one; `add_log_densities` adds what `log_density` returns.
pub trait Density<const D: usize>: Belief<D> {
    /// `ln p(state)`: finite or `-inf`, never NaN for a finite state.
    fn log_density(&self, state: &SVector<f64, D>) -> f64;

    /// Adds the log density of every state to `logs`. Writes NaN everywhere if lengths differ ([`lengths_agree`]). Override it if a sweep
    /// over columns is faster than single calls.
    fn add_log_densities(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
        if lengths_agree(states, logs) {
            for (i, log) in logs.iter_mut().enumerate() {
                *log += self.log_density(&state_at(states, i));
            }
        }
    }
}
