//! A sensing model applied to chosen coordinates of a larger state.

use crate::columns::{Columns, ColumnsMut};
use crate::sensing::Sensing;
use fewbits_numerics::ArgumentError;
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Sensing of `K` coordinates as sensing of a state of `D`: the model's coordinate `k` is coordinate `axes[k]` of the state.
///
/// Models order their coordinates differently: `[x, vx, y, vy]` or `[x, y, vx, vy]`. A sensing model that reads a position does not
/// know where it is in the state. This type states it once and checks it.
///
/// Law: `mean`, `jacobian` and noise are those of the model at `[state[axes[0]], .., state[axes[K-1]]]`; the Jacobian is zero elsewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnAxes<S, const D: usize, const K: usize> {
    sensing: S,
    axes: [usize; K],
}

impl<S, const D: usize, const K: usize> OnAxes<S, D, K> {
    /// `sensing` of the coordinates `axes` of a state of `D`, in the order in which the model reads them.
    ///
    /// # Errors
    /// If an axis is not below `D`, or is named twice.
    pub fn new(sensing: S, axes: [usize; K]) -> Result<Self, ArgumentError> {
        let twice = (0..K).any(|k| axes[..k].contains(&axes[k]));
        if twice || axes.iter().any(|axis| *axis >= D) {
            let expected = format!("different coordinates below {D}");
            return Err(ArgumentError::new("axes", format!("{axes:?}"), expected));
        }
        Ok(Self { sensing, axes })
    }

    fn read(&self, state: &SVector<f64, D>) -> SVector<f64, K> {
        SVector::from_fn(|k, _| state[self.axes[k]])
    }
}

impl<S: Sensing<K, M>, const D: usize, const K: usize, const M: usize> Sensing<D, M> for OnAxes<S, D, K> {
    #[inline]
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.sensing.mean(&self.read(state))
    }

    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, D> {
        let own = self.sensing.jacobian(&self.read(state));
        let mut jacobian = SMatrix::<f64, M, D>::zeros();
        for (k, axis) in self.axes.iter().enumerate() {
            // dm / dx_axis; the model does not depend on any other coordinate.
            jacobian.set_column(*axis, &own.column(k));
        }
        jacobian
    }

    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, M> {
        self.sensing.noise_covariance_at(&self.read(state))
    }

    fn sample(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.sensing.sample(rng, &self.read(state))
    }

    fn periods(&self) -> [Option<f64>; M] {
        self.sensing.periods()
    }

    fn mean_columns(&self, states: &Columns<'_, D>, means: ColumnsMut<'_, M>) {
        self.sensing.mean_columns(&self.axes.map(|axis| states[axis]), means);
    }
}
