//! Censoring sensors, and a fusion centre that hears their silence.
pub mod assumed_density;
pub mod ellipsoid;
mod error;
pub mod information;
pub mod message;
pub mod network;
pub mod particle;
pub mod rule;
pub mod silence;
pub mod threshold;
pub mod trigger;
pub use error::Error;
