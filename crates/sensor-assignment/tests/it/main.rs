//! Integration tests of the sensor-assignment crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod entry;
mod fixtures;
mod laws;
#[path = "../../../binary-patterns/tests/it/entry.rs"]
mod wild;
