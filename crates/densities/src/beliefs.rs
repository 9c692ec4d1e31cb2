//! Particles, estimates and mixtures as [`Belief`]s; the last two have a [`Density`].

use crate::{KernelEstimate, Mixture, Particles};
use fewbits_core::{Belief, Columns, ColumnsMut, Density};
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Fills the columns with copies of independently drawn particles and returns nothing else.
fn draw_particles<const D: usize, R: Rng + ?Sized>(
    particles: &Particles<D>,
    rng: &mut R,
    states: &mut ColumnsMut<'_, D>,
) {
    let mut cumulative = Vec::with_capacity(particles.len());
    let mut total = 0.0;
    for w in particles.weights() {
        total += w;
        cumulative.push(total);
    }
    // Rounding may leave the last sum a little off; a level above it belongs to the last particle that has weight.
    let last = cumulative.partition_point(|c| *c < total);
    let count = states.iter().map(|c| c.len()).min().unwrap_or(0);
    let columns = particles.columns();
    for k in 0..count {
        let level = rng.random::<f64>() * total;
        let i = cumulative.partition_point(|c| *c <= level).min(last);
        for (state, column) in states.iter_mut().zip(&columns) {
            state[k] = column[i];
        }
    }
}

impl<const D: usize> Belief<D> for Particles<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        draw_particles(self, rng, &mut states);
    }
}

impl<const D: usize> Belief<D> for KernelEstimate<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        draw_particles(self.particles(), rng, &mut states);
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
