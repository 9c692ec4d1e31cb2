//! Estimates and mixtures as [`Belief`]s with a [`Density`].

use crate::{KernelEstimate, Mixture};
use fewbits_core::{Belief, Columns, ColumnsMut, Density};
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

impl<const D: usize> Belief<D> for KernelEstimate<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        if !fewbits_core::columns::columns_agree(&mut states) {
            return;
        }
        let drawn = states.each_mut().map(|column| &mut **column);
        self.particles().sample_columns(rng, drawn);
        let count = states.iter().map(|c| c.len()).min().unwrap_or(0);
        for k in 0..count {
            let z = SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal));
            let kick = self.factor().lower * z;
            states.iter_mut().zip(kick.iter()).for_each(|(state, x)| state[k] += x);
        }
    }
}

impl<const D: usize> Density<D> for KernelEstimate<D> {
    fn log_density(&self, state: &SVector<f64, D>) -> f64 {
        self.log_pdf(state)
    }

    fn add_log_densities(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
        let mut own = vec![0.0; logs.len()];
        self.log_pdf_columns(*states, &mut own);
        logs.iter_mut().zip(own).for_each(|(log, x)| *log += x);
    }
}

impl<const D: usize> Belief<D> for Mixture<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        if !fewbits_core::columns::columns_agree(&mut states) {
            return;
        }
        let count = states.iter().map(|c| c.len()).min().unwrap_or(0);
        for k in 0..count {
            let draw = self.sample(rng);
            states.iter_mut().zip(draw.iter()).for_each(|(state, x)| state[k] = *x);
        }
    }
}

impl<const D: usize> Density<D> for Mixture<D> {
    fn log_density(&self, state: &SVector<f64, D>) -> f64 {
        self.log_pdf(state)
    }

    fn add_log_densities(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
        let mut own = vec![0.0; logs.len()];
        self.log_pdf_columns(*states, &mut own);
        logs.iter_mut().zip(own).for_each(|(log, x)| *log += x);
    }
}
