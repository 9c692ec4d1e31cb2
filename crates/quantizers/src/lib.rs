//! Design and decoding of scalar and binary quantizers for distributed estimation.

pub mod lloyd_max;

mod error;

pub use error::Error;
