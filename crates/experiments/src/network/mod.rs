//! All schemes over one simulated network: figures.

pub(crate) mod faults;
pub(crate) mod frontier;
pub mod receivers;
pub mod schemes;
pub mod worlds;
