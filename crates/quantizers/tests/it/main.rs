//! Integration tests of the quantizers crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod laws;
mod wild;
