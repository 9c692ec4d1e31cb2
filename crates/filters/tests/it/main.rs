//! Filters against independent truth.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used)]

mod contract;
mod failure;
mod imm;
mod particle;
mod rao_blackwell;
mod resample;
mod state_noise;
mod stored;
mod tangent;
mod wild;
