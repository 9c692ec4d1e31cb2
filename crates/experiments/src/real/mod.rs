//! Real signals within a guaranteed error: figures.

mod baselines;
pub(crate) mod bits;
pub(crate) mod codecs;
pub(crate) mod loss;
pub(crate) mod packets;
mod recordings;
mod tracking;
