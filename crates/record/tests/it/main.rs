//! The integration tests of this crate, one binary.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod damage;
mod frames;
mod guarantee;
mod random;
mod reading;
mod resuming;
mod times;
