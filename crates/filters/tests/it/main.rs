//! Filters against independent truth.

mod particle;
mod rao_blackwell;
mod resample;
mod tangent;
