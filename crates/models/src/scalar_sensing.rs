//! Sensing of one number a sensor, of whole clouds of states.

use crate::{LinearSensor, ReceivedPower};
use fewbits_core::state_space::state_at;
use fewbits_core::{Columns, Sensing};

/// A sensor with scalar measurements that can be evaluated over a cloud of states at once.
///
/// Law: `mean_columns` writes what [`Sensing::mean`] returns, to rounding.
pub trait ScalarSensing<const D: usize>: Sensing<D, 1> {
    /// Writes the noise-free measurement of every state to `means`, which is as long as the columns.
    fn mean_columns(&self, states: &Columns<'_, D>, means: &mut [f64]) {
        for (i, mean) in means.iter_mut().enumerate() {
            *mean = self.mean(&state_at(states, i))[0];
        }
    }
}

impl<const D: usize> ScalarSensing<D> for LinearSensor<D, 1> {
    fn mean_columns(&self, states: &Columns<'_, D>, means: &mut [f64]) {
        means.fill(0.0);
        for (entry, column) in self.matrix().iter().zip(states) {
            if *entry != 0.0 {
                for (mean, x) in means.iter_mut().zip(*column) {
                    *mean += entry * x;
                }
            }
        }
    }
}

impl<const D: usize> ScalarSensing<D> for ReceivedPower<D> {
    fn mean_columns(&self, states: &Columns<'_, D>, means: &mut [f64]) {
        self.amplitudes(states, means);
    }
}
