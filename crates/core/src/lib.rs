//! The shared types and traits of estimation under communication constraints, and the laws that their implementations obey.
//!
//! > The **world** moves (dynamics) and is measured (**sensing**). A sensor **reports** a few bits, or is silent, by a rule (**scheme**).
//! > The report crosses a **link**, at a cost in bits. The receiver knows how likely each observation is for each
//! > noise-free measurement (**factor**) and updates a **belief**, which may itself be sent on as a message.
//!
//! | concept | item |
//! |---|---|
//! | how the state moves | [`Dynamics`], [`GaussianDynamics`], [`LinearDynamics`]; in continuous time: [`Evolution`] |
//! | how it is measured | [`Sensing`], [`LinearSensing`]; of which coordinates: [`OnAxes`] |
//! | what is sent, encoded in bits | [`Message`], [`bits`], [`NumberFormat`], [`RoundedGaussian`] |
//! | how a sensor makes its reports, and their likelihoods | [`Scheme`]; what runs on the sensor: [`SensorNode`] |
//! | what the receiver observes, and the channel | [`Observation`], [`Link`] |
//! | `p(observation | noise-free measurement)` | [`Factor`] and its kinds |
//! | `p(observed | state)` | [`Likelihood`], [`Observed`] |
//! | the estimate, a distribution | [`Belief`], [`Density`], [`Gaussian`] |
//! | checks for implementations of these traits | [`laws`] |
//!
//! The main type is the [`Factor`]: one small type for each kind of observation, with its logarithm for
//! particle and grid filters and its posterior moments for Gaussian ones. A new scheme defines its factor once and works with every
//! filter. A factor depends on the noise-free measurement only. An observation that depends on more of the state (such as a nuisance
//! parameter that must be integrated out) implements [`Likelihood`] itself.
//!
//! ```
//! use fewbits_core::factor::{Factor, Levels};
//! use fewbits_core::{Gaussian, Link, Message, Sign};
//!
//! // The sensor compares its sample with the broadcast prediction and reports one bit.
//! let (prediction, sample, noise_variance) = (0.3, 1.1, 0.25);
//! let bit = Sign::of(sample, prediction)?;
//! assert_eq!(bit.to_bits(&())?.bits(), 1);
//!
//! // One bit in twenty arrives inverted. The factor says what the bit means; the posterior follows.
//! let factor = Levels::sign(bit, prediction, noise_variance, &Link::flipping(0.05)?)?;
//! let posterior = factor.tilted(&Gaussian::scalar(prediction, 1.0)?)?;
//! assert!((posterior.log_evidence - 0.5_f64.ln()).abs() < 1e-12);
//! assert!(posterior.mean[0] > prediction && posterior.covariance[0] < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! This crate contains no particular model, filter or experiment.

pub mod assumed_density;
pub mod belief;
pub mod bits;
pub mod cell;
pub mod circle;
pub mod columns;
pub mod dynamics;
pub mod error;
pub mod event;
pub mod evolution;
pub mod factor;
pub mod full_value;
pub mod gaussian;
pub mod laws;
pub mod likelihood;
pub mod measurement_noise;
pub mod message;
pub mod noise;
pub mod number;
pub mod observation;
pub mod observed;
pub mod on_axes;
pub mod points;
pub mod quantized;
pub mod scheme;
pub mod sensing;
pub mod sensor_node;
pub mod sign;
#[doc(hidden)]
pub mod value_update;

pub use belief::{Belief, Density};
pub use bits::{BitReader, BitString, BitWriter, CodecError};
pub use cell::Cell;
pub use columns::{Columns, ColumnsMut};
pub use dynamics::{Dynamics, GaussianDynamics, LinearDynamics, ScaledNoise};
pub use error::Error;
pub use event::Event;
pub use evolution::Evolution;
pub use factor::{Factor, Tilted};
pub use fewbits_numerics::ArgumentError;
pub use full_value::FullValue;
pub use gaussian::{FactoredGaussian, Gaussian};
pub use likelihood::{Evidence, Likelihood, LinearScalar};
pub use measurement_noise::MeasurementNoise;
pub use message::Message;
pub use noise::{Noise, RangeNoise};
pub use number::{NumberFormat, RoundedGaussian};
pub use observation::{Link, Observation};
pub use observed::Observed;
pub use on_axes::OnAxes;
pub use quantized::Quantized;
pub use scheme::{Deterministic, Scheme};
pub use sensing::{LinearSensing, Sensing};
pub use sensor_node::{SchemeNode, SensorNode};
pub use sign::Sign;
pub use {nalgebra, rand};
