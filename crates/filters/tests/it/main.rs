//! Filters against independent truth.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used)]

mod particle;
mod rao_blackwell;
mod resample;
mod tangent;
