//! The sensor's part of all schemes, for microcontrollers: without the standard library, allocation or panics.
//!
//! A sensor's part takes a sample, and in some schemes a broadcast value, and returns a word, a packet or nothing. The receiver's part
//! needs the standard library and is in the crates of the estimators. These call the functions
//! of this crate, so that simulation and firmware run the same code.
//!
//! ```
//! use fewbits_node::adaptive::{Config, Encoder};
//! use fewbits_node::{Quantizer, sign_bit};
//!
//! // One bit: a 12-bit converter's code against a threshold. No floating point.
//! assert!(sign_bit(2050_u16, 2048)?);
//!
//! // Two bits: the cell of a quantizer that was designed beforehand, again in codes.
//! let quantizer = Quantizer::new(&[1000_u16, 2048, 3000], &[0, 1, 3, 2], 2)?;
//! assert_eq!(quantizer.word(2050)?, 3);
//!
//! // Any signal within 0.05: the encoder holds 3.2 KB; silence costs nothing.
//! let mut encoder = Encoder::new(Config::new(0.05)?);
//! let first = encoder.encode(20.0)?;
//! assert!(first.is_some() && encoder.encode(20.01)?.is_none());
//! # Ok::<(), fewbits_node::Error>(())
//! ```
//!
//! | scheme | function | estimator |
//! |---|---|---|
//! | sign bit at a threshold | [`sign_bit`] | `dymbo` |
//! | index of the innovation's quantizer cell | [`innovation_cell`], [`innovation_cell_of_codes`] | `dymbo` |
//! | quantizer with a word per cell | [`Quantizer`], [`cell_of`] | `quantizers`, `quantizer-design` |
//! | bit of a binary pattern | [`pattern_bit`] | `binary-patterns` |
//! | quantizer level of a range | [`range_level`], [`range_level_of_codes`] | `pf-mpa` |
//! | censoring, threshold scheduled or broadcast | [`censor::speaks`], [`censor::speaks_of_codes`], [`censor::half_width`] | `cfwmd` |
//! | censoring by the sensor's own filter | [`censor::OwnFilter`] | `cfwmd` |
//! | random trigger | [`trigger::speaks`] | `cfwmd` |
//! | adaptive encoder | [`adaptive::Encoder`] | `adaptive` |
//!
//! **Thresholds have the type of the samples.** If a sample is an integer code of a converter, it is compared with integer codes. Sign
//! bits, words, bits of patterns and censoring sensors then need no floating point. Only the level of a range, a sensor's own filter, the
//! trigger and the adaptive encoder compute in floating point. They use IEEE arithmetic, square roots and powers that give the same bits
//! on every machine; [`golden`] has inputs and messages to check that.
//!
//! Not here: the estimators that use the reports, frames and resynchronisation (`fewbits-protocol`), radio, storage.

#![no_std]

#[cfg(any(feature = "std", test))]
extern crate std;

pub mod adaptive;
pub mod censor;
pub mod elementary;
mod error;
pub mod golden;
mod math;
mod packet;
mod quantizer;
mod range_level;
mod sample;
pub mod trigger;

pub use error::Error;
pub use packet::Packet;
pub use quantizer::{Quantizer, cell_of, innovation_cell, innovation_cell_of_codes, pattern_bit, sign_bit};
pub use range_level::{edge, range_level, range_level_of_codes};
pub use sample::Sample;
