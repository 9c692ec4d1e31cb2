//! Hand-overs against the Kalman filter, bad input.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod filter;
mod wild;
