//! Real signals within a guaranteed error: figures.

mod baselines;
mod bits;
mod codecs;
mod loss;
mod models;
mod packets;
mod recordings;
mod tracking;

use crate::AnyFigure;

/// The figures of this system.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &bits::Bits,
        &packets::Packets,
        &models::Models,
        &loss::Loss,
        &codecs::Codecs,
    ]
}
