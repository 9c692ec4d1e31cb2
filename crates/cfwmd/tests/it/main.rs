//! Censoring and fusion against independent truth.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used)]

mod fixtures;
mod fusion;
mod messages;
mod no_feedback;
mod silence;
