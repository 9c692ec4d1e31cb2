//! Tests of the public interface.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beliefs;
mod common;
mod grids;
mod laws;
mod particles;
mod wild;
