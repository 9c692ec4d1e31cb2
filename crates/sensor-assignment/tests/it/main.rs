//! Integration tests of the sensor-assignment crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod costs;
#[path = "../../../binary-patterns/tests/it/entry.rs"]
mod entry;
mod fixtures;
mod laws;
mod wild;
