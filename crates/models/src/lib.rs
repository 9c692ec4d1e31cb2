//! Dynamics and sensors: models of how a state moves and of what is measured of it.
//!
//! A model here is a checked, immutable value: the matrices of a state equation or of a sensing equation, nothing else. It
//! can predict, draw and describe its noise; what to do with a measurement is the business of the crates above.
//!
//! All implement the traits of [`fewbits_core`], so any filter takes them.
//!
//! The central choice is that process noise is stored as it is caused, `Q = G diag(q) G'` with a few independent causes `q`
//! and their effect `G`, never as a bare `Q`. A constant-velocity target is pushed by one acceleration per axis, so its `Q`
//! has half rank; a factorisation of `Q` would fail or invent noise, while `x' = F x + G u` draws from it exactly. The cost is
//! a second const-generic parameter in the type, the number of causes.
//!
//! | model | type |
//! |---|---|
//! | scalar first-order autoregression | [`Ar1`] |
//! | linear with Gaussian noise, any dimension | [`LinearGaussian`] |
//! | white-noise acceleration on a line, in a plane | [`constant_velocity_1d`], [`constant_velocity_2d`] |
//! | linear in continuous time: Ornstein-Uhlenbeck, nearly constant velocity and acceleration, random walk | [`ContinuousLinear`], over any time an [`AffineGaussian`] |
//! | several of these, one at a time; the manoeuvring target | [`Switching`], over any time the models and transition of an IMM filter |
//! | linear sensing, scalar and vector | [`ScalarSensor`], [`LinearSensor`] |
//! | received amplitude that falls with distance | [`ReceivedPower`] |
//! | a substance that diffuses through air, ground, vessels | [`diffusion`] |
//! | what a source causes at sensors, in any medium | [`SourceModel`] |
//!
//! ```
//! use fewbits_models::{constant_velocity_1d, Ar1};
//! use fewbits_core::Dynamics;
//! use nalgebra::Vector2;
//!
//! let plant = Ar1::new(0.9, 0.5)?;
//! assert!((plant.stationary_variance()? - 0.5 / (1.0 - 0.81)).abs() < 1e-12);
//!
//! let target = constant_velocity_1d(1.0, 0.04)?;
//! assert_eq!(target.mean(&Vector2::new(10.0, 2.0)), Vector2::new(12.0, 2.0));
//! # Ok::<(), fewbits_models::Error>(())
//! ```
//!
//! Not here: nonlinear dynamics, time-varying matrices, estimation.

mod ar1;
mod constant_velocity;
mod continuous;
pub mod diffusion;
mod linear_gaussian;
mod linear_sensor;
mod received_power;
mod source_model;
mod switching;

pub use ar1::Ar1;
pub use constant_velocity::{constant_velocity_1d, constant_velocity_2d};
pub use continuous::{AffineGaussian, ContinuousLinear, PLANE_POSITION};
pub use fewbits_core::Error;
pub use linear_gaussian::LinearGaussian;
pub use linear_sensor::{LinearSensor, ScalarSensor};
pub use received_power::ReceivedPower;
pub use source_model::{Homogeneous, Receptor, SourceGradient, SourceModel};
pub use switching::Switching;
pub use {nalgebra, rand};
