//! The contract of filters at a receiver: a time update, and one measurement update for all that was observed at one instant.
//!
//! Models, sensors and observations are object-safe, so that any kinds stand in one list.
//! The table of the [crate] says which filter is for what.

use crate::{Error, assumed_density};
use fewbits_core::factor::Scalar;
use fewbits_core::{Belief, ColumnsMut, Evolution, Factor, Gaussian, GaussianDynamics, Likelihood, Observed, Sensing};
use fewbits_numerics::linalg::congruence;
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Dynamics over a fixed time as a filter sees them: [`GaussianDynamics`] without their types.
///
/// `noise_scale` multiplies the covariance of the process noise; 1 is the model as it was stated.
pub trait Motion<const D: usize> {
    /// Mean of the next state.
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D>;

    /// Moves a Gaussian: `f(m)`, `F P F' + noise_scale Q` with `F` and `Q` at the mean.
    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D>;

    /// Moves every state of a cloud by a draw of its own.
    fn move_columns(&self, rng: &mut dyn Rng, noise_scale: f64, states: ColumnsMut<'_, D>);

    /// The motions between which this one switches; empty for most.
    fn modes(&self) -> &[Box<dyn Motion<D>>] {
        &[]
    }
}

impl<const D: usize, G: GaussianDynamics<D>> Motion<D> for G {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        fewbits_core::Dynamics::mean(self, state)
    }

    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        let jacobian = self.jacobian(belief.mean());
        let noise = self.noise_covariance_at(belief.mean()) * noise_scale;
        let mean = fewbits_core::Dynamics::mean(self, belief.mean());
        Gaussian::from_trusted_parts(mean, congruence(&jacobian, belief.covariance()) + noise)
    }

    fn move_columns(&self, rng: &mut dyn Rng, noise_scale: f64, mut states: ColumnsMut<'_, D>) {
        if noise_scale == 1.0 {
            self.propagate_columns(rng, states);
            return;
        }
        // What a draw adds to the mean is stretched.
        let stretch = noise_scale.sqrt();
        for i in 0..fewbits_core::columns::count(&states) {
            let state = SVector::<f64, D>::from_fn(|d, _| states[d][i]);
            let mean = fewbits_core::Dynamics::mean(self, &state);
            let moved = mean + (self.propagate(rng, &state) - mean) * stretch;
            fewbits_core::columns::set_state(&mut states, i, &moved);
        }
    }
}

/// A motion whose process noise has its covariance multiplied by `noise_scale`.
#[derive(Clone, Copy)]
pub struct Move<'a, const D: usize> {
    /// The motion as it was stated.
    pub motion: &'a dyn Motion<D>,
    /// Factor of the covariance of the process noise; 1 is the motion as it was stated.
    pub noise_scale: f64,
}

impl<'a, const D: usize> Move<'a, D> {
    /// `motion` with this factor.
    pub fn new(motion: &'a dyn Motion<D>, noise_scale: f64) -> Self {
        Self { motion, noise_scale }
    }

    /// Moves a Gaussian.
    pub fn predict(&self, belief: &Gaussian<D>) -> Gaussian<D> {
        self.motion.predict(belief, self.noise_scale)
    }
}

/// A world that moves in continuous time as a filter sees it: [`Evolution`] without its types.
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

/// What one observation says about the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// `ln p(observation | past)`.
    pub log_likelihood: f64,
    /// Mean of the first component of the noise-free measurement after the observation, minus before.
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

/// What one observation says about the state: weighs clouds and grids ([`Likelihood`]), conditions Gaussians.
pub trait StateLikelihood<const D: usize>: Likelihood<D> {
    /// Replaces a Gaussian by that with the moments of the posterior, the sensing linearised at its mean.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observation has probability zero under the belief, which is then as it was.
    fn condition(&self, belief: &mut Gaussian<D>) -> Result<Evidence, Error>;

    /// How likely the observation is under a Gaussian, and where it moves the measurement.
    ///
    /// # Errors
    /// As [`condition`](Self::condition).
    fn evidence(&self, belief: &Gaussian<D>) -> Result<Evidence, Error>;

    /// `ln p(observation)`, if it is the same for every state: a loss, a silence that says nothing.
    fn as_constant(&self) -> Option<f64>;

    /// Whether the likelihood depends on this coordinate, near this state.
    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool;

    /// As a scalar factor seen through a linear sensor, times `exp` of a number: what filters need that impute measurements. `None` if
    /// the sensor is not linear about `state`, or the factor is of another kind.
    fn as_linear_scalar(&self, state: &SVector<f64, D>) -> Option<LinearScalar<D>>;
}

/// A scalar factor of `z = h x + w`, `w ~ N(0, r)`, times `exp(log_scale)`.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearScalar<const D: usize> {
    /// `h`.
    pub matrix: SMatrix<f64, 1, D>,
    /// `r`.
    pub noise_covariance: SMatrix<f64, 1, 1>,
    /// What was observed of `z`.
    pub factor: Scalar,
    /// What multiplies the factor.
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

/// `h(x) - h'(x) x`, relative to `h(x)` and the noise's deviation, that counts as rounding of a linear sensor.
const OFFSET: f64 = 1e-9;

/// What an update reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Info {
    /// `ln p(all observations of the instant | past)`.
    pub log_likelihood: f64,
    /// Effective sample size, of particles.
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

/// A filter as a receiver needs it. Both updates work in place; one that fails leaves the belief as it was.
pub trait StateFilter<const D: usize> {
    /// What the filter knows.
    type Belief: Belief<D> + Clone;

    /// The belief before the first update.
    ///
    /// # Errors
    /// If the prior cannot be represented.
    fn start(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Self::Belief, Error>;

    /// The belief before the first update after `lost` has been given up. What `lost` has learnt of the model may be kept.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    fn restart(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>, _lost: &Self::Belief) -> Result<Self::Belief, Error> {
        self.start(rng, prior)
    }

    /// Time update.
    ///
    /// # Errors
    /// Those of the filter.
    fn predict(&mut self, rng: &mut dyn Rng, motion: Move<'_, D>, belief: &mut Self::Belief) -> Result<(), Error>;

    /// Takes in all observations of one instant.
    ///
    /// # Errors
    /// [`Error::Impossible`] if they have probability zero under the belief.
    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut Self::Belief,
        observed: &[&dyn StateLikelihood<D>],
    ) -> Result<Info, Error>;

    /// The belief of these moments, if conditioning on one observation after the other ([`StateLikelihood::condition`]) is all that
    /// [`update`](Self::update) does. `None` for other filters. A centre conditions to judge each observation by those before it, and
    /// then need not do so twice.
    fn of_moments(&self, _: &Gaussian<D>) -> Option<Self::Belief> {
        None
    }

    /// One step from a belief to the next: [`predict`](Self::predict), then [`update`](Self::update).
    ///
    /// # Errors
    /// As the two.
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

/// The filter of [`assumed_density`]: with values it is the extended Kalman filter. Observations of one instant are taken in one
/// after the other.
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
        let (mut next, mut log_likelihood) = (*belief, 0.0);
        for one in observed {
            log_likelihood += one.condition(&mut next)?.log_likelihood;
        }
        *belief = next;
        Ok(Info::new(log_likelihood))
    }

    fn of_moments(&self, moments: &Gaussian<D>) -> Option<Gaussian<D>> {
        Some(*moments)
    }
}
