//! The Dymbo filter: figures and tables.

mod bits;
mod bsc;
mod common;
mod erasure;
mod fig3;
mod fig4;
mod fig5;
mod gap;
mod prop1b;
mod prop2;
mod selftuning;
mod sensors;
mod smoother;
mod threshold;
mod vector;

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
        &bsc::NoisyBits,
        &erasure::LostBits,
        &sensors::SeveralSensors,
        &smoother::Smoothing,
        &vector::VectorState,
        &selftuning::SelfTuning,
    ]
}
