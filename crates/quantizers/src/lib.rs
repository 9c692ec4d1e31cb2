//! The scalar quantizer that a sensor holds: cells and labels, the words on the wire, the channel they cross, Lloyd-Max tables.
//!
//! Not here: the design of several quantizers together (`fewbits-quantizer-design`), random numbers, vector quantizers,
//! variable-length codes.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod channel;
pub mod labelling;
pub mod lloyd_max;
pub mod quantizer;

mod error;

pub use channel::Channel;
pub use error::Error;
pub use labelling::{Labelling, Symbol};
pub use quantizer::Quantizer;
