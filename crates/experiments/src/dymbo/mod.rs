//! The Dymbo filter: figures and tables.

mod bits;
mod common;
mod fig3;
mod fig4;
mod fig5;
mod gap;
mod prop1b;
mod prop2;
mod selftuning;
mod threshold;

use crate::AnyFigure;

/// The figures of this system, in the order of the publication; our own last.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &fig3::KalmanVariance,
        &fig4::Loss,
        &fig5::Convergence,
        &prop1b::PosteriorShape,
        &prop2::FirstMessage,
        &threshold::ThresholdPlace,
        &gap::GapToExact,
        &bits::WordLength,
        &selftuning::SelfTuning,
    ]
}
