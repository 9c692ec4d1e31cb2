//! Scalar quantizers for sensors: their cells and labels, the binary words of the levels, discrete channels, and
//! Lloyd-Max tables.
//!
//! | module | what it holds |
//! |---|---|
//! | [`quantizer`] | breakpoints, cells, labels; the factor of a received symbol |
//! | [`labelling`] | the binary word of each level; the report |
//! | [`channel`] | discrete channels from levels to symbols |
//! | [`sensor`] | all of these as a [`Scheme`](fewbits_core::Scheme) for every filter |
//! | [`lloyd_max`], [`density`] | quantizers of smallest squared error for one scalar |
//!
//! Design rule: **edges are treated in the same way everywhere.** A cell is `[lower, upper)`, a sample on a breakpoint is in the
//! cell above it, and NaN is a typed error, never a level. A quantizer, its likelihood and its tables therefore agree about
//! each level, and a sensor that fails to measure sends no level. In exchange, `encode` returns a `Result`.
//!
//! ```
//! use fewbits_core::Message;
//! use fewbits_quantizers::{Labelling, Quantizer, Symbol, lloyd_max};
//!
//! // Three bits for a measurement of mean 20 and standard deviation 4; neighbouring words differ in one bit.
//! let quantizer = Quantizer::from(&lloyd_max::gaussian(8)?.affine(20.0, 4.0)?);
//! let gray = Labelling::gray(8)?;
//! let word = Symbol(quantizer.encode(23.1)?).to_bits(&gray)?;
//! assert_eq!(word.bits(), 3);
//! let level = Symbol::from_bits(&gray, &word)?.0;
//! assert!(quantizer.cell(level).is_some_and(|cell| cell.contains(23.1)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not in this crate: the design of several quantizers together (`fewbits-quantizer-design`), random numbers, vector quantizers,
//! variable-length codes.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod channel;
pub mod density;
pub mod labelling;
pub mod lloyd_max;
pub mod quantizer;
pub mod sensor;

mod canonical;
mod error;

pub use canonical::canonical;
pub use channel::Channel;
pub use error::Error;
pub(crate) use error::refuse;
pub use labelling::{Labelling, Symbol};
pub use lloyd_max::LloydMax;
pub use quantizer::Quantizer;
pub use sensor::QuantizingSensor;
