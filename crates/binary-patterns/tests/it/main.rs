//! Integration tests of the binary-patterns crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bounds;
mod entry;
mod fixtures;
mod patterns;
mod wild;
