//! Hand-overs against the Kalman filter, bounds against exact discrete chains, bad input.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod chains;
mod filter;
mod wild;
