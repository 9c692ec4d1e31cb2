//! Tracking a target from quantized ranges.
//!
//! Sensors at known places measure their distance to a target. The noise grows with the distance. Each sends the level of a quantizer of
//! a few bits. Chapter 3 of the thesis that this crate follows uses particle message passing on a factor graph. The trackers of this
//! crate have smaller errors at lower cost.
//!
//! **The likelihood of a level is in closed form** ([`RangeFactor`]), instead of a ring of particles with kernels. As a function of the
//! position it is `Phi((upper - d)/sigma(d)) - Phi((lower - d)/sigma(d))` at the *hypothesised* distance `d`. It needs no
//! kernel, no weights and no Jacobian, and every filter of the library accepts it. The recommended tracker is [`GridFilter`]: it
//! multiplies a Gaussian belief with all factors on a grid of 15 x 15 nodes about the posterior and returns the Gaussian of the
//! same moments. It uses no random numbers. Its mean squared error is a third below those of Gaussian message passing and of improved
//! particle message passing, at a tenth of the latter's cost. It cannot represent a belief with several modes.
//!
//! | task | item |
//! |---|---|
//! | sensor, noise, quantizer, likelihood of a level | [`RangeSensor`], [`RangeNoise`], [`QuantizedRange`], [`RangeFactor`] |
//! | how all nodes compute the same cells | [`Encoder`]: published, predicted, adaptive |
//! | models of the target: plain, nine interacting models, with its manoeuvre in the state | [`Target`], [`WithManoeuvre`] |
//! | the recommended tracker | [`GridFilter`] |
//! | recorded ranges with bias, outliers, missing anchors, unknown speed and start | [`RangeTracker`] |
//! | linearised: extended Kalman filters, Gaussian message passing | [`Linearised`] |
//! | particles and draws | [`BootstrapFilter`](fewbits_filters::BootstrapFilter) on [`WithManoeuvre`], [`GuidedGaussian`], [`RaoBlackwellGuided`] |
//! | bounds | [`CramerRao`], [`level_information`] |
//! | which sensor leads, what it hands over, in bits | [`leader`] |
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
//! Not here: radio, energy and delays (`fewbits-network`); more than two targets.

/// Parts of the trackers, for the comparisons in `fewbits-baselines`. No promise is made of them.
#[doc(hidden)]
pub mod engine {
    pub use crate::chain::draw;
}

mod bound;
mod chain;
mod encoder;
mod factor;
mod grid;
mod guided;
pub mod leader;
mod linearised;
mod quantized;
mod ranges;
mod rao_blackwell;
mod sensor;
mod target;
mod tracker;

pub use bound::{CramerRao, level_information, position_information, range_information};
pub use chain::AccelerationChain;
pub use encoder::{Encoder, Normalisation, optimal_loading};
pub use factor::RangeFactor;
pub use fewbits_core::Error;
pub use fewbits_filters::{GridFilter, GridInfo, GridWorkspace};
pub use guided::{GuidedGaussian, GuidedWorkspace};
pub use linearised::{Linearised, QuantizationNoise, Velocity};
pub use quantized::{IntervalRule, QuantizedRange, RangeReference};
pub use ranges::{Height, RangeEstimate, RangeSettings, RangeTracker, Travel};
pub use rao_blackwell::{RaoBlackwellGuided, VelocityCloud, VelocityWorkspace};
pub use sensor::{BiasedRangeSensor, RangeNoise, RangeSensor};
pub use target::{Manoeuvres, Target, WithManoeuvre};
pub use tracker::{GaussianTracker, Network, POSITION, Ranged, Reports, Step, StepInfo, Tracker};
pub use {nalgebra, rand};
