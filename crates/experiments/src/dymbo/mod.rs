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
mod referee;
mod sensors;
mod smoother;
mod threshold;
mod vector;

use crate::AnyFigure;
use crate::legacy::Old;

/// The figures of this system, in the order of the publication; our own last.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &Old(fig3::KalmanVariance),
        &Old(fig4::Loss),
        &Old(fig5::Convergence),
        &Old(prop1b::PosteriorShape),
        &Old(prop2::FirstMessage),
        &Old(threshold::ThresholdPlace),
        &Old(gap::GapToExact),
        &Old(bits::WordLength),
        &Old(bsc::NoisyBits),
        &Old(erasure::LostBits),
        &Old(sensors::SeveralSensors),
        &Old(smoother::Smoothing),
        &Old(vector::VectorState),
    ]
}
