//! How the state is measured.

use crate::columns::{Columns, ColumnsMut, count, measurements_agree, set_state, state_at};
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Sensing with Gaussian noise, `z ~ N(h(x), R(x))`, `z` of `M` components.
///
/// Laws ([`crate::laws::sensing`]): `jacobian` is the derivative of `mean`, `mean_columns` writes what `mean` returns, and
/// `sample` has mean `h(x)` and covariance `R(x)`.
pub trait Sensing<const D: usize, const M: usize>: Send + Sync {
    /// Noise-free measurement `m = h(x)`.
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, M>;

    /// Jacobian of [`Sensing::mean`] at `state`.
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, D>;

    /// Noise covariance `R(x)`, positive definite.
    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, M>;

    /// Draws a measurement of `state`; NaN where the covariance is not positive definite.
    fn sample(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, M> {
        let lower = Cholesky::<f64, Const<M>>::new(self.noise_covariance_at(state)).map(|factor| factor.l());
        let normals = SVector::<f64, M>::from_fn(|_, _| rng.sample(StandardNormal));
        self.mean(state) + lower.unwrap_or_else(|| SMatrix::repeat(f64::NAN)) * normals
    }

    /// Periods of the components that are angles or the like, in the unit of the measurement; `None` for a number on the line.
    ///
    /// A component with a period may have any of its values `m + k period`, in `mean` as in a measurement: residuals are taken by the
    /// shorter way around ([`crate::circle`]). Without it a bearing that crosses from `pi` to `-pi` is off by a turn.
    fn periods(&self) -> [Option<f64>; M] {
        [None; M]
    }

    /// Writes the noise-free measurement of every state to `means`. Writes NaN everywhere if lengths differ
    /// ([`crate::columns::measurements_agree`]). Override it if a loop over columns is faster than single calls.
    fn mean_columns(&self, states: &Columns<'_, D>, mut means: ColumnsMut<'_, M>) {
        if measurements_agree(states, &mut means) {
            for i in 0..count(&means) {
                set_state(&mut means, i, &self.mean(&state_at(states, i)));
            }
        }
    }
}

/// Linear sensing `z = H x + n`, `n ~ N(0, R)`.
///
/// Law: `mean(x) = H x`, `jacobian(x) = H` and `noise_covariance_at(x) = R` for every `x`.
pub trait LinearSensing<const D: usize, const M: usize>: Sensing<D, M> {
    /// Measurement matrix `H`.
    fn matrix(&self) -> &SMatrix<f64, M, D>;

    /// Noise covariance `R`.
    fn noise_covariance(&self) -> &SMatrix<f64, M, M>;
}
