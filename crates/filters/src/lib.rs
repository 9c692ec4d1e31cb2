//! Filters that hear any message through its likelihood.
//!
//! A belief is a value, an estimator a function of it: each step takes a belief and what was heard, and returns the new
//! belief with an `info` of diagnostics. Nothing is remembered behind the caller's back, so a belief can be stored, sent,
//! compared and replayed; a step that fails leaves the old one as it was. The cost is a copy of a small matrix a step.
//!
//! | task | item |
//! |---|---|
//! | linear Gaussian filtering | [`kalman`] (Joseph form) |
//! | its steady state | [`scalar_steady_state`] (closed form, any message quality), [`steady_state`] (doubling) |
//! | smoothing of Gaussian beliefs | [`smoother`] (Rauch-Tung-Striebel), [`FixedLagSmoother`] |
//! | any dynamics, any message | [`ParticleFilter`] (bootstrap, guided, auxiliary), [`Resampling`] |
//! | linear Gaussian state, any message | [`RaoBlackwellised`] (measurements imputed, states exact) |
//! | mildly nonlinear sensing | [`extended_kalman`] |
//! | a bound for all of them | [`cramer_rao`] (posterior Cramer-Rao recursions) |
//! | the exact answer | [`PointMassFilter`] (scalar filter and smoother on a grid), [`PlaneFilter`] (two dimensions) |
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
pub mod cramer_rao;
mod error;
pub mod extended_kalman;
mod guided;
pub mod kalman;
mod particle;
mod point_mass;
mod point_mass_2d;
mod rao_blackwell;
mod resample;
pub mod smoother;
mod steady_state;

pub use error::Error;
pub use guided::OptimalProposal;
pub use particle::{ParticleFilter, ParticleInfo, Proposal, Workspace};
pub use point_mass::{Grid, PointMass, PointMassFilter};
pub use point_mass_2d::{PlaneFilter, PlaneMass};
pub use rao_blackwell::RaoBlackwellised;
pub use resample::{Resampling, Schedule};
pub use smoother::{FixedLagSmoother, scalar_fixed_lag_variance};
pub use steady_state::{ScalarSteadyState, SteadyState, scalar_steady_state, steady_state};
