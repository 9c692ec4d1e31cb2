//! Real signals within a guaranteed error: figures.

mod baselines;
mod bits;
mod codecs;
mod loss;
mod packets;
mod recordings;
mod tracking;

use crate::AnyFigure;

/// The figures of this system.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![&bits::Bits, &packets::Packets, &loss::Loss, &codecs::Codecs]
}
