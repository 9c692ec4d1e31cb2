//! Design and decoding of scalar and binary quantizers for distributed estimation.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod assignment;
pub mod binary;
pub mod lloyd_max;

mod error;

pub use error::Error;
