//! Dynamics and sensors: models of how a state moves and of what is measured of it.
//!
//! A model is a checked, immutable value: the matrices of a state equation or of a sensing equation. It
//! predicts, draws samples and states its noise. Estimation from measurements is in the crates above.
//!
//! All models implement the traits of [`fewbits_core`], so every filter accepts them.
//!
//! Process noise is stored by its causes: `Q = G diag(q) G'` with a few independent noise variances `q` and their gain `G`, not as `Q`
//! itself. A constant-velocity target has one random acceleration per axis, so its `Q`
//! has half rank. A Cholesky factorisation of `Q` would fail or add noise, while `x' = F x + G u` draws exactly. In exchange, the
//! type has a second const parameter, the number of causes.
//!
//! | model | type |
//! |---|---|
//! | scalar first-order autoregression | [`Ar1`] |
//! | linear with Gaussian noise, any dimension | [`LinearGaussian`] |
//! | white-noise acceleration on a line, in a plane | [`constant_velocity_1d`], [`constant_velocity_2d`] |
//! | linear in continuous time (Ornstein-Uhlenbeck, nearly constant velocity, random walk) | [`ContinuousLinear`], [`AffineGaussian`] |
//! | dynamics and sensing of one's own, with Jacobians by automatic differentiation | [`AutoDynamics`], [`AutoSensing`], [`Flow`] |
//! | linear sensing, scalar and vector | [`ScalarSensor`], [`LinearSensor`] |
//! | bearing of a target, in radians or as a compass | [`Bearing`] |
//! | received signal strength in dBm (RSSI) | [`LogDistance`] |
//! | received amplitude that falls with distance | [`ReceivedPower`] |
//! | a substance that diffuses through air, ground, vessels | [`diffusion`] |
//! | concentrations from a source at sensors, in any medium | [`SourceModel`] |
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
//! Not in this crate: time-varying matrices, estimation.

mod ar1;
mod auto;
mod bearing;
mod beside;
mod constant_velocity;
mod continuous;
pub mod diffusion;
mod linear_gaussian;
mod linear_sensor;
mod log_distance;
mod received_power;
mod source_model;

pub use ar1::Ar1;
pub use auto::{AutoDynamics, AutoSensing, Differentiable, DualNum, Flow, Number};
pub use bearing::Bearing;
pub use constant_velocity::{constant_velocity_1d, constant_velocity_2d};
pub use continuous::{AffineGaussian, ContinuousLinear, PLANE_POSITION};
pub use fewbits_core::Error;
pub use linear_gaussian::LinearGaussian;
pub use linear_sensor::{LinearSensor, ScalarSensor};
pub use log_distance::LogDistance;
pub use received_power::ReceivedPower;
pub use source_model::{Homogeneous, Receptor, SourceGradient, SourceModel};
pub use {nalgebra, rand};
