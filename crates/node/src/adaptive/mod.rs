//! The adaptive encoder: any signal within a guaranteed error, in few bits.
//!
//! Sensor and receiver run the same bank of models and hold the same frequencies of past reports. Silence means that the sample is
//! within `delta` of what both predict; otherwise the residual is coded under the law that both predict for it. This module has what both
//! hold ([`Replica`], [`Law`]) and the sensor's half ([`Encoder`]); the receiver's half stands in `fewbits-adaptive`.
//!
//! Replicas hold integers: reconstructions lie on a lattice through the first sample, and both ends update from the same indices by
//! arithmetic that is the same on every machine.

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
pub use bank::{Ahead, Bank};
pub use config::Config;
pub use counts::{CAPACITY, REPORTED, Residuals, Values};
pub use encoder::{Encoder, MODEL_BITS, Report, header, is_scheduled, next_sequence};
pub use family::{MODELS, SCALES};
pub use lattice::Lattice;
pub use law::{ESCAPE, Law, PRECISION, Place, REACH};
pub use replica::{Replica, Slot};
pub use report::{Content, push};
