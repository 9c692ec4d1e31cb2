//! The likelihood of an observation as a function of the state.

use crate::assumed_density;
use crate::columns::{Columns, ColumnsMut, lengths_agree, state_at};
use crate::error::Error;
use crate::factor::{Factor, Scalar};
use crate::gaussian::Gaussian;
use crate::observed::Observed;
use crate::points;
use crate::sensing::Sensing;
use crate::value_update;
use fewbits_numerics::error::refuse;
use nalgebra::{SMatrix, SVector};
use std::ops::Deref;

/// The likelihood of an observation, `ln p(observed | x)`: it weighs particles and grids, and updates Gaussians where it can. Object-safe.
///
/// A sensing model and a [`Factor`] together make one ([`Observed`]). A slice is the product of independent observations at one instant.
/// A likelihood that only weighs implements `log_likelihood` alone: filters of Gaussians refuse it, all others take it.
///
/// Laws ([`crate::laws::likelihood`]): the result is finite or `-inf` for a finite state. If the state has a NaN, it is NaN or at most the
/// smallest value at any state of numbers. `add_log_likelihoods` adds what `log_likelihood` returns, up to rounding. If lengths differ,
/// all of `log_weights` becomes NaN ([`crate::columns::lengths_agree`]).
pub trait Likelihood<const D: usize>: Send + Sync {
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

    /// Replaces a Gaussian by the one with the moments of the posterior. The sensing model is linearised at its mean.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observation has probability zero under the belief, which is then unchanged; by default: the
    /// likelihood only weighs.
    fn condition(&self, _belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        refuse(
            "likelihood",
            "one that only weighs",
            "one that updates Gaussians, or a filter of particles or on a grid",
        )
    }

    /// Moves points whose weights sum to one so that they have the moments of the posterior. A sensing model is regressed on the points
    /// instead of being linearised ([`points::move_measured_points`]); by default the points follow [`condition`](Self::condition) of their moments.
    ///
    /// # Errors
    /// As [`condition`](Self::condition), or if there is not one weight per point. The points are then unchanged.
    fn move_points(&self, mut states: ColumnsMut<'_, D>, weights: &[f64]) -> Result<Evidence, Error> {
        points::check(&mut states, weights)?;
        let before = points::moments(&states.each_ref().map(|column| &**column), weights);
        let mut after = before;
        let evidence = self.condition(&mut after)?;
        points::transport(states, &before, &after)?;
        Ok(evidence)
    }

    /// Log likelihood of the observation under a Gaussian, and the correction of the measurement.
    ///
    /// # Errors
    /// As [`condition`](Self::condition).
    fn evidence(&self, belief: &Gaussian<D>) -> Result<Evidence, Error> {
        self.condition(&mut belief.clone())
    }

    /// `ln p(observation)`, if it is the same for every state (a loss, a silence without information); otherwise `None`.
    fn as_constant(&self) -> Option<f64> {
        None
    }

    /// Whether the likelihood depends on the coordinate `axis` in a neighbourhood of `state`; by default it may.
    fn reads(&self, _state: &SVector<f64, D>, _axis: usize) -> bool {
        true
    }

    /// The likelihood as a scalar factor of a linear measurement. Filters that impute measurements need it. `None` if
    /// the sensor is not linear about `state`, or the factor is of another kind.
    fn as_linear_scalar(&self, _state: &SVector<f64, D>) -> Option<LinearScalar<D>> {
        None
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

/// The likelihood `factor(h x)`, where the factor is that of a measurement `z = h x + w`, `w ~ N(0, r)`.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearScalar<const D: usize> {
    /// Direction `h`.
    pub matrix: SMatrix<f64, 1, D>,
    /// Noise variance `r`.
    pub noise_covariance: SMatrix<f64, 1, 1>,
    /// What was observed of `z`.
    pub factor: Scalar,
}

/// References, boxes and vectors, as what they point to.
impl<const D: usize, P> Likelihood<D> for P
where
    P: Deref<Target: Likelihood<D>> + Send + Sync,
{
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        (**self).log_likelihood(state)
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        (**self).add_log_likelihoods(states, log_weights);
    }

    fn condition(&self, belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        (**self).condition(belief)
    }

    fn move_points(&self, states: ColumnsMut<'_, D>, weights: &[f64]) -> Result<Evidence, Error> {
        (**self).move_points(states, weights)
    }

    fn evidence(&self, belief: &Gaussian<D>) -> Result<Evidence, Error> {
        (**self).evidence(belief)
    }

    fn as_constant(&self) -> Option<f64> {
        (**self).as_constant()
    }

    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool {
        (**self).reads(state, axis)
    }

    fn as_linear_scalar(&self, state: &SVector<f64, D>) -> Option<LinearScalar<D>> {
        (**self).as_linear_scalar(state)
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

    /// One after the other; the correction is that of the last.
    fn condition(&self, belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        let (mut next, mut all) = (
            *belief,
            Evidence {
                log_likelihood: 0.0,
                correction: 0.0,
            },
        );
        for observed in self {
            let one = observed.condition(&mut next)?;
            all = Evidence {
                log_likelihood: all.log_likelihood + one.log_likelihood,
                correction: one.correction,
            };
        }
        *belief = next;
        Ok(all)
    }

    /// One after the other; the correction is that of the last.
    fn move_points(&self, mut states: ColumnsMut<'_, D>, weights: &[f64]) -> Result<Evidence, Error> {
        let mut next: [Vec<f64>; D] = states.each_ref().map(|column| column.to_vec());
        let (mut log_likelihood, mut correction) = (0.0, 0.0);
        for observed in self {
            let one = observed.move_points(next.each_mut().map(Vec::as_mut_slice), weights)?;
            (log_likelihood, correction) = (log_likelihood + one.log_likelihood, one.correction);
        }
        for (state, next) in states.iter_mut().zip(&next) {
            state.copy_from_slice(next);
        }
        Ok(Evidence {
            log_likelihood,
            correction,
        })
    }

    fn as_constant(&self) -> Option<f64> {
        self.iter().map(Likelihood::as_constant).sum()
    }

    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool {
        self.iter().any(|observed| observed.reads(state, axis))
    }
}

/// Number of states that are processed together, so that their measurements stay in the first-level cache.
const BLOCK: usize = 256;

impl<const D: usize, const M: usize, S: Sensing<D, M>, F: Factor<M>> Likelihood<D> for Observed<S, F, M> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.factor.log_likelihood(&self.measured(state))
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
            self.move_near(&mut means.each_mut().map(|column| &mut column[..count]));
            self.factor
                .add_log_likelihoods(&means.each_ref().map(|column| &column[..count]), log_weights);
        }
    }

    #[inline]
    fn condition(&self, belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        if let Some((value, noise, log_scale)) = self.factor.as_value() {
            let jacobian = self.sensing.jacobian(belief.mean());
            let innovation = value - self.measured(belief.mean());
            let (posterior, info) = value_update::update(&jacobian, &noise, belief, &value, innovation)?;
            *belief = posterior;
            return Ok(Evidence::new(info.log_likelihood + log_scale, &(jacobian * (info.gain * innovation))));
        }
        let (posterior, info) = assumed_density::update_through(belief, self)?;
        *belief = posterior;
        Ok(Evidence::new(info.log_likelihood, &info.correction))
    }

    fn move_points(&self, states: ColumnsMut<'_, D>, weights: &[f64]) -> Result<Evidence, Error> {
        let (log_likelihood, correction) = points::move_points(states, weights, self)?;
        Ok(Evidence::new(log_likelihood, &correction))
    }

    fn evidence(&self, belief: &Gaussian<D>) -> Result<Evidence, Error> {
        let (log_likelihood, correction) = assumed_density::evidence_through(belief, self)?;
        Ok(Evidence::new(log_likelihood, &correction))
    }

    fn as_constant(&self) -> Option<f64> {
        match self.factor.as_scalar()? {
            Scalar::Levels(factor) => factor.as_constant(),
            Scalar::Value(_) => None,
        }
    }

    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool {
        let jacobian: SMatrix<f64, M, D> = self.sensing.jacobian(state);
        jacobian.column(axis).iter().any(|x| *x != 0.0)
    }

    fn as_linear_scalar(&self, state: &SVector<f64, D>) -> Option<LinearScalar<D>> {
        // Nothing on a circle is linear.
        let is_straight = self.sensing.periods().iter().all(Option::is_none);
        let factor = self.factor.as_scalar().filter(|_| M == 1 && is_straight)?;
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
        })
    }
}

/// Largest `h(x) - h'(x) x`, relative to `h(x)` and the noise deviation, that is treated as rounding of a linear sensor.
const OFFSET: f64 = 1e-9;
