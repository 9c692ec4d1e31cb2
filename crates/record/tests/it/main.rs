//! The integration tests of this crate, one binary.

mod common;
mod damage;
mod frames;
mod guarantee;
mod random;
mod reading;
mod resuming;
mod times;
