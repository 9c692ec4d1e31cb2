//! Dynamics that follow one of several models at a time.

use crate::Error;
use crate::imm_belief::moments;
use fewbits_core::{ColumnsMut, Dynamics, Evolution, Gaussian, GaussianDynamics, ScaledNoise};
use fewbits_numerics::error::{ArgumentError, at_least_one};
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};

/// Dynamics that follow one of several models at a time: models over any time ([`Evolution`]), or over one step. With an [`Imm`](crate::Imm)
/// they give an interacting-multiple-model filter. A filter of one model sees the mixture of all models with equal weights, since nothing
/// here says which one holds; an `Imm` uses the single [`modes`](GaussianDynamics::modes) instead.
#[derive(Debug, Clone, PartialEq)]
pub struct Switching<E>(Vec<E>);

impl<E> Switching<E> {
    /// Dynamics of these models.
    ///
    /// # Errors
    /// If there is no model.
    pub fn new(models: Vec<E>) -> Result<Self, Error> {
        at_least_one("models", models.len())?;
        Ok(Self(models))
    }
}

impl<const D: usize, E: Evolution<D>> Evolution<D> for Switching<E> {
    fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<D> + '_>, ArgumentError> {
        let modes = self.0.iter().map(|model| model.over(seconds));
        Ok(Box::new(Switching(modes.collect::<Result<Vec<_>, _>>()?)))
    }
}

impl<const D: usize, G: GaussianDynamics<D>> Dynamics<D> for Switching<G> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        let sum = self
            .0
            .iter()
            .fold(SVector::zeros(), |sum, model| sum + model.mean(state));
        sum / self.0.len() as f64
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, D> {
        self.0[rng.random_range(0..self.0.len())].propagate(rng, state)
    }

    fn propagate_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, D>) {
        self.propagate_columns_scaled(rng, 1.0, states);
    }
}

impl<const D: usize, G: GaussianDynamics<D>> GaussianDynamics<D> for Switching<G> {
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let sum = self
            .0
            .iter()
            .fold(SMatrix::zeros(), |sum, model| sum + model.jacobian(state));
        sum / self.0.len() as f64
    }

    /// The covariance of the mixture: the models' own noise and the spread of their means.
    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        *self
            .predict(&Gaussian::from_trusted_parts(*state, SMatrix::zeros()), 1.0)
            .covariance()
    }

    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        let moved: Vec<_> = self.0.iter().map(|model| model.predict(belief, noise_scale)).collect();
        moments(moved.iter().map(|one| (1.0 / moved.len() as f64, one)))
    }

    fn propagate_columns_scaled(&self, rng: &mut dyn Rng, noise_scale: f64, mut states: ColumnsMut<'_, D>) {
        // Each state draws its own model, so the states move one by one.
        for i in 0..fewbits_core::columns::count(&states) {
            let model = &self.0[rng.random_range(0..self.0.len())];
            model.propagate_columns_scaled(rng, noise_scale, states.each_mut().map(|column| &mut column[i..=i]));
        }
    }

    fn modes(&self) -> Vec<ScaledNoise<'_, D>> {
        self.0.iter().map(|model| ScaledNoise::new(model, 1.0)).collect()
    }
}
