//! The sensor's halves of all schemes, for microcontrollers: without the standard library, without allocation, without panics.
//!
//! A sensor's half takes a sample, and perhaps what was broadcast, and returns a word, a packet or nothing. What the report means is
//! known to the receiver's half, which needs the standard library and stands in the crates of the estimators; these call the functions
//! here, so that simulation and firmware run the same code.
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
//! | word of the innovation | [`innovation_cell`], [`innovation_cell_of_codes`] | `dymbo` |
//! | quantizer with words | [`Quantizer`], [`cell_of`] | `quantizers`, `quantizer-design` |
//! | bit of a pattern | [`pattern_bit`] | `binary-patterns` |
//! | level of a range | [`range_level`], [`range_level_of_codes`] | `pf-mpa` |
//! | censoring with a scheduled or told threshold | [`censor::speaks`], [`censor::speaks_of_codes`], [`censor::half_width`] | `cfwmd` |
//! | censoring by an own filter | [`censor::OwnFilter`] | `cfwmd` |
//! | random trigger | [`trigger::speaks`] | `cfwmd` |
//! | adaptive encoder | [`adaptive::Encoder`] | `adaptive` |
//!
//! The central choice: **thresholds are of the samples' own type.** A sample that is a code of a converter is compared with codes, so a
//! sign bit, a word, a bit of a pattern and a censoring sensor need no floating point. Only the level of a range, the own filter, the
//! trigger and the adaptive encoder compute, and they use IEEE arithmetic, square roots and powers that are the same on every
//! machine: [`golden`] has inputs and messages to check that against.
//!
//! Not here: what a report means (the estimators), frames and resynchronisation (the protocol), radio, storage.

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
