//! Filters against independent truth.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used)]

mod contract;
mod stored;
mod failure;
mod imm;
mod particle;
mod rao_blackwell;
mod resample;
mod state_noise;
mod tangent;
mod wild;
