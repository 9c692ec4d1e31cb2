//! How the world moves, how it is sensed, and how likely a message is.
//!
//! The traits are small and static: an estimator is generic over them and the compiler sees through. A state is an
//! `SVector<f64, D>`; a cloud of states is `D` contiguous columns, one a coordinate, so that inner loops vectorise.

use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Borrowed structure-of-arrays states: `columns[d][i]` is coordinate `d` of state `i`.
pub type Columns<'a, const D: usize> = [&'a [f64]; D];

/// Mutable structure-of-arrays states.
pub type ColumnsMut<'a, const D: usize> = [&'a mut [f64]; D];

/// State `i` of a structure of arrays.
#[inline]
pub fn state_at<const D: usize>(columns: &Columns<'_, D>, i: usize) -> SVector<f64, D> {
    SVector::from_fn(|d, _| columns[d][i])
}

/// Markov dynamics `x_k = f(x_{k-1}) + noise`, over one step of fixed length.
///
/// Law: `propagate` has conditional mean [`Dynamics::mean`], and `propagate_columns` the same law as `propagate`.
pub trait Dynamics<const D: usize> {
    /// Conditional mean `E[x_k | x_{k-1}]`.
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Draws `x_k` given `x_{k-1}`.
    fn propagate<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Propagates a whole cloud in place, in index order. Override where a loop over columns is faster.
    fn propagate_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let count = states.first().map_or(0, |column| column.len());
        for i in 0..count {
            let next = self.propagate(rng, &SVector::from_fn(|d, _| states[d][i]));
            for d in 0..D {
                states[d][i] = next[d];
            }
        }
    }
}

/// Dynamics with additive Gaussian noise and a known Jacobian: what an extended Kalman filter needs.
pub trait GaussianDynamics<const D: usize>: Dynamics<D> {
    /// Jacobian of [`Dynamics::mean`] at `state`.
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// Covariance of the process noise.
    fn noise_covariance(&self) -> &SMatrix<f64, D, D>;
}

/// Linear Gaussian dynamics `x_k = F x_{k-1} + u_k`, `u ~ N(0, Q)`: what a Kalman filter needs.
pub trait LinearDynamics<const D: usize>: Dynamics<D> {
    /// Transition matrix `F`.
    fn transition(&self) -> &SMatrix<f64, D, D>;

    /// Process-noise covariance `Q`, possibly singular.
    fn noise_covariance(&self) -> &SMatrix<f64, D, D>;
}

/// Sensing with additive Gaussian noise, `z = h(x) + n`, `n ~ N(0, R)`, `z` of `M` components.
pub trait Sensing<const D: usize, const M: usize> {
    /// Noise-free measurement `h(x)`.
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, M>;

    /// Jacobian of [`Sensing::mean`] at `state`.
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, D>;

    /// Noise covariance `R`, positive definite.
    fn noise_covariance(&self) -> &SMatrix<f64, M, M>;

    /// Draws a measurement of `state`.
    fn sample<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> SVector<f64, M>;
}

/// Linear sensing `z = H x + n`.
pub trait LinearSensing<const D: usize, const M: usize>: Sensing<D, M> {
    /// Measurement matrix `H`.
    fn matrix(&self) -> &SMatrix<f64, M, D>;
}

/// How likely one heard thing (value, bit, cell, silence, ...) is under each state: `ln p(heard | x)`.
///
/// This is the hinge of the library: any filter that takes a `Likelihood` can hear any message. Constants that do not
/// depend on the state may be dropped only if the documentation of the implementation says so.
///
/// Law: `add_log_likelihoods` adds what `log_likelihood` returns, to rounding.
pub trait Likelihood<const D: usize> {
    /// `ln p(heard | state)`: finite or `-inf`, never NaN for a finite state.
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64;

    /// Adds the log likelihood of every state of a cloud to `log_weights`. Override where a loop over columns is faster.
    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        for (i, log_weight) in log_weights.iter_mut().enumerate() {
            *log_weight += self.log_likelihood(&state_at(&states, i));
        }
    }
}

impl<const D: usize, L: Likelihood<D> + ?Sized> Likelihood<D> for &L {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        (**self).log_likelihood(state)
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        (**self).add_log_likelihoods(states, log_weights);
    }
}

/// Several independent things heard at once: log likelihoods add.
impl<const D: usize, L: Likelihood<D>> Likelihood<D> for [L] {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.iter().map(|heard| heard.log_likelihood(state)).sum()
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        for heard in self {
            heard.add_log_likelihoods(states, log_weights);
        }
    }
}
