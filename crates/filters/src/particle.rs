//! The bootstrap particle filter.

use crate::contract::{Info, StateFilter};
use crate::{Error, Resampling, Schedule};
use fewbits_core::{Columns, Dynamics, Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::Particles;
use fewbits_numerics::error::at_least_one;
use rand::Rng;
use serde::{Deserialize, Serialize};

/// A particle filter, given by a resampling law and the schedule of resampling. Its belief is [`Particles`].
///
/// [`update`](Self::update) leaves the belief weighted; the next [`predict`](Self::predict) resamples first. Mean, covariance and effective
/// sample size between the two are therefore those of the weighted particles, without the noise that resampling adds.
///
/// ```text
/// predict:  if the effective sample size is below the threshold: ancestors by the resampling law, equal weights
///           x_i ~ p(x_k | x_{k-1} = x_i)
/// update:   ln w_i += ln p(observed | x_i)
///           log-likelihood increment = ln sum_i w_i;  normalise
/// ```
/// The product of the exponentials of all `log_likelihood`s is an unbiased estimate of the likelihood of the data, for every
/// resampling law (Del Moral 2004, theorem 7.4.2).
///
/// The bootstrap filter is due to Gordon, Salmond and Smith (1993).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleFilter {
    /// The law that draws ancestors.
    pub resampling: Resampling,
    /// When to resample.
    pub schedule: Schedule,
}

/// Buffers that are reused from step to step, so that a step does not allocate.
///
/// The next belief is built here and replaces the old one when the step has succeeded.
#[derive(Debug, Clone, Default)]
pub struct Workspace<const D: usize> {
    ancestors: Vec<u32>,
    next: Option<Particles<D>>,
}

impl ParticleFilter {
    /// A filter with this law and schedule.
    pub fn new(resampling: Resampling, schedule: Schedule) -> Self {
        Self { resampling, schedule }
    }

    /// Resamples if the schedule says so. Returns whether it did.
    ///
    /// # Errors
    /// Not in practice: the weights of [`Particles`] are always normalised.
    pub fn resample<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &mut Particles<D>,
        workspace: &mut Workspace<D>,
    ) -> Result<bool, Error> {
        let is_due = self.draw_ancestors(rng, belief, &mut workspace.ancestors);
        if is_due {
            belief.select(&workspace.ancestors)?;
        }
        Ok(is_due)
    }

    /// Draws an ancestor of each particle if the schedule says so. Returns whether it did.
    fn draw_ancestors<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &Particles<D>,
        ancestors: &mut Vec<u32>,
    ) -> bool {
        let is_due = self.schedule.is_due(belief.effective_sample_size(), belief.len());
        if is_due {
            ancestors.resize(belief.len(), 0);
            self.resampling
                .ancestors_of_normalised(rng, belief.weights(), ancestors);
        }
        is_due
    }

    /// Resamples if the schedule says so, then draws the next state of every particle.
    ///
    /// # Errors
    /// As [`resample`](Self::resample).
    pub fn predict<const D: usize, R: Rng>(
        &self,
        rng: &mut R,
        dynamics: &(impl Dynamics<D> + ?Sized),
        belief: &mut Particles<D>,
        workspace: &mut Workspace<D>,
    ) -> Result<(), Error> {
        self.resample(rng, belief, workspace)?;
        dynamics.propagate_columns(rng, belief.columns_mut());
        Ok(())
    }

    /// Multiplies the weights by the likelihood of the observation.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observation has probability zero for every particle; the belief is then unchanged.
    pub fn update<const D: usize>(
        &self,
        belief: &mut Particles<D>,
        observed: &(impl Likelihood<D> + ?Sized),
    ) -> Result<Info, Error> {
        weigh(belief, |states, log_weights| observed.add_log_likelihoods(states, log_weights))
    }

    /// One bootstrap step in place: [`predict`](Self::predict), then [`update`](Self::update).
    ///
    /// # Errors
    /// As [`predict`](Self::predict) and [`update`](Self::update); the belief is then as it was before the step.
    pub fn step_in_place<const D: usize, R: Rng>(
        &self,
        rng: &mut R,
        dynamics: &(impl Dynamics<D> + ?Sized),
        belief: &mut Particles<D>,
        observed: &(impl Likelihood<D> + ?Sized),
        workspace: &mut Workspace<D>,
    ) -> Result<Info, Error> {
        // Everything happens in a second buffer, so that the belief is unchanged if a later part fails.
        let Workspace { ancestors, next } = workspace;
        let next = next.get_or_insert_with(|| belief.clone());
        if self.draw_ancestors(rng, belief, ancestors) {
            next.select_from(belief, ancestors)?;
        } else {
            next.clone_from(belief);
        }
        dynamics.propagate_columns(rng, next.columns_mut());
        let info = self.update(next, observed)?;
        std::mem::swap(belief, next);
        Ok(info)
    }
}

/// Edits the log weights by `change` and returns the log likelihood and the effective sample size.
///
/// # Errors
/// [`Error::NotANumber`] if a coordinate of a particle is not finite, even if its weight is zero: zero times infinity is NaN
/// in every moment. Errors of [`Particles::reweigh`]. The belief is then unchanged.
pub(crate) fn weigh<const D: usize>(
    belief: &mut Particles<D>,
    change: impl FnOnce(Columns<'_, D>, &mut [f64]),
) -> Result<Info, Error> {
    // Without an early exit the test runs in vector registers.
    let finite = |column: &&[f64]| column.iter().fold(true, |finite, x| finite & x.is_finite());
    if !belief.columns().iter().all(finite) {
        return Err(Error::NotANumber { what: "a particle" });
    }
    let log_likelihood = belief.reweigh(change)?;
    Ok(Info {
        log_likelihood,
        effective_sample_size: Some(belief.effective_sample_size()),
    })
}

/// [`ParticleFilter`] with dynamics as proposal (bootstrap) and a number of particles, as a [`StateFilter`].
#[derive(Debug, Clone)]
pub struct BootstrapFilter<const D: usize> {
    filter: ParticleFilter,
    count: usize,
    workspace: Workspace<D>,
}

impl<const D: usize> BootstrapFilter<D> {
    /// The filter with `count` particles.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn new(filter: ParticleFilter, count: usize) -> Result<Self, Error> {
        Ok(Self {
            filter,
            count: at_least_one("count", count)?,
            workspace: Workspace::default(),
        })
    }

    /// Resamples if the schedule says so.
    pub(crate) fn resample(&mut self, mut rng: &mut dyn Rng, belief: &mut Particles<D>) -> Result<(), Error> {
        self.filter.resample(&mut rng, belief, &mut self.workspace)?;
        Ok(())
    }
}

impl<const D: usize> StateFilter<D> for BootstrapFilter<D> {
    type Belief = Particles<D>;

    fn points(&self, belief: &Particles<D>) -> Option<crate::Points<D>> {
        Some(crate::Points {
            states: belief.columns().map(<[f64]>::to_vec),
            log_weights: belief.log_weights().to_vec(),
        })
    }

    fn start(&mut self, mut rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Particles<D>, Error> {
        Particles::from_belief(&mut rng, prior, self.count)
    }

    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut Particles<D>,
    ) -> Result<(), Error> {
        self.resample(rng, belief)?;
        dynamics.propagate_columns(rng, belief.columns_mut());
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Particles<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        self.filter.update(belief, observed)
    }
}
