//! Filters that accept any observation with a factor or a likelihood.
//!
//! Every filter implements the traits of [`contract`]: `predict` advances a belief by any motion, `update` processes all observations of
//! one instant, both in place. A belief is a value that can be stored, sent, compared and replayed; a step that fails leaves it unchanged.
//! A filter is a struct of its parameters and buffers. Closed forms of Gaussian beliefs are plain functions, too.
//!
//! | task | [`contract::StateFilter`] | functions and parts |
//! |---|---|---|
//! | a Gaussian belief and any factor | [`MomentFilter`] | [`assumed_density`] |
//! | a Gaussian belief and curved models | [`SigmaPointFilter`] (unscented, cubature; square-root form), [`EnsembleFilter`] | [`RootGaussian`] |
//! | linear Gaussian filtering of values | [`MomentFilter`] | [`kalman`] (Joseph form) |
//! | a Gaussian belief and any likelihood of a few coordinates | [`GridFilter`] (a grid that follows the posterior) | |
//! | any dynamics, any likelihood | [`BootstrapFilter`], [`GuidedFilter`] | [`ResamplingRule`], [`Resampling`] |
//! | linear Gaussian state, any factor of scalars | [`RaoBlackwellised`] (measurements imputed, states exact) | [`impute`] |
//! | several models, one at a time | [`Imm`] (interacting multiple models) | [`Switching`] (their dynamics) |
//! | the exact answer for a scalar | [`PointMassFilter`]: on a fixed grid with any dynamics, on one that follows the belief with linear ones | [`TransitionKernel`] (its time update) |
//! | the exact answer for a few numbers | | [`LatticeKernel`] (independent noise on each) |
//! | smoothing | | [`smoother`] (Gaussian beliefs: Rauch-Tung-Striebel), [`backward_simulation`] (particles), [`TransitionKernel::smooth`] (a grid) |
//! | calibration of sensors and level from recorded readings | [`fit`] (maximum likelihood), [`calibration`] (noises and change alone) | |
//! | the steady state | [`scalar_steady_state`] (closed form, any message quality) | |
//! | a bound for all of them | [`cramer_rao`] (posterior Cramer-Rao recursions) | |
//! | a receiver of many sensors: prediction over time, failed sensors, tests of the model, learnt noise | [`centre::FusionCentre`] | |
//!
//! An observation of probability zero under the belief gives [`Error::Impossible`] in every filter.
//!
//! ```
//! use fewbits_core::Gaussian;
//! use fewbits_filters::kalman;
//! use fewbits_models::{Ar1, LinearSensor};
//! let (dynamics, sensing) = (Ar1::new(0.9, 0.5)?, LinearSensor::direct(1.0)?);
//! let belief = Gaussian::scalar(0.0, 2.0)?;
//! let (belief, info) = kalman::step(&dynamics, &sensing, &belief, &[1.5].into())?;
//! assert!(belief.covariance()[0] < 1.0 && info.innovation[0] == 1.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not in this crate: the scheme of any single paper, and time-varying models (pass another model at each step).

mod backward_simulation;
pub mod calibration;
pub mod centre;
pub mod contract;
pub mod cramer_rao;
mod ensemble;
pub mod fit;
mod grid_filter;
mod guided;
mod imm;
mod imm_belief;
pub mod kalman;
mod lattice;
mod moving_grid;
mod particle;
mod point_mass;
mod rao_blackwell;
mod resample;
mod root_gaussian;
mod sigma_points;
pub mod smoother;
mod steady_state;
mod switching;
mod transition_kernel;

pub use backward_simulation::backward_simulation;
pub use contract::{Info, MomentFilter, Points, StateFilter};
pub use ensemble::EnsembleFilter;
pub use fewbits_core::Error;
pub use fewbits_core::{Evidence, LinearScalar, assumed_density};
pub use fewbits_densities::{GaussianCloud, Lattice, Particles, PointMass, UniformGrid};
pub use grid_filter::GridFilter;
pub use guided::{GuidedFilter, GuidedParticles};
pub use imm::Imm;
pub use imm_belief::ImmBelief;
pub use lattice::LatticeKernel;
pub use particle::BootstrapFilter;
pub use point_mass::PointMassFilter;
pub use rao_blackwell::{RaoBlackwellised, impute};
pub use resample::{Resampling, ResamplingRule, Schedule};
pub use root_gaussian::RootGaussian;
pub use sigma_points::SigmaPointFilter;
pub use steady_state::{ScalarSteadyState, scalar_steady_state};
pub use switching::Switching;
pub use transition_kernel::TransitionKernel;
pub use {nalgebra, rand};
