//! Quantizers for estimation from few bits.
pub mod assignment;
pub mod binary;
pub mod error;
pub use error::Error;
