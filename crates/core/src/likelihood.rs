//! How likely what was observed is, for each state.

use crate::columns::{Columns, lengths_agree, state_at};
use crate::factor::Factor;
use crate::sensing::Sensing;
use nalgebra::SVector;

/// `ln p(observed | x)`: what any particle or grid filter needs.
///
/// A sensing model and a [`Factor`] compose into one ([`Observed`]); observations of one instant multiply (slices).
///
/// Laws ([`crate::laws::likelihood`]): finite or `-inf`, never NaN for a finite state; where the state is NaN it is NaN, or no more than
/// at any state of numbers; `add_log_likelihoods` adds what `log_likelihood` returns, to rounding, and where lengths differ all of
/// `log_weights` becomes NaN ([`crate::columns::lengths_agree`]).
pub trait Likelihood<const D: usize> {
    /// `ln p(observed | state)`.
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64;

    /// Adds the log likelihood of every state of a cloud to `log_weights`. Override where a sweep is faster.
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

/// Independent observations of one instant: log likelihoods add.
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

/// Independent observations of one instant: log likelihoods add.
impl<const D: usize, L: Likelihood<D>> Likelihood<D> for Vec<L> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.as_slice().log_likelihood(state)
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        self.as_slice().add_log_likelihoods(states, log_weights);
    }
}

/// A factor seen through a sensing model: `p(observation | x) = p(observation | m = h(x))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observed<S, F, const M: usize> {
    /// The sensing model, `h`.
    pub sensing: S,
    /// What was observed of `h(x)`.
    pub factor: F,
}

impl<S, F, const M: usize> Observed<S, F, M> {
    /// `factor` seen through `sensing`.
    pub fn new(sensing: S, factor: F) -> Self {
        Self { sensing, factor }
    }
}

/// States swept at once, so that their measurements stay in the nearest cache.
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
