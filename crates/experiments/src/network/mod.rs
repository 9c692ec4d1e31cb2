//! All schemes over one simulated network: figures.

mod bill;
mod faults;
mod frontier;
mod lifetime;
mod receivers;
mod scale;
mod schemes;
mod worlds;

use crate::AnyFigure;

/// The figures of this system.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![&frontier::Frontier, &faults::Faulty, &lifetime::Lifetime, &scale::Scale]
}
