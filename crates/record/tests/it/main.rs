//! The integration tests of this crate, one binary.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod aggregates;
mod appending;
#[cfg(feature = "arrow")]
mod arrow;
mod attacks;
mod bounds;
mod common;
mod damage;
mod frames;
mod fuzz;
mod guarantee;
mod integers;
mod random;
mod reading;
mod repacking;
mod resuming;
mod times;
mod versions;
mod whole;
mod wild;
