//! Tracking from quantized ranges, particle message passing and what does better: figures and tables.

pub(crate) mod ablation;
pub(crate) mod association;
pub(crate) mod bound;
pub(crate) mod encoder;
pub(crate) mod fig3_3;
pub(crate) mod leader;
mod scores;
pub(crate) mod sweeps;
mod world;
