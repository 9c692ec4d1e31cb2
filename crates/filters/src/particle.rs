//! Particle filters: bootstrap, guided, auxiliary.

use crate::{Error, Resampling, Schedule};
use fewbits_core::columns::state_at;
use fewbits_core::{Columns, Dynamics, Likelihood};
use fewbits_densities::Particles;
use nalgebra::SVector;
use rand::Rng;
use serde::{Deserialize, Serialize};

/// A particle filter: a resampling law and when to apply it. The belief it works on is [`Particles`].
///
/// A belief leaves [`update`](Self::update) weighted; resampling is the first thing the next [`predict`](Self::predict) does.
/// So every mean, covariance and effective sample size read between the two is that of the weighted particles, before the
/// noise that resampling adds.
///
/// ```text
/// predict:  if the effective sample size is due: ancestors ~ resampling law, equal weights
///           x_i ~ p(x_k | x_{k-1} = x_i)
/// update:   ln w_i += ln p(observed | x_i)
///           log-likelihood increment = ln sum_i w_i;  normalise
/// ```
/// The product of the increments' exponentials is an unbiased estimate of the likelihood of all that was observed, for every
/// resampling law (Del Moral 2004, theorem 7.4.2).
///
/// Source of the bootstrap filter: Gordon, Salmond and Smith (1993).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleFilter {
    /// The law that draws ancestors.
    pub resampling: Resampling,
    /// When to draw them.
    pub schedule: Schedule,
}

/// Buffers that a filter reuses from step to step, so that a step does not allocate.
///
/// The next belief is built here and takes the place of the old one when the step has succeeded.
#[derive(Debug, Clone, Default)]
pub struct Workspace<const D: usize> {
    ancestors: Vec<u32>,
    logs: Vec<f64>,
    next: Option<Particles<D>>,
}

/// What an update learned.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ParticleInfo {
    /// Estimate of `ln p(observed now | observed before)`.
    pub log_likelihood: f64,
    /// Effective sample size of the updated belief.
    pub effective_sample_size: f64,
}

/// A proposal of the next state that has already looked at what was observed.
///
/// Law: with `(x', c) = propose(x)`, `E[f(x') exp(c)] = E[f(X') p(observed | X')]` for `X' ~ p(. | x)` and every bounded `f`:
/// `c = ln p(observed | x') + ln p(x' | x) - ln q(x' | x, observed)`.
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
    /// None: the weights of [`Particles`] are normalised.
    pub fn resample<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &mut Particles<D>,
        workspace: &mut Workspace<D>,
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
        workspace: &mut Workspace<D>,
    ) -> Result<(), Error> {
        workspace.ancestors.resize(count, 0);
        self.resampling
            .ancestors_of_normalised(rng, belief.weights(), &mut workspace.ancestors);
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
        workspace: &mut Workspace<D>,
    ) -> Result<(), Error> {
        self.resample(rng, belief, workspace)?;
        dynamics.propagate_columns(rng, belief.columns_mut());
        Ok(())
    }

    /// Weighs the belief by what was observed.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if what was observed is impossible for every particle; the belief is then as it was.
    pub fn update<const D: usize>(
        &self,
        belief: &mut Particles<D>,
        observed: &(impl Likelihood<D> + ?Sized),
    ) -> Result<ParticleInfo, Error> {
        weigh(belief, |states, log_weights| observed.add_log_likelihoods(states, log_weights))
    }

    /// One bootstrap step from a belief to the next: [`predict`](Self::predict), then [`update`](Self::update).
    ///
    /// # Errors
    /// As the two.
    pub fn step<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        dynamics: &impl Dynamics<D>,
        belief: &Particles<D>,
        observed: &(impl Likelihood<D> + ?Sized),
    ) -> Result<(Particles<D>, ParticleInfo), Error> {
        let mut next = belief.clone();
        let info = self.step_in_place(rng, dynamics, &mut next, observed, &mut Workspace::default())?;
        Ok((next, info))
    }

    /// The same in place.
    ///
    /// # Errors
    /// As [`step`](Self::step); the belief is then as it was before the step.
    pub fn step_in_place<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        dynamics: &impl Dynamics<D>,
        belief: &mut Particles<D>,
        observed: &(impl Likelihood<D> + ?Sized),
        workspace: &mut Workspace<D>,
    ) -> Result<ParticleInfo, Error> {
        let next = self.resampled(rng, belief, workspace)?;
        dynamics.propagate_columns(rng, next.columns_mut());
        let info = self.update(next, observed)?;
        std::mem::swap(belief, next);
        Ok(info)
    }

    /// A copy of the belief, resampled if due.
    fn resampled<'w, const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &Particles<D>,
        workspace: &'w mut Workspace<D>,
    ) -> Result<&'w mut Particles<D>, Error> {
        let Workspace { ancestors, next, .. } = workspace;
        let next = next.get_or_insert_with(|| belief.clone());
        if self.schedule.is_due(belief.effective_sample_size(), belief.len()) {
            ancestors.resize(belief.len(), 0);
            self.resampling
                .ancestors_of_normalised(rng, belief.weights(), ancestors);
            next.select_from(belief, ancestors)?;
        } else {
            next.clone_from(belief);
        }
        Ok(next)
    }

    /// One guided step in place: particles move by a proposal that has seen what was observed.
    ///
    /// ```text
    /// if due: resample
    /// (x_i, c_i) = propose(x_i);  ln w_i += c_i;  increment = ln sum_i w_i;  normalise
    /// ```
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if no particle is left any weight; the belief is then as it was.
    pub fn guided_step<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        proposal: &impl Proposal<D>,
        belief: &mut Particles<D>,
        workspace: &mut Workspace<D>,
    ) -> Result<ParticleInfo, Error> {
        let mut increments = std::mem::take(&mut workspace.logs);
        increments.clear();
        let next = self.resampled(rng, belief, workspace)?;
        let columns = next.columns_mut();
        for i in 0..columns.first().map_or(0, |column| column.len()) {
            let (state, increment) = proposal.propose(rng, &SVector::from_fn(|d, _| columns[d][i]));
            for d in 0..D {
                columns[d][i] = state[d];
            }
            increments.push(increment);
        }
        let info = weigh(next, |_, log_weights| add(log_weights, &increments));
        if info.is_ok() {
            std::mem::swap(belief, next);
        }
        workspace.logs = increments;
        info
    }

    /// One auxiliary step in place (Pitt and Shephard 1999): ancestors are drawn with a look ahead at what was observed. The
    /// look-ahead is the likelihood at the mean of the next state; it resamples at every step, whatever the schedule.
    ///
    /// ```text
    /// g_i = p(observed | E[x_k | x_i]);  a_1..a_N ~ resampling law with weights w_i g_i
    /// x_j ~ p(x_k | x_{a_j});  w_j = p(observed | x_j) / g_{a_j}
    /// increment = ln sum_i w_i g_i + ln mean_j w_j;  normalise
    /// ```
    /// It pays where the likelihood is wide against the process noise; where the look-ahead is sharper than the likelihood of
    /// a moved particle the weights become heavy-tailed, and the bootstrap filter is the better one.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if no look-ahead or no moved particle survives; the belief is then as it was.
    pub fn auxiliary_step<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        dynamics: &impl Dynamics<D>,
        belief: &mut Particles<D>,
        observed: &(impl Likelihood<D> + ?Sized),
        workspace: &mut Workspace<D>,
    ) -> Result<ParticleInfo, Error> {
        let Workspace { ancestors, logs, next } = workspace;
        let next = next.get_or_insert_with(|| belief.clone());
        let columns = belief.columns();
        logs.clear();
        logs.extend((0..belief.len()).map(|i| observed.log_likelihood(&dynamics.mean(&state_at(&columns, i)))));
        next.clone_from(belief);
        let first = next.reweigh(|_, log_weights| add(log_weights, logs))?;
        ancestors.resize(belief.len(), 0);
        self.resampling.ancestors_of_normalised(rng, next.weights(), ancestors);
        next.select_from(belief, ancestors)?;
        dynamics.propagate_columns(rng, next.columns_mut());
        let info = weigh(next, |states, log_weights| {
            for (log_weight, a) in log_weights.iter_mut().zip(&*ancestors) {
                *log_weight -= logs[*a as usize];
            }
            observed.add_log_likelihoods(states, log_weights);
        })?;
        std::mem::swap(belief, next);
        Ok(ParticleInfo {
            log_likelihood: first + info.log_likelihood,
            ..info
        })
    }
}

/// Edits the log weights and says what that tells.
///
/// # Errors
/// [`fewbits_core::Error::NotANumber`] if a particle left the range of numbers, whatever its weight: zero times infinity is NaN in every
/// moment. The belief is then as it was, as if [`Particles::reweigh`] fails.
pub(crate) fn weigh<const D: usize>(
    belief: &mut Particles<D>,
    change: impl FnOnce(Columns<'_, D>, &mut [f64]),
) -> Result<ParticleInfo, Error> {
    let finite = |column: &&[f64]| column.iter().fold(true, |finite, x| finite & x.is_finite());
    if !belief.columns().iter().all(finite) {
        return Err(fewbits_core::Error::NotANumber { what: "a particle" }.into());
    }
    let log_likelihood = belief.reweigh(change)?;
    Ok(ParticleInfo {
        log_likelihood,
        effective_sample_size: belief.effective_sample_size(),
    })
}

/// `a += b`.
pub(crate) fn add(a: &mut [f64], b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += b;
    }
}
