//! Traits of filters at a receiver: a time update, and one measurement update for all observations of one instant.
//!
//! Models, sensors and observations are object-safe, so that different kinds can be in one list.
//! The table of the [crate] lists the filters by task.

use crate::Error;
use fewbits_core::{Belief, Gaussian, GaussianDynamics, Likelihood};
use rand::Rng;

/// The time update of a Gaussian, if its moments are numbers.
pub(crate) fn predicted<const D: usize>(
    dynamics: &dyn GaussianDynamics<D>,
    belief: &Gaussian<D>,
) -> Result<Gaussian<D>, Error> {
    let what = "the predicted belief (from the process noise)";
    let found = Some(dynamics.predict(belief, 1.0));
    found.filter(Gaussian::is_finite).ok_or(Error::NotANumber { what })
}

/// Results of an update other than the new belief.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Info {
    /// `ln p(all observations of the instant | past)`.
    pub log_likelihood: f64,
    /// Effective sample size, of filters with particles.
    pub effective_sample_size: Option<f64>,
}

impl Info {
    pub(crate) fn new(log_likelihood: f64) -> Self {
        Self {
            log_likelihood,
            effective_sample_size: None,
        }
    }
}

/// A belief as weighted points.
#[derive(Debug, Clone, PartialEq)]
pub struct Points<const D: usize> {
    /// `states[d][i]` is coordinate `d` of point `i`.
    pub states: [Vec<f64>; D],
    /// Logarithm of the weight of each point, up to a common constant; `-inf` for a weight of zero.
    pub log_weights: Vec<f64>,
}

impl<const D: usize> Points<D> {
    /// The coordinates as columns.
    pub(crate) fn columns(&self) -> fewbits_core::Columns<'_, D> {
        self.states.each_ref().map(Vec::as_slice)
    }
}

/// A filter for a receiver. Both updates work in place; one that fails leaves the belief unchanged.
pub trait StateFilter<const D: usize> {
    /// Representation of the belief.
    type Belief: Belief<D> + Clone;

    /// The belief before the first update.
    ///
    /// # Errors
    /// If the prior cannot be represented.
    fn start(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Self::Belief, Error>;

    /// The belief for a new start after the track of `lost` was given up. What `lost` has learnt about the model may be kept.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    fn restart(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>, _lost: &Self::Belief) -> Result<Self::Belief, Error> {
        self.start(rng, prior)
    }

    /// Time update. A receiver that learns the process noise passes [`ScaledNoise`](fewbits_core::ScaledNoise).
    ///
    /// # Errors
    /// If the filter cannot represent the prediction.
    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut Self::Belief,
    ) -> Result<(), Error>;

    /// Measurement update with all observations of one instant.
    ///
    /// # Errors
    /// [`Error::Impossible`] if they have probability zero together under the belief.
    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut Self::Belief,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error>;

    /// The belief with these moments, if [`update`](Self::update) does no more than [`Likelihood::condition`] on one observation after
    /// the other. `None` for other filters. A centre conditions on the observations in any case, to test each given those before it; with
    /// this function it need not do so twice.
    fn of_moments(&self, _: &Gaussian<D>) -> Option<Self::Belief> {
        None
    }

    /// The points of the belief, if it consists of points whose weights are all that an update changes. A centre then tests reports by the
    /// filter's own law, not by that of a Gaussian of its moments.
    fn points(&self, _: &Self::Belief) -> Option<Points<D>> {
        None
    }

    /// The belief as a mixture of Gaussians with the logarithms of their weights, up to a common constant, if an update conditions each
    /// ([`Likelihood::condition`]) and weighs it by its evidence. A centre then tests reports by this law.
    fn mixture(&self, _: &Self::Belief) -> Option<Vec<(f64, Gaussian<D>)>> {
        None
    }

    /// One step from a belief to the next: [`predict`](Self::predict), then [`update`](Self::update).
    ///
    /// # Errors
    /// If [`predict`](Self::predict) or [`update`](Self::update) fails.
    fn step(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &Self::Belief,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<(Self::Belief, Info), Error> {
        let mut next = belief.clone();
        self.predict(rng, dynamics, &mut next)?;
        let info = self.update(rng, &mut next, observed)?;
        Ok((next, info))
    }
}

/// The filter of [`assumed_density`](crate::assumed_density); with values it is the extended Kalman filter. Observations of one instant are processed one after
/// the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MomentFilter;

impl<const D: usize> StateFilter<D> for MomentFilter {
    type Belief = Gaussian<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Gaussian<D>, Error> {
        Ok(*prior)
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut Gaussian<D>,
    ) -> Result<(), Error> {
        *belief = predicted(dynamics, belief)?;
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Gaussian<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        Ok(Info::new(observed.condition(belief)?.log_likelihood))
    }

    fn of_moments(&self, moments: &Gaussian<D>) -> Option<Gaussian<D>> {
        Some(*moments)
    }
}
