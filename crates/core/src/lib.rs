//! The shared types and traits of estimation under communication constraints, and the laws that their implementations obey.
//!
//! > The **world** moves (dynamics) and is **sensed** (sensing). A sensor **reports** little (scheme: report, perhaps silence).
//! > The report crosses a **link** at a price in bits. Whoever receives it knows how likely that observation was for each
//! > noise-free measurement (**factor**) and updates a **belief**, which may itself travel on as a message.
//!
//! | concept | item |
//! |---|---|
//! | how the world moves | [`Dynamics`], [`GaussianDynamics`], [`LinearDynamics`]; over any time: [`Evolution`] |
//! | how it is sensed | [`Sensing`], [`LinearSensing`]; of which coordinates: [`OnAxes`] |
//! | what travels, as real bits | [`Message`], [`bits`], [`NumberFormat`] |
//! | the sensor's half, and what its reports mean | [`Scheme`]; what runs on the sensor: [`SensorNode`] |
//! | what is observed, and through what | [`Observation`], [`Link`] |
//! | `p(observation | noise-free measurement)` | [`Factor`] and its kinds |
//! | `p(observed | state)` | [`Likelihood`], [`Observed`] |
//! | what is known | [`Belief`], [`Density`], [`Gaussian`] |
//! | what implementations must obey | [`laws`] |
//!
//! The central choice is the [`Factor`]: one small type for each kind of observation, with its logarithm for
//! particle and grid filters and its posterior moments for Gaussian ones. A new scheme writes its factor once and has every
//! filter. The price is that a factor knows the noise-free measurement only; what depends on more of the state (a nuisance that
//! must be integrated out) implements [`Likelihood`] itself.
//!
//! ```
//! use fewbits_core::factor::{Factor, InCell};
//! use fewbits_core::{Gaussian, Link, Message, Sign};
//!
//! // The sensor compares its sample with the broadcast prediction and reports one bit.
//! let (prediction, sample, noise_variance) = (0.3, 1.1, 0.25);
//! let bit = Sign::of(sample, prediction)?;
//! assert_eq!(bit.to_bits(&())?.bits(), 1);
//!
//! // One bit in twenty arrives inverted. The factor says what the bit means; the posterior follows.
//! let factor = InCell::sign(bit, prediction, noise_variance, &Link::flipping(0.05)?)?;
//! let posterior = factor.tilted(&Gaussian::scalar(prediction, 1.0)?)?;
//! assert!((posterior.log_evidence - 0.5_f64.ln()).abs() < 1e-12);
//! assert!(posterior.mean[0] > prediction && posterior.covariance[0] < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: any particular model, filter or experiment.

pub mod belief;
pub mod bits;
pub mod cell;
pub mod columns;
pub mod dynamics;
pub mod error;
pub mod evolution;
pub mod factor;
pub mod full_value;
pub mod gaussian;
pub mod laws;
pub mod likelihood;
pub mod measurement_noise;
pub mod message;
pub mod number;
pub mod observation;
pub mod on_axes;
pub mod scheme;
pub mod sensing;
pub mod sensor_node;
pub mod sign;

pub use belief::{Belief, Density};
pub use bits::{BitReader, BitString, BitWriter, CodecError};
pub use cell::Cell;
pub use columns::{Columns, ColumnsMut};
pub use dynamics::{Dynamics, GaussianDynamics, LinearDynamics};
pub use error::Error;
pub use evolution::Evolution;
pub use factor::{Factor, Tilted};
pub use fewbits_numerics::ArgumentError;
pub use full_value::{FullValue, SentValue};
pub use gaussian::{FactoredGaussian, Gaussian};
pub use likelihood::{Likelihood, Observed};
pub use measurement_noise::MeasurementNoise;
pub use message::Message;
pub use number::NumberFormat;
pub use observation::{Link, Observation};
pub use on_axes::OnAxes;
pub use scheme::{Deterministic, Memoryless, Scheme};
pub use sensing::{LinearSensing, Sensing};
pub use sensor_node::{SchemeNode, SensorNode};
pub use sign::Sign;
pub use {nalgebra, rand};
