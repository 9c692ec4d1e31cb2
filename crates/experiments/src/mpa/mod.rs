//! Tracking from quantized ranges, particle message passing and what does better: figures and tables.

mod ablation;
mod association;
mod bound;
mod encoder;
mod fig3_3;
mod leader;
mod scores;
mod sweeps;
mod world;

use crate::AnyFigure;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &fig3_3::Fig33,
        &sweeps::Mse,
        &sweeps::Fig34,
        &sweeps::Fig35,
        &sweeps::Low,
        &association::Fig37,
        &association::Table,
        &ablation::Ablation,
        &bound::Bounds,
        &encoder::Encoders,
        &leader::Leaders,
    ]
}
