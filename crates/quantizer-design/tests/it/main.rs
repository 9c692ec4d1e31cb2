//! Integration tests of the quantizer-design crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod laws;
mod mi_fixtures;
mod scale;
