//! Traits of filters at a receiver: a time update, and one measurement update for all observations of one instant.
//!
//! Models, sensors and observations are object-safe, so that different kinds can be in one list.
//! The table of the [crate] lists the filters by task.

use crate::{Error, assumed_density};
use fewbits_core::factor::Scalar;
use fewbits_core::{Belief, ColumnsMut, Evolution, Factor, Gaussian, GaussianDynamics, Likelihood, Observed, Sensing};
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Dynamics over a fixed time as filters use them: an object-safe form of [`GaussianDynamics`].
///
/// `noise_scale` multiplies the covariance of the process noise; with 1 the model is used as stated.
pub trait Motion<const D: usize> {
    /// Mean of the next state.
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Time update of a Gaussian: mean `f(m)`, covariance `F P F' + noise_scale Q` with `F` and `Q` at the mean `m`.
    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D>;

    /// Replaces every state by an independent draw of its next state.
    fn move_columns(&self, rng: &mut dyn Rng, noise_scale: f64, states: ColumnsMut<'_, D>);

    /// The models of a switching motion; empty for all others.
    fn modes(&self) -> &[Box<dyn Motion<D>>] {
        &[]
    }
}

impl<const D: usize, G: GaussianDynamics<D>> Motion<D> for G {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        fewbits_core::Dynamics::mean(self, state)
    }

    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        assumed_density::predict_scaled(self, belief, noise_scale)
    }

    fn move_columns(&self, rng: &mut dyn Rng, noise_scale: f64, states: ColumnsMut<'_, D>) {
        if noise_scale == 1.0 {
            self.propagate_columns(rng, states);
            return;
        }
        // The deviation of the draw from the mean is multiplied by the root of `noise_scale`.
        let stretch = noise_scale.sqrt();
        fewbits_core::columns::change_each(states, |state| {
            let mean = fewbits_core::Dynamics::mean(self, &state);
            mean + (self.propagate(rng, &state) - mean) * stretch
        });
    }
}

/// A motion, with a factor of its process-noise covariance.
#[derive(Clone, Copy)]
pub struct Move<'a, const D: usize> {
    /// The motion with its stated process noise.
    pub motion: &'a dyn Motion<D>,
    /// Factor of the covariance of the process noise; 1 for the motion as stated.
    pub noise_scale: f64,
}

impl<'a, const D: usize> Move<'a, D> {
    /// `motion` with this factor.
    pub fn new(motion: &'a dyn Motion<D>, noise_scale: f64) -> Self {
        Self { motion, noise_scale }
    }

    /// Time update of a Gaussian.
    pub fn predict(&self, belief: &Gaussian<D>) -> Gaussian<D> {
        self.motion.predict(belief, self.noise_scale)
    }

    /// Replaces every state by an independent draw of its next state.
    pub fn move_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, D>) {
        self.motion.move_columns(rng, self.noise_scale, states);
    }
}

/// Dynamics in continuous time as filters use them: an object-safe form of [`Evolution`].
pub trait Evolving<const D: usize> {
    /// The motion over `seconds`.
    ///
    /// # Errors
    /// If the time is negative or not finite.
    fn over(&self, seconds: f64) -> Result<Box<dyn Motion<D>>, Error>;
}

impl<const D: usize, E: Evolution<D>> Evolving<D> for E
where
    E::Step: 'static,
{
    fn over(&self, seconds: f64) -> Result<Box<dyn Motion<D>>, Error> {
        Ok(Box::new(Evolution::over(self, seconds)?))
    }
}

/// Result of one observation, for tests of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// `ln p(observation | past)`.
    pub log_likelihood: f64,
    /// Posterior minus prior mean of the first component of the noise-free measurement.
    pub correction: f64,
}

impl Evidence {
    fn new<const M: usize>(log_likelihood: f64, correction: &SVector<f64, M>) -> Self {
        Self {
            log_likelihood,
            correction: correction.iter().next().copied().unwrap_or(0.0),
        }
    }
}

/// The likelihood of one observation. It weighs particles and grids (as a [`Likelihood`]) and updates Gaussians.
pub trait StateLikelihood<const D: usize>: Likelihood<D> {
    /// Replaces a Gaussian by the one with the moments of the posterior. The sensing model is linearised at its mean.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observation has probability zero under the belief, which is then unchanged.
    fn condition(&self, belief: &mut Gaussian<D>) -> Result<Evidence, Error>;

    /// Log likelihood of the observation under a Gaussian, and the correction of the measurement.
    ///
    /// # Errors
    /// As [`condition`](Self::condition).
    fn evidence(&self, belief: &Gaussian<D>) -> Result<Evidence, Error>;

    /// `ln p(observation)`, if it is the same for every state (a loss, a silence without information); otherwise `None`.
    fn as_constant(&self) -> Option<f64>;

    /// Whether the likelihood depends on the coordinate `axis` in a neighbourhood of `state`.
    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool;

    /// The likelihood as a scalar factor of a linear measurement times a constant. Filters that impute measurements need it. `None` if
    /// the sensor is not linear about `state`, or the factor is of another kind.
    fn as_linear_scalar(&self, state: &SVector<f64, D>) -> Option<LinearScalar<D>>;
}

/// The likelihood `exp(log_scale) factor(h x)`, where the factor is that of a measurement `z = h x + w`, `w ~ N(0, r)`.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearScalar<const D: usize> {
    /// Direction `h`.
    pub matrix: SMatrix<f64, 1, D>,
    /// Noise variance `r`.
    pub noise_covariance: SMatrix<f64, 1, 1>,
    /// What was observed of `z`.
    pub factor: Scalar,
    /// Logarithm of the constant that multiplies the factor.
    pub log_scale: f64,
}

impl<const D: usize, const M: usize, S: Sensing<D, M>, F: Factor<M>> StateLikelihood<D> for Observed<S, F, M> {
    #[inline]
    fn condition(&self, belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        let (posterior, info) = assumed_density::update_through(belief, self)?;
        *belief = posterior;
        Ok(Evidence::new(info.log_likelihood, &info.correction))
    }

    fn evidence(&self, belief: &Gaussian<D>) -> Result<Evidence, Error> {
        let (log_likelihood, correction) = assumed_density::evidence_through(belief, self)?;
        Ok(Evidence::new(log_likelihood, &correction))
    }

    fn as_constant(&self) -> Option<f64> {
        match self.factor.as_scalar()? {
            (Scalar::Constant(factor), log_scale) => Some(factor.probability().ln() + log_scale),
            _ => None,
        }
    }

    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool {
        let jacobian: SMatrix<f64, M, D> = self.sensing.jacobian(state);
        jacobian.column(axis).iter().any(|x| *x != 0.0)
    }

    fn as_linear_scalar(&self, state: &SVector<f64, D>) -> Option<LinearScalar<D>> {
        let (factor, log_scale) = self.factor.as_scalar().filter(|_| M == 1)?;
        let jacobian = self.sensing.jacobian(state);
        let matrix = SMatrix::<f64, 1, D>::from_fn(|_, d| jacobian[(0, d)]);
        let (mean, noise) = (self.sensing.mean(state)[0], self.sensing.noise_covariance_at(state)[(0, 0)]);
        // An imputed measurement updates the state by `z - h x`, so the sensor must have no offset.
        let offset = (mean - (matrix * state)[0]).abs();
        let is_sensor = noise > 0.0 && noise.is_finite() && matrix.iter().all(|x| x.is_finite());
        (is_sensor && offset <= OFFSET * (mean.abs() + noise.sqrt())).then_some(LinearScalar {
            matrix,
            noise_covariance: [[noise]].into(),
            factor,
            log_scale,
        })
    }
}

/// Largest `h(x) - h'(x) x`, relative to `h(x)` and the noise deviation, that is treated as rounding of a linear sensor.
const OFFSET: f64 = 1e-9;

/// Conditions a Gaussian on observations, one after the other: the posterior, and `ln p(all observations)` by the chain rule.
pub(crate) fn condition_all<const D: usize>(
    belief: &Gaussian<D>,
    observed: &[&dyn StateLikelihood<D>],
) -> Result<(Gaussian<D>, f64), Error> {
    let (mut next, mut log_likelihood) = (*belief, 0.0);
    for one in observed {
        log_likelihood += one.condition(&mut next)?.log_likelihood;
    }
    Ok((next, log_likelihood))
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
    pub fn columns(&self) -> fewbits_core::Columns<'_, D> {
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

    /// Time update.
    ///
    /// # Errors
    /// If the filter cannot represent the prediction.
    fn predict(&mut self, rng: &mut dyn Rng, motion: Move<'_, D>, belief: &mut Self::Belief) -> Result<(), Error>;

    /// Measurement update with all observations of one instant.
    ///
    /// # Errors
    /// [`Error::Impossible`] if they have probability zero together under the belief.
    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut Self::Belief,
        observed: &[&dyn StateLikelihood<D>],
    ) -> Result<Info, Error>;

    /// The belief with these moments, if [`update`](Self::update) does no more than [`StateLikelihood::condition`] on one observation after
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
    /// ([`StateLikelihood::condition`]) and weighs it by its evidence. A centre then tests reports by this law.
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
        motion: &dyn Motion<D>,
        belief: &Self::Belief,
        observed: &[&dyn StateLikelihood<D>],
    ) -> Result<(Self::Belief, Info), Error> {
        let mut next = belief.clone();
        self.predict(rng, Move::new(motion, 1.0), &mut next)?;
        let info = self.update(rng, &mut next, observed)?;
        Ok((next, info))
    }
}

/// The filter of [`assumed_density`]; with values it is the extended Kalman filter. Observations of one instant are processed one after
/// the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MomentFilter;

impl<const D: usize> StateFilter<D> for MomentFilter {
    type Belief = Gaussian<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Gaussian<D>, Error> {
        Ok(*prior)
    }

    fn predict(&mut self, _: &mut dyn Rng, motion: Move<'_, D>, belief: &mut Gaussian<D>) -> Result<(), Error> {
        *belief = motion.predict(belief);
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Gaussian<D>,
        observed: &[&dyn StateLikelihood<D>],
    ) -> Result<Info, Error> {
        let (next, log_likelihood) = condition_all(belief, observed)?;
        *belief = next;
        Ok(Info::new(log_likelihood))
    }

    fn of_moments(&self, moments: &Gaussian<D>) -> Option<Gaussian<D>> {
        Some(*moments)
    }
}
