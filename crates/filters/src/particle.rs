//! The bootstrap particle filter.

use crate::contract::{Info, StateFilter};
use crate::{Error, ResamplingRule};
use fewbits_core::{Columns, ColumnsMut, Dynamics, Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::Particles;
use fewbits_numerics::error::at_least_one;
use rand::Rng;

/// The particle filter whose proposal is the dynamics. Its belief is [`Particles`].
///
/// [`update`](StateFilter::update) leaves the belief weighted; the next [`predict`](Self::predict) resamples first. Mean, covariance and
/// effective sample size between the two are therefore those of the weighted particles, without the noise that resampling adds.
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
/// The dynamics need not be Gaussian. The buffers are part of the filter, so that a step does not allocate. They hold nothing that a
/// later step depends on. The bootstrap filter is due to Gordon, Salmond and Smith (1993).
#[derive(Debug, Clone)]
pub struct BootstrapFilter<const D: usize> {
    rule: ResamplingRule,
    count: usize,
    ancestors: Vec<u32>,
    /// The next belief is built here and replaces the old one when the step has succeeded.
    next: Option<Particles<D>>,
}

impl<const D: usize> BootstrapFilter<D> {
    /// The filter that starts with `count` particles.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn new(rule: ResamplingRule, count: usize) -> Result<Self, Error> {
        Ok(Self {
            rule,
            count: at_least_one("count", count)?,
            ancestors: Vec::new(),
            next: None,
        })
    }

    /// Resamples if the rule says so. Returns whether it did.
    ///
    /// # Errors
    /// As [`ResamplingRule::resample`].
    pub(crate) fn resample(&mut self, rng: &mut dyn Rng, belief: &mut Particles<D>) -> Result<bool, Error> {
        self.rule.resample(rng, belief, &mut self.ancestors)
    }

    /// Resamples if the rule says so, then draws the next state of every particle.
    ///
    /// # Errors
    /// As [`ResamplingRule::resample`].
    pub fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn Dynamics<D>,
        belief: &mut Particles<D>,
    ) -> Result<(), Error> {
        self.resample(rng, belief)?;
        dynamics.propagate_columns(rng, belief.columns_mut());
        Ok(())
    }

    /// One step in place by functions of all particles at once, which may fail: `change` draws the next states, `weigh` adds the log
    /// likelihoods of what was observed to the log weights. The model need not be Gaussian or differentiable, and needs no type.
    ///
    /// # Errors
    /// Those of the two functions, of [`ResamplingRule::resample`] and of [`update`](StateFilter::update). The belief is then as it was.
    pub fn step_by<E: From<Error>>(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut Particles<D>,
        change: impl FnOnce(&mut dyn Rng, ColumnsMut<'_, D>) -> Result<(), E>,
        weigh: impl FnOnce(Columns<'_, D>, &mut [f64]) -> Result<(), E>,
    ) -> Result<Info, E> {
        // Everything happens in a second buffer, so that the belief is unchanged if a later part fails.
        let next = self.next.get_or_insert_with(|| belief.clone());
        if self.rule.draw_ancestors(rng, belief, &mut self.ancestors) {
            next.select_from(belief, &self.ancestors)?;
        } else {
            next.clone_from(belief);
        }
        change(rng, next.columns_mut())?;
        let mut weighed = Ok(());
        let info = self::weigh(next, |states, logs| weighed = weigh(states, logs));
        // An error of the caller's comes before those of the weights that it left behind.
        weighed?;
        let info = info?;
        std::mem::swap(belief, next);
        Ok(info)
    }

    /// One step in place: [`predict`](Self::predict), then [`update`](StateFilter::update).
    ///
    /// # Errors
    /// As the two; the belief is then as it was before the step.
    pub fn step_in_place(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn Dynamics<D>,
        belief: &mut Particles<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        let change = |rng: &mut dyn Rng, states: ColumnsMut<'_, D>| {
            dynamics.propagate_columns(rng, states);
            Ok(())
        };
        self.step_by(rng, belief, change, |states, logs| {
            observed.add_log_likelihoods(states, logs);
            Ok(())
        })
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
        BootstrapFilter::predict(self, rng, dynamics, belief)
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Particles<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        weigh(belief, |states, logs| observed.add_log_likelihoods(states, logs))
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
