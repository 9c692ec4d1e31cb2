//! How the state changes from one time step to the next.
//!
//! Three traits, each a special case of the one before: Markov dynamics that can be sampled, Gaussian noise about a differentiable mean,
//! and linear Gaussian dynamics. An estimator requires the most general of them that it can work with.

use crate::columns::{ColumnsMut, change_each};
use crate::gaussian::Gaussian;
use fewbits_numerics::linalg::congruence;
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Markov dynamics `x_k ~ p(x_k | x_{k-1})`, over one step of fixed length.
///
/// Laws ([`crate::laws::dynamics`]): `propagate` has conditional mean [`Dynamics::mean`], and `propagate_columns` the same
/// law as `propagate`.
///
/// Object-safe: randomness comes from a `&mut dyn Rng`. A sweep over columns draws in blocks, so that the indirect call costs nothing.
pub trait Dynamics<const D: usize>: Send + Sync {
    /// Conditional mean `E[x_k | x_{k-1}]`.
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Draws `x_k` given `x_{k-1}`.
    fn propagate(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Propagates all states in place. Writes NaN everywhere if columns differ in length ([`crate::columns::columns_agree`]). Override it
    /// if a loop over columns is faster than single calls.
    fn propagate_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, D>) {
        change_each(states, |state| self.propagate(rng, &state));
    }
}

/// Dynamics with Gaussian noise about a smooth mean: `x_k ~ N(f(x_{k-1}), Q(x_{k-1}))`.
pub trait GaussianDynamics<const D: usize>: Dynamics<D> {
    /// Jacobian of [`Dynamics::mean`] at `state`.
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// Covariance `Q(state)` of the process noise in the step from `state`; may be singular.
    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// Time update of a Gaussian of mean `m`: mean `f(m)`, covariance `F P F' + noise_scale Q` with `F` and `Q` at `m`. With `noise_scale`
    /// 1 the model is used as stated.
    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        let jacobian = self.jacobian(belief.mean());
        let noise = self.noise_covariance_at(belief.mean()) * noise_scale;
        Gaussian::from_trusted_parts(self.mean(belief.mean()), congruence(&jacobian, belief.covariance()) + noise)
    }

    /// [`Dynamics::propagate_columns`] with `noise_scale Q` in place of `Q`. Override it if single draws are slow.
    fn propagate_columns_scaled(&self, rng: &mut dyn Rng, noise_scale: f64, states: ColumnsMut<'_, D>) {
        if noise_scale == 1.0 {
            self.propagate_columns(rng, states);
            return;
        }
        // The deviation of the draw from the mean is multiplied by the root of `noise_scale`.
        let stretch = noise_scale.sqrt();
        change_each(states, |state| {
            let mean = self.mean(&state);
            mean + (self.propagate(rng, &state) - mean) * stretch
        });
    }

    /// The models that dynamics with several models switch between; empty for all others.
    fn modes(&self) -> Vec<ScaledNoise<'_, D>> {
        Vec::new()
    }
}

impl<const D: usize, G: Dynamics<D> + ?Sized> Dynamics<D> for Box<G> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        (**self).mean(state)
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, D> {
        (**self).propagate(rng, state)
    }

    fn propagate_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, D>) {
        (**self).propagate_columns(rng, states);
    }
}

impl<const D: usize, G: GaussianDynamics<D> + ?Sized> GaussianDynamics<D> for Box<G> {
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        (**self).jacobian(state)
    }

    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        (**self).noise_covariance_at(state)
    }

    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        (**self).predict(belief, noise_scale)
    }

    fn propagate_columns_scaled(&self, rng: &mut dyn Rng, noise_scale: f64, states: ColumnsMut<'_, D>) {
        (**self).propagate_columns_scaled(rng, noise_scale, states);
    }

    fn modes(&self) -> Vec<ScaledNoise<'_, D>> {
        (**self).modes()
    }
}

/// Dynamics with the covariance of their process noise multiplied by a factor.
#[derive(Clone, Copy)]
pub struct ScaledNoise<'a, const D: usize> {
    dynamics: &'a dyn GaussianDynamics<D>,
    noise_scale: f64,
}

impl<'a, const D: usize> ScaledNoise<'a, D> {
    /// `dynamics` with `noise_scale Q` in place of `Q`.
    pub fn new(dynamics: &'a dyn GaussianDynamics<D>, noise_scale: f64) -> Self {
        Self { dynamics, noise_scale }
    }

    /// The same dynamics with a further factor.
    #[must_use]
    pub fn times(self, noise_scale: f64) -> Self {
        let noise_scale = self.noise_scale * noise_scale;
        Self { noise_scale, ..self }
    }
}

impl<const D: usize> Dynamics<D> for ScaledNoise<'_, D> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        self.dynamics.mean(state)
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, D> {
        let mean = self.mean(state);
        mean + (self.dynamics.propagate(rng, state) - mean) * self.noise_scale.sqrt()
    }

    fn propagate_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, D>) {
        self.dynamics.propagate_columns_scaled(rng, self.noise_scale, states);
    }
}

impl<const D: usize> GaussianDynamics<D> for ScaledNoise<'_, D> {
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.dynamics.jacobian(state)
    }

    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.dynamics.noise_covariance_at(state) * self.noise_scale
    }

    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        self.dynamics.predict(belief, self.noise_scale * noise_scale)
    }

    fn propagate_columns_scaled(&self, rng: &mut dyn Rng, noise_scale: f64, states: ColumnsMut<'_, D>) {
        self.dynamics
            .propagate_columns_scaled(rng, self.noise_scale * noise_scale, states);
    }

    fn modes(&self) -> Vec<ScaledNoise<'_, D>> {
        let modes = self.dynamics.modes().into_iter();
        modes.map(|mode| mode.times(self.noise_scale)).collect()
    }
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
