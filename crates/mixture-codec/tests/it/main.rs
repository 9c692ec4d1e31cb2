//! Tests of the public interface.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod clumps;
#[path = "../../../densities/tests/it/common.rs"]
mod common;
mod fixtures;
mod merging;
mod reduction;
mod wild;
mod wire;
