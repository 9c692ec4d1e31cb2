//! Integration tests of the sensor-assignment crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod fixtures;
mod laws;
