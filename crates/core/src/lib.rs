//! What every fewbits crate stands on.
//!
//! fewbits estimates the state of the world from sensors that may hardly speak. Each scheme has three parts: the sensor's
//! half turns a measurement into a [`Message`] of few bits (silence is one of zero bits); a link delivers
//! it, or loses it; and whoever hears it knows how likely it was under each state, a [`Likelihood`], and updates a belief.
//! This crate holds the words of that sentence and the numerics they need:
//!
//! | module | what it holds |
//! |---|---|
//! | [`gaussian`] | the [`Gaussian`] belief |
//! | [`message`], [`bits`] | messages, what is heard of them, and their real bits |
//! | [`state_space`], [`likelihood`] | traits for dynamics, sensing and likelihoods; the likelihoods of scalar sensors |
//!
//! The central choice: **probabilities of intervals live in the log domain, and nowhere else is one formed.** It costs an
//! `erfcx` and an `exp` where `1 - cdf` would do in the middle of the bell, and it is why no filter in this workspace divides
//! by zero when a bit is surprising.
//!
//! ```
//! use fewbits_core::likelihood::{Heard, ScalarLikelihood};
//! use fewbits_core::message::{Message, Sign};
//! use fewbits_core::Likelihood;
//! use nalgebra::SVector;
//!
//! // The sensor compares its sample with the broadcast prediction and sends one bit.
//! let (prediction, sample) = (0.3, 1.1);
//! let bit = Sign::of(sample, prediction);
//! assert_eq!(bit.to_bits(&())?.bits(), 1);
//!
//! // The listener weighs every state by how likely that bit was under it.
//! let heard = Heard::Bit { sign: bit, threshold: prediction, crossover: 0.0 };
//! let likelihood = ScalarLikelihood::new(SVector::from([1.0]), 0.5, heard)?;
//! assert!(likelihood.log_likelihood(&SVector::from([1.0])) > likelihood.log_likelihood(&SVector::from([0.0])));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: any particular model, filter or experiment.

pub mod bits;
pub mod gaussian;
pub mod likelihood;
pub mod message;
pub mod state_space;

pub use bits::{BitReader, BitString, BitWriter, CodecError};
pub use fewbits_numerics::ArgumentError;
pub use gaussian::Gaussian;
pub use message::{Cell, Encoder, Message, Observation, Sign};
pub use state_space::{
    Columns, ColumnsMut, Dynamics, GaussianDynamics, Likelihood, LinearDynamics, LinearSensing, Sensing,
};
