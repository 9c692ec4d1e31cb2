//! Censoring sensors, and a fusion centre that hears their silence.
pub mod ellipsoid;
mod error;
pub mod silence;
pub mod threshold;
pub use error::Error;
