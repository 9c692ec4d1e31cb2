//! The likelihood of an observation as a function of the state.

use crate::columns::{Columns, lengths_agree, state_at};
use crate::factor::Factor;
use crate::sensing::Sensing;
use nalgebra::SVector;

/// `ln p(observed | x)`, as particle and grid filters need it.
///
/// A sensing model and a [`Factor`] together make one ([`Observed`]). A slice is the product of independent observations at one instant.
///
/// Laws ([`crate::laws::likelihood`]): the result is finite or `-inf` for a finite state. If the state has a NaN, it is NaN or at most the
/// smallest value at any state of numbers. `add_log_likelihoods` adds what `log_likelihood` returns, up to rounding. If lengths differ,
/// all of `log_weights` becomes NaN ([`crate::columns::lengths_agree`]).
pub trait Likelihood<const D: usize> {
    /// `ln p(observed | state)`.
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64;

    /// Adds the log likelihood of every state to `log_weights`. Override it if a sweep over columns is faster than single calls.
    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        if lengths_agree(&states, log_weights) {
            for (i, log_weight) in log_weights.iter_mut().enumerate() {
                *log_weight += self.log_likelihood(&state_at(&states, i));
            }
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

/// Independent observations at one instant: log likelihoods add.
impl<const D: usize, L: Likelihood<D>> Likelihood<D> for [L] {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.iter().map(|observed| observed.log_likelihood(state)).sum()
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        if lengths_agree(&states, log_weights) {
            for observed in self {
                observed.add_log_likelihoods(states, log_weights);
            }
        }
    }
}

/// Independent observations at one instant: log likelihoods add.
impl<const D: usize, L: Likelihood<D>> Likelihood<D> for Vec<L> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.as_slice().log_likelihood(state)
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        self.as_slice().add_log_likelihoods(states, log_weights);
    }
}

/// A factor composed with a sensing model `h`: `p(observation | x) = p(observation | m = h(x))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observed<S, F, const M: usize> {
    /// The sensing model, `h`.
    pub sensing: S,
    /// The likelihood of the observation as a function of `h(x)`.
    pub factor: F,
}

impl<S, F, const M: usize> Observed<S, F, M> {
    /// The likelihood of `factor` at the noise-free measurement of `sensing`.
    pub fn new(sensing: S, factor: F) -> Self {
        Self { sensing, factor }
    }
}

/// Number of states that are processed together, so that their measurements stay in the first-level cache.
const BLOCK: usize = 256;

impl<const D: usize, const M: usize, S: Sensing<D, M>, F: Factor<M>> Likelihood<D> for Observed<S, F, M> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.factor.log_likelihood(&self.sensing.mean(state))
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        if !lengths_agree(&states, log_weights) {
            return;
        }
        let mut means = [[0.0; BLOCK]; M];
        for (block, log_weights) in log_weights.chunks_mut(BLOCK).enumerate() {
            let (start, count) = (block * BLOCK, log_weights.len());
            let here: Columns<'_, D> = states.map(|column| &column[start..start + count]);
            self.sensing
                .mean_columns(&here, means.each_mut().map(|column| &mut column[..count]));
            self.factor
                .add_log_likelihoods(&means.each_ref().map(|column| &column[..count]), log_weights);
        }
    }
}
