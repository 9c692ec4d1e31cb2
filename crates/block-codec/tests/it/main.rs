//! Tests of the public interface.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod blocks;
mod common;
mod golden;
mod levels;
mod tables;
