//! Particle filters: bootstrap, guided, auxiliary.

use crate::{Error, Resampling, Schedule};
use fewbits_core::{Dynamics, Likelihood};
use fewbits_densities::Particles;
use nalgebra::SVector;
use rand::Rng;

/// A particle filter: a resampling law and when to apply it. The belief it works on is [`Particles`].
///
/// A belief leaves [`update`](Self::update) weighted; resampling is the first thing the next [`predict`](Self::predict) does.
/// So every mean, covariance and effective sample size read between the two is that of the weighted particles, before the
/// noise that resampling adds.
///
/// ```text
/// predict:  if the effective sample size is due: ancestors ~ resampling law, equal weights
///           x_i ~ p(x_k | x_{k-1} = x_i)
/// update:   ln w_i += ln p(heard | x_i)
///           log-likelihood increment = ln sum_i w_i;  normalise
/// ```
/// The product of the increments' exponentials is an unbiased estimate of the likelihood of all that was heard, for every
/// resampling law (Del Moral 2004, theorem 7.4.2).
///
/// Source of the bootstrap filter: Gordon, Salmond and Smith (1993).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ParticleFilter {
    /// The law that draws ancestors.
    pub resampling: Resampling,
    /// When to draw them.
    pub schedule: Schedule,
}

/// Buffers that a filter reuses from step to step, so that a step does not allocate.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    ancestors: Vec<u32>,
    weights: Vec<f64>,
    ahead: Vec<f64>,
}

/// What an update learned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParticleInfo {
    /// Estimate of `ln p(heard now | heard before)`.
    pub log_likelihood: f64,
    /// Effective sample size of the updated belief.
    pub effective_sample_size: f64,
}

/// A proposal of the next state that has already looked at what was heard.
///
/// Law: with `(x', c) = propose(x)`, `E[f(x') exp(c)] = E[f(X') p(heard | X')]` for `X' ~ p(. | x)` and every bounded `f`:
/// `c = ln p(heard | x') + ln p(x' | x) - ln q(x' | x, heard)`.
pub trait Proposal<const D: usize> {
    /// Draws the next state and the logarithm of its importance weight.
    fn propose<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> (SVector<f64, D>, f64);
}

impl ParticleFilter {
    /// A filter with this law and schedule.
    pub fn new(resampling: Resampling, schedule: Schedule) -> Self {
        Self { resampling, schedule }
    }

    /// Resamples if due. Returns whether it did.
    ///
    /// # Errors
    /// None for a belief whose weights are normalised, as those of [`Particles`] are.
    pub fn resample<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &mut Particles<D>,
        workspace: &mut Workspace,
    ) -> Result<bool, Error> {
        if !self.schedule.is_due(belief.effective_sample_size(), belief.len()) {
            return Ok(false);
        }
        self.resample_to(rng, belief, belief.len(), workspace)?;
        Ok(true)
    }

    /// Resamples to `count` particles, due or not.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn resample_to<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &mut Particles<D>,
        count: usize,
        workspace: &mut Workspace,
    ) -> Result<(), Error> {
        workspace.ancestors.resize(count, 0);
        self.resampling
            .ancestors(rng, belief.weights(), &mut workspace.ancestors)?;
        Ok(belief.select(&workspace.ancestors)?)
    }

    /// Resamples if due and moves every particle by the dynamics.
    ///
    /// # Errors
    /// As [`resample`](Self::resample).
    pub fn predict<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        dynamics: &impl Dynamics<D>,
        belief: &mut Particles<D>,
        workspace: &mut Workspace,
    ) -> Result<(), Error> {
        self.resample(rng, belief, workspace)?;
        dynamics.propagate_columns(rng, belief.columns_mut());
        Ok(())
    }

    /// Weighs the belief by what was heard.
    ///
    /// # Errors
    /// [`Error::Density`] if what was heard is impossible for every particle; the belief is then as it was.
    pub fn update<const D: usize>(
        &self,
        heard: &(impl Likelihood<D> + ?Sized),
        belief: &mut Particles<D>,
    ) -> Result<ParticleInfo, Error> {
        let log_likelihood = belief.reweigh(|states, log_weights| heard.add_log_likelihoods(states, log_weights))?;
        Ok(ParticleInfo {
            log_likelihood,
            effective_sample_size: belief.effective_sample_size(),
        })
    }

    /// One bootstrap step in place: [`predict`](Self::predict), then [`update`](Self::update).
    ///
    /// # Errors
    /// As the two; after a failed update the belief is the predicted one.
    pub fn step_in_place<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        dynamics: &impl Dynamics<D>,
        heard: &(impl Likelihood<D> + ?Sized),
        belief: &mut Particles<D>,
        workspace: &mut Workspace,
    ) -> Result<ParticleInfo, Error> {
        self.predict(rng, dynamics, belief, workspace)?;
        self.update(heard, belief)
    }

    /// One bootstrap step from a belief to the next.
    ///
    /// # Errors
    /// As [`step_in_place`](Self::step_in_place).
    pub fn step<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        dynamics: &impl Dynamics<D>,
        belief: &Particles<D>,
        heard: &(impl Likelihood<D> + ?Sized),
    ) -> Result<(Particles<D>, ParticleInfo), Error> {
        let mut next = belief.clone();
        let info = self.step_in_place(rng, dynamics, heard, &mut next, &mut Workspace::default())?;
        Ok((next, info))
    }

    /// One guided step in place: particles move by a proposal that has seen what was heard.
    ///
    /// ```text
    /// if due: resample
    /// (x_i, c_i) = propose(x_i);  ln w_i += c_i;  increment = ln sum_i w_i;  normalise
    /// ```
    ///
    /// # Errors
    /// [`Error::Density`] if no particle is left any weight: the weights are then those before, at the proposed states.
    pub fn guided_step<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        proposal: &impl Proposal<D>,
        belief: &mut Particles<D>,
        workspace: &mut Workspace,
    ) -> Result<ParticleInfo, Error> {
        self.resample(rng, belief, workspace)?;
        let increments = &mut workspace.ahead;
        increments.clear();
        let columns = belief.columns_mut();
        for i in 0..columns.first().map_or(0, |column| column.len()) {
            let (next, increment) = proposal.propose(rng, &SVector::from_fn(|d, _| columns[d][i]));
            for d in 0..D {
                columns[d][i] = next[d];
            }
            increments.push(increment);
        }
        let log_likelihood = belief.reweigh(|_, log_weights| add(log_weights, increments))?;
        Ok(ParticleInfo {
            log_likelihood,
            effective_sample_size: belief.effective_sample_size(),
        })
    }

    /// One auxiliary step in place (Pitt and Shephard 1999): ancestors are drawn with a look ahead at what was heard. The
    /// look-ahead is the likelihood at the mean of the next state; it resamples at every step, whatever the schedule.
    ///
    /// ```text
    /// g_i = p(heard | E[x_k | x_i]);  a_1..a_N ~ resampling law with weights w_i g_i
    /// x_j ~ p(x_k | x_{a_j});  w_j = p(heard | x_j) / g_{a_j}
    /// increment = ln sum_i w_i g_i + ln mean_j w_j;  normalise
    /// ```
    /// It pays where the likelihood is wide against the process noise; where the look-ahead is sharper than the likelihood of
    /// a moved particle the weights become heavy-tailed, and the bootstrap filter is the better one.
    ///
    /// # Errors
    /// [`Error::Density`] if what was heard is impossible; the belief is as it was if no look-ahead survives, and equally
    /// weighted at the moved states if no moved particle does.
    pub fn auxiliary_step<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        dynamics: &impl Dynamics<D>,
        heard: &(impl Likelihood<D> + ?Sized),
        belief: &mut Particles<D>,
        workspace: &mut Workspace,
    ) -> Result<ParticleInfo, Error> {
        let Workspace {
            ancestors,
            weights,
            ahead,
        } = workspace;
        let count = belief.len();
        let columns = belief.columns();
        ahead.clear();
        ahead.extend((0..count).map(|i| heard.log_likelihood(&dynamics.mean(&SVector::from_fn(|d, _| columns[d][i])))));
        let first = belief.reweigh(|_, log_weights| add(log_weights, ahead))?;
        ancestors.resize(count, 0);
        self.resampling.ancestors(rng, belief.weights(), ancestors)?;
        belief.select(ancestors)?;
        dynamics.propagate_columns(rng, belief.columns_mut());
        weights.clear();
        weights.extend(ancestors.iter().map(|a| -ahead[*a as usize]));
        let second = belief.reweigh(|states, log_weights| {
            add(log_weights, weights);
            heard.add_log_likelihoods(states, log_weights);
        })?;
        Ok(ParticleInfo {
            log_likelihood: first + second,
            effective_sample_size: belief.effective_sample_size(),
        })
    }
}

/// `a += b`.
fn add(a: &mut [f64], b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += b;
    }
}
