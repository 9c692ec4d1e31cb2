//! Dynamics that follow one of several models at a time.

use crate::Error;
use crate::contract::{Evolving, Motion};
use crate::imm::moments;
use fewbits_core::{ColumnsMut, Gaussian};
use fewbits_numerics::error::at_least_one;
use nalgebra::SVector;
use rand::{Rng, RngExt};

/// Dynamics that follow one of several models at a time. With a [`NoiseBank`](crate::NoiseBank) it gives an interacting-multiple-model
/// filter over any time interval. A filter of one model sees the mixture of all models with equal weights.
pub struct Switching<const D: usize>(Vec<Box<dyn Evolving<D>>>);

impl<const D: usize> Switching<D> {
    /// Dynamics of these models.
    ///
    /// # Errors
    /// If there is no model.
    pub fn new(models: Vec<Box<dyn Evolving<D>>>) -> Result<Self, Error> {
        at_least_one("models", models.len())?;
        Ok(Self(models))
    }
}

impl<const D: usize> Evolving<D> for Switching<D> {
    fn over(&self, seconds: f64) -> Result<Box<dyn Motion<D>>, Error> {
        let motions = self.0.iter().map(|model| model.over(seconds));
        Ok(Box::new(SwitchingMotion(motions.collect::<Result<_, _>>()?)))
    }
}

struct SwitchingMotion<const D: usize>(Vec<Box<dyn Motion<D>>>);

impl<const D: usize> Motion<D> for SwitchingMotion<D> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        let sum = self
            .0
            .iter()
            .fold(SVector::zeros(), |sum, motion| sum + motion.mean(state));
        sum / self.0.len() as f64
    }

    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        let moved: Vec<_> = self
            .0
            .iter()
            .map(|motion| motion.predict(belief, noise_scale))
            .collect();
        // Nothing here says which model holds, so all have equal weights. A `NoiseBank` uses the single `modes` instead.
        moments(moved.iter().map(|one| (1.0 / moved.len() as f64, one)))
    }

    fn move_columns(&self, rng: &mut dyn Rng, noise_scale: f64, mut states: ColumnsMut<'_, D>) {
        // Each state draws its own model, so the states move one by one.
        for i in 0..fewbits_core::columns::count(&states) {
            let motion = &self.0[rng.random_range(0..self.0.len())];
            motion.move_columns(rng, noise_scale, states.each_mut().map(|column| &mut column[i..=i]));
        }
    }

    fn modes(&self) -> &[Box<dyn Motion<D>>] {
        &self.0
    }
}
