//! How the state changes from one time step to the next.
//!
//! Three traits, each a special case of the one before: Markov dynamics that can be sampled, Gaussian noise about a differentiable mean,
//! and linear Gaussian dynamics. An estimator requires the most general of them that it can work with.

use crate::columns::{ColumnsMut, change_each};
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Markov dynamics `x_k ~ p(x_k | x_{k-1})`, over one step of fixed length.
///
/// Laws ([`crate::laws::dynamics`]): `propagate` has conditional mean [`Dynamics::mean`], and `propagate_columns` the same
/// law as `propagate`.
pub trait Dynamics<const D: usize> {
    /// Conditional mean `E[x_k | x_{k-1}]`.
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Draws `x_k` given `x_{k-1}`.
    fn propagate<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Propagates all states in place. Writes NaN everywhere if columns differ in length ([`crate::columns::columns_agree`]). Override it
    /// if a loop over columns is faster than single calls.
    fn propagate_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        change_each(states, |state| self.propagate(rng, &state));
    }
}

/// Dynamics with Gaussian noise about a smooth mean: `x_k ~ N(f(x_{k-1}), Q(x_{k-1}))`.
pub trait GaussianDynamics<const D: usize>: Dynamics<D> {
    /// Jacobian of [`Dynamics::mean`] at `state`.
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// Covariance `Q(state)` of the process noise in the step from `state`; may be singular.
    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D>;
}

/// Linear Gaussian dynamics `x_k = F x_{k-1} + u_k`, `u ~ N(0, Q)`: what a Kalman filter needs.
///
/// Law: `mean(x) = F x`, `jacobian(x) = F` and `noise_covariance_at(x) = Q` for every `x`.
pub trait LinearDynamics<const D: usize>: GaussianDynamics<D> {
    /// Transition matrix `F`.
    fn transition(&self) -> &SMatrix<f64, D, D>;

    /// Process-noise covariance `Q`, possibly singular.
    fn noise_covariance(&self) -> &SMatrix<f64, D, D>;
}
