//! Censoring sensors, and a fusion centre that hears their silence.
pub mod assumed_density;
pub mod ellipsoid;
mod error;
pub mod information;
pub mod message;
pub mod network;
pub mod no_feedback;
mod no_feedback_particle;
pub mod particle;
pub mod rule;
pub mod schedule;
pub mod silence;
pub mod threshold;
pub mod trigger;
pub use error::Error;
