//! The scalar quantizer that a sensor holds: its cells and labels, the words on the wire, the channel they cross, and the
//! Lloyd-Max tables.
//!
//! | module | what it holds |
//! |---|---|
//! | [`quantizer`] | breakpoints, cells, labels; the factor of a received symbol |
//! | [`labelling`] | which binary word stands for which level; the report |
//! | [`channel`] | discrete channels from levels to symbols |
//! | [`sensor`] | all of these as a [`Scheme`](fewbits_core::Scheme), ready for every filter |
//! | [`lloyd_max`], [`density`] | least squared error for one scalar |
//!
//! The central choice: **one rule for edges, everywhere.** A cell is `[lower, upper)`, a sample on a breakpoint belongs to the
//! cell above it, and NaN is a typed error, never a level. So a quantizer, its likelihood and its tables cannot disagree about
//! what a level means, and a sensor that fails to measure cannot seem to have measured. The price is that `encode` returns a
//! `Result`.
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
//! Not here: the design of several quantizers together (`fewbits-quantizer-design`), random numbers, vector quantizers,
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
