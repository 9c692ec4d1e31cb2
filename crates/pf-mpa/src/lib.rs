//! Tracking a target from quantized ranges.
//!
//! Sensors that know where they stand measure their distance to a target, in noise that grows with the distance, and send each
//! the level of a quantizer of a few bits: the thesis's Chapter 3 has particle message passing on a factor graph for it. Here is
//! that algorithm, as published and with its errata mended, beside what does better.
//!
//! The central choice: **a level is a factor, in closed form** ([`RangeFactor`]), and not a ring of particles under kernels. What a
//! level says about a position is `Phi((upper - d)/sigma(d)) - Phi((lower - d)/sigma(d))`, at the *hypothesised* distance `d`; whoever has it needs no
//! kernel, no weights and no Jacobian. Every filter of the library takes such a factor. The recommended one is [`GridFilter`]: it
//! multiplies a Gaussian belief with all factors on a grid of 15 x 15 nodes that follows the posterior, and returns the Gaussian of the
//! same moments, without random numbers. Its mean squared error is a third below those of Gaussian message passing and of improved
//! particle message passing, at a tenth of the latter's cost. The price: it cannot represent a belief with several modes.
//!
//! | task | item |
//! |---|---|
//! | the sensor, its noise, its quantizer, what a level says | [`RangeSensor`], [`RangeNoise`], [`QuantizedRange`], [`RangeFactor`] |
//! | how all nodes derive the same cells | [`Encoder`]: published, predicted, adaptive |
//! | the target: as dynamics, as nine interacting models, with its manoeuvre as part of the state | [`Target`], [`WithManoeuvre`] |
//! | the recommended tracker | [`GridFilter`] |
//! | ranges of a recording: bias, outliers, missing anchors, unknown speed, acquisition | [`RangeTracker`] |
//! | linearised: extended Kalman filters, Gaussian message passing | [`Linearised`] |
//! | particles and draws | [`ParticleFilter`](fewbits_filters::ParticleFilter) on [`WithManoeuvre`], [`GuidedGaussian`], [`RaoBlackwellGuided`] |
//! | Algorithm 6, its messages, the factor graphs behind it | [`published`] |
//! | bounds | [`CramerRao`], [`level_information`] |
//! | two targets, measurements in unknown order | [`association`] |
//! | who leads, what is handed over, in bits | [`leader`] |
//!
//! ```
//! use fewbits_core::Gaussian;
//! use fewbits_monte_carlo::Stream;
//! use fewbits_pf_mpa::{Encoder, GridFilter, Network, QuantizedRange, RangeNoise, Reports, Target, Tracker};
//! use nalgebra::{Matrix4, Vector2, Vector4};
//!
//! let (target, scheme) = (Target::printed()?, QuantizedRange::new(4, RangeNoise::from_snr_db(50.0)?)?);
//! let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 16.0]].map(Vector2::from);
//! let network = Network::new(&places, scheme, Encoder::adaptive(4)?)?;
//! let belief = Gaussian::new(Vector4::new(9.0, 9.0, 0.0, 0.5), Matrix4::identity() * 0.1)?;
//! let mut rng = Stream::new(1).rng();
//! let ranges = network.measure(&mut rng, 9.2, 9.4);
//! let observed = network.observe(&target, 0, &belief, &ranges, Reports::Levels)?;
//! let (belief, info) = GridFilter::default().step(&mut rng, &target, 0, &belief, &observed)?;
//! assert_eq!((network.report_bits(), info.fallbacks), (6, 0));
//! assert!((belief.mean()[0] - 9.2).abs() < 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: radio, energy, delays; more than two targets; ranges in space.

pub mod association;
mod bound;
mod chain;
mod encoder;
mod error;
mod factor;
mod grid;
mod guided;
pub mod leader;
mod linearised;
pub mod product;
pub mod published;
mod quantized;
mod rao_blackwell;
mod recording;
mod sensor;
mod target;
mod tracker;

pub use bound::{CramerRao, level_information, position_information, range_information};
pub use chain::AccelerationChain;
pub use encoder::{Encoder, Normalisation, optimal_loading};
pub use error::Error;
pub use factor::RangeFactor;
pub use fewbits_filters::{GridFilter, GridInfo, GridWorkspace};
pub use guided::{GuidedGaussian, GuidedWorkspace};
pub use linearised::{Linearised, QuantizationNoise, Velocity};
pub use quantized::{IntervalRule, QuantizedRange, RangeReference};
pub use rao_blackwell::{RaoBlackwellGuided, VelocityCloud, VelocityWorkspace};
pub use recording::{RangeEstimate, RangeSettings, RangeTracker, Travel};
pub use sensor::{BiasedRangeSensor, RangeNoise, RangeSensor};
pub use target::{Manoeuvres, Target, WithManoeuvre};
pub use tracker::{GaussianTracker, Network, POSITION, Ranged, Reports, Step, StepInfo, Tracker};
pub use {nalgebra, rand};
