//! Filters that take in any observation through its factor or likelihood.
//!
//! A belief is a value, an estimator a function of it: each step takes a belief and what was observed, and returns the new
//! belief with an `info` of diagnostics. Nothing is remembered behind the caller's back, so a belief can be stored, sent,
//! compared and replayed; a step that fails leaves the old one as it was. The cost is a copy of a small matrix a step.
//!
//! | task | item |
//! |---|---|
//! | a Gaussian belief and any factor | [`assumed_density`] |
//! | linear Gaussian filtering of values | [`kalman`] (Joseph form), [`extended_kalman`] |
//! | its steady state | [`scalar_steady_state`] (closed form, any message quality), [`steady_state`] (doubling) |
//! | smoothing of Gaussian beliefs | [`smoother`] (Rauch-Tung-Striebel), [`FixedLagSmoother`] |
//! | a Gaussian belief and any likelihood of a few coordinates | [`GridFilter`] (a grid that follows the posterior) |
//! | any dynamics, any likelihood | [`ParticleFilter`] (bootstrap, guided, auxiliary), [`Resampling`] |
//! | linear Gaussian state, any factor of scalars | [`RaoBlackwellised`] (measurements imputed, states exact) |
//! | several models, one at a time | [`Imm`] (interacting multiple models, any factor) |
//! | a bound for all of them | [`cramer_rao`] (posterior Cramer-Rao recursions) |
//! | the exact answer | [`PointMassFilter`] (scalar filter and smoother on a grid), [`PlaneFilter`] (two dimensions) |
//! | the receiver of many sensors: time, presence, health, learnt noise | [`centre::FusionCentre`], with any [`StateFilter`] |
//! | world, sensors, link and filter in one call | [`ClosedLoop`] |
//!
//! All have one shape: `step(rng, model, belief, observation)` returns the next belief and an `info` whose `log_likelihood` is
//! the increment `ln p(observation | past)`; what draws no random numbers takes no `rng`, and where a copy would cost there is
//! `step_in_place` with the same arguments and a workspace. What is impossible under the belief is
//! [`fewbits_core::Error::Impossible`], whichever filter finds it.
//!
//! ```
//! use fewbits_core::Gaussian;
//! use fewbits_filters::kalman;
//! use fewbits_models::{Ar1, LinearSensor};
//! let (dynamics, sensing) = (Ar1::new(0.9, 0.5)?, LinearSensor::direct(1.0)?);
//! let belief = Gaussian::scalar(0.0, 2.0)?;
//! let (belief, info) = kalman::step(&dynamics, &sensing, &belief, &[1.5].into())?;
//! assert!(belief.covariance()[0] < 1.0 && info.innovation[0] == 1.5);
//! # Ok::<(), fewbits_filters::Error>(())
//! ```
//!
//! Not here: the schemes of any one paper, and time-varying models (pass another model at each step).

pub mod assumed_density;
pub mod centre;
mod closed_loop;
pub mod contract;
pub mod cramer_rao;
mod error;
pub mod extended_kalman;
mod grid_filter;
mod guided;
mod imm;
pub mod kalman;
mod moved;
mod noise_bank;
mod particle;
mod plane;
mod point_mass;
mod rao_blackwell;
mod resample;
pub mod smoother;
mod steady_state;

pub use closed_loop::{AssumedDensity, ClosedLoop, Filter, LoopState, Slot};
pub use contract::{BootstrapFilter, GridOnAxes, Info, MomentFilter, StateFilter, StateLikelihood};
pub use error::Error;
pub use fewbits_densities::{GaussianCloud, Grid, Particles, PlaneMass, PointMass};
pub use grid_filter::{GridFilter, GridInfo, GridWorkspace, MIN_NODES_PER_DEVIATION};
pub use guided::{OptimalProposal, TiltedProposal};

pub use imm::{Imm, ImmBelief, ImmInfo, ImmWorkspace};
pub use noise_bank::NoiseBank;
pub use particle::{ParticleFilter, ParticleInfo, Proposal, Workspace};
pub use plane::PlaneFilter;
pub use point_mass::PointMassFilter;
pub use rao_blackwell::{CloudWorkspace, RaoBlackwellised};
pub use resample::{Resampling, Schedule};
pub use smoother::{FixedLagSmoother, scalar_fixed_lag_variance};
pub use steady_state::{ScalarSteadyState, SteadyState, scalar_steady_state, steady_state};
pub use {nalgebra, rand};
