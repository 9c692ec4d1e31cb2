//! Tracking a target from quantized ranges.
//!
//! Sensors at known places measure their distance to a target. The noise may grow with the distance. Each sends the level of a quantizer of
//! a few bits.
//!
//! **The likelihood of a level is in closed form** ([`Levels`](fewbits_core::factor::Levels)). As a function of the position it is
//! `Phi((upper - d)/sigma(d)) - Phi((lower - d)/sigma(d))` at the *hypothesised* distance `d`. It needs no kernel, no weights and no
//! Jacobian, and every filter of the library accepts it. The recommended filter is [`GridFilter`]: it multiplies a Gaussian belief with all
//! factors on a grid of 15 x 15 nodes about the posterior and returns the Gaussian of the same moments. It uses no random numbers. Its
//! mean squared error is a third below those of Gaussian message passing and of improved particle message passing (chapter 3 of the thesis
//! that this crate follows), at a tenth of the latter's cost. It cannot represent a belief with several modes.
//!
//! | task | item |
//! |---|---|
//! | sensor, noise, quantizer, likelihood of a level | [`RangeSensor`], [`RangeNoise`], [`QuantizedRange`], [`Levels`](fewbits_core::factor::Levels) |
//! | cells about the expected range, as wide as its uncertainty | [`RangeReference::about`] with [`optimal_loading`] |
//! | the recommended tracker | [`GridFilter`] in a [`FusionCentre`](fewbits_filters::centre::FusionCentre) |
//! | recorded ranges with bias, outliers, missing anchors, unknown speed and start | [`RangeTracker`] |
//! | information of a range and of a level | [`range_information`], [`level_information`] |
//!
//! ```
//! use fewbits_core::{Gaussian, Link, SchemeNode, SensorNode};
//! use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
//! use fewbits_models::{ContinuousLinear, PLANE_POSITION};
//! use fewbits_monte_carlo::Stream;
//! use fewbits_pf_mpa::{GridFilter, QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
//! use nalgebra::{Matrix4, Vector1, Vector4};
//!
//! let (noise, loading) = (RangeNoise::from_snr_db(50.0)?, optimal_loading(4)?);
//! let scheme = QuantizedRange::new(4, noise)?;
//! let prior = Gaussian::new(Vector4::new(9.0, 0.0, 9.0, 0.5), Matrix4::identity() * 0.1)?;
//! let (mut rng, world) = (Stream::new(1).rng(), ContinuousLinear::nearly_constant_velocity_2d(0.02)?);
//! let filter = GridFilter::new(PLANE_POSITION)?;
//! let mut centre = FusionCentre::new(&mut rng, world, filter, &prior)?;
//! let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 16.0]];
//! for (number, place) in (0..).zip(places) {
//!     let sensor = RangeSensor::new(place.into(), noise)?.on_axes::<4>(PLANE_POSITION)?;
//!     let ask = move |_: &Gaussian<4>, range: &Gaussian<1>| RangeReference::about(range, loading);
//!     centre.join(number, Reporting::new(sensor, scheme.clone(), Link::PERFECT, ask))?;
//! }
//! centre.advance(&mut rng, 1.0)?;
//! let mut slots = Vec::new();
//! for (number, place) in (0..).zip(places) {
//!     let feedback = centre.feedback(number)?;
//!     let sensor = RangeSensor::new(place.into(), noise)?;
//!     let range = Vector1::new(sensor.measure(&mut rng, sensor.distance(9.2, 9.4)));
//!     let report = SchemeNode::new(scheme.clone()).report(&mut rng, &range, &feedback)?;
//!     slots.push(Slot::new(number, feedback, report.into()));
//! }
//! centre.receive(&mut rng, &slots)?;
//! assert!((centre.estimate().mean()[0] - 9.2).abs() < 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: radio, energy and delays (`fewbits-network`); several targets.

mod bound;
mod loading;
mod quantized;
mod ranges;
mod sensor;

pub use bound::{level_information, range_information};
pub use fewbits_core::{Error, RangeNoise};
pub use fewbits_filters::GridFilter;
pub use loading::optimal_loading;
pub use quantized::{QuantizedRange, RangeReference};
pub use ranges::{
    Height, Mistake, RangeEstimate, RangeSettings, RangeTracker, Travel, height_of, mistake_of, proportion_of,
};
pub use sensor::RangeSensor;
pub use {nalgebra, rand};
