//! Design and decoding of scalar and binary quantizers for distributed estimation.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod lloyd_max;

mod error;

pub use error::Error;

pub mod bounds;
pub mod channel;
pub mod decoder;
pub mod design;
pub mod labelling;
pub mod quantizer;
pub mod scene;
pub mod system;
pub mod table;

mod compositions;
mod criterion;
mod moments;
mod newton;
mod problem;

pub use channel::Channel;
pub use criterion::Criterion;
pub use labelling::{Labelling, Symbol};
pub use newton::Newton;
pub use quantizer::Quantizer;
pub use scene::{Noise, Prior, Scene};
pub use system::{Group, System};
pub use table::JointTable;
