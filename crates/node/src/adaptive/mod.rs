//! The adaptive encoder: codes a signal within a guaranteed error in few bits, without training.
//!
//! Sensor and receiver run the same bank of models and hold the same frequencies of past reports. Silence means that the sample is
//! within `delta` of the prediction of both. Otherwise the residual is coded under the probability law that both compute. This module has
//! the shared state ([`Replica`], [`Law`]) and the sensor's half ([`Encoder`]); the receiver's half is in `fewbits-adaptive`.
//!
//! The shared state is updated only by integers: reconstructions lie on a lattice through the first sample. Both ends use arithmetic that
//! gives the same bits on every machine.

mod bank;
mod config;
mod counts;
mod encoder;
mod family;
mod lattice;
mod law;
mod replica;
mod report;
mod steady;
#[cfg(feature = "serde")]
mod stored;

pub use crate::packet::{TENS, push_number};
pub use bank::Bank;
pub use config::Config;
pub use encoder::{Encoder, MODEL_BITS, Report, is_scheduled, next_sequence};
pub use family::{MODELS, SCALES};
pub use lattice::Lattice;
pub use law::{ESCAPE, Law, PRECISION, Place, REACH};
pub use replica::{Replica, Slot};
pub use report::Content;
