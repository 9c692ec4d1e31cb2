//! Probability densities over a `D`-dimensional state: particles, Gaussian mixtures, kernel estimates and grids.
//!
//! Every density here is a plain value that can be stored, compared and restored. The filters of `fewbits-filters` compute one density from
//! the previous one.
//!
//! | density | use it when | value `p(x)` |
//! |---|---|---|
//! | [`Particles`] | the shape is unknown; particle filters update it | none |
//! | [`GaussianCloud`] | part of the state is linear: the belief of a Rao-Blackwellised filter | sum of Gaussians of one covariance |
//! | [`KernelEstimate`] | particles need a value of the density; [`Bandwidth`] chooses the kernel | sum of Gaussians of one covariance |
//! | [`Mixture`] | a few Gaussians describe it, each with a covariance of its own | sum of Gaussians |
//! | [`PointMass`] on a [`UniformGrid`] | one dimension, values at the nodes of a grid | linear between nodes |
//! | [`Lattice`] | several numbers, their count known at run time; values at the nodes of a product of grids | at the nodes |
//!
//! All of them but [`Lattice`] implement [`Belief`](fewbits_core::Belief): mean, covariance, draws into columns. Those with a value also
//! implement [`Density`](fewbits_core::Density).
//!
//! ```
//! use fewbits_core::Belief;
//! use fewbits_densities::Particles;
//! let belief = Particles::uniform([vec![1.0, 2.0, 3.0], vec![0.0, 1.0, 2.0]])?;
//! assert_eq!(belief.mean().as_slice(), &[2.0, 1.0]);
//! assert!((belief.covariance()[(0, 1)] - 2.0 / 3.0).abs() < 1e-15);
//! # Ok::<(), fewbits_densities::Error>(())
//! ```
//!
//! The coordinates of particles are stored in columns and the weights as logarithms. Filters loop over all particles, and such loops run in
//! vector registers. In exchange, one particle is spread over `D + 1` slices, so moving single particles is slow.
//!
//! Not here: dynamics, measurements and resampling (`fewbits-filters`); the reduction of a density to a few Gaussians, divergences
//! and the code of a mixture in a few bytes (`fewbits-mixture-codec`); products of mixtures (`fewbits-pf-mpa`); adaptive cells and
//! Hermite series (`fewbits-diffusive`).

/// Implements [`Density`](fewbits_core::Density) by the type's own `log_pdf` and `log_pdf_columns`.
macro_rules! own_log_pdf {
    () => {
        fn log_density(&self, state: &SVector<f64, D>) -> f64 {
            self.log_pdf(state)
        }

        fn add_log_densities(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
            let mut own = vec![0.0; logs.len()];
            self.log_pdf_columns(*states, &mut own);
            logs.iter_mut().zip(own).for_each(|(log, x)| *log += x);
        }
    };
}

use own_log_pdf;

mod grids;
mod kernel_estimate;
mod mixture;
mod particles;

pub use fewbits_core::Error;
pub use grids::{Lattice, PointMass, UniformGrid};
pub use kernel_estimate::{Bandwidth, BandwidthRule, KernelEstimate, SampleSize, Shape, add_cross_sums};
pub use mixture::{Component, Mixture, ellipse, moment_matched};
pub use particles::{Categorical, GaussianCloud, Particles, systematic, systematic_into};
pub use {nalgebra, rand};
