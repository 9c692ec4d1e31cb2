//! All schemes over one simulated network: figures.

mod faults;
mod frontier;
pub mod receivers;
pub mod schemes;
pub mod worlds;

use crate::AnyFigure;

/// The figures of this system.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![&frontier::Frontier, &faults::Faulty]
}
