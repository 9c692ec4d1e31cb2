//! Tests of the search for a diffusive source.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a panic is how a test fails"
)]

mod any_model;
mod attacks;
mod cells;
mod clumps;
#[path = "../../../models/tests/it/diffusion_entries.rs"]
mod diffusion_entries;
mod envelopes;
mod fit;
mod fixtures;
mod forms;
mod gridded;
mod laplace;
mod laws;
mod messages;
mod searches;
mod series;
mod slices;
mod unknown_models;
mod wild;

use fewbits_diffusive::{RateModel, RateRange, SearchBox, SelectionRule, SourceSensor};
use fewbits_models::diffusion::{Air, Ground};
use nalgebra::Vector3;

/// The rules that searches choose by.
const RULES: [SelectionRule; 5] = [
    SelectionRule::MutualInformation,
    SelectionRule::PairwiseInformation,
    SelectionRule::CramerRao,
    SelectionRule::Mahalanobis,
    SelectionRule::Covariance,
];

/// The air of example B of the paper, in other units of length if asked for.
fn air(unit: f64, windy: bool) -> Air {
    let wind = if windy {
        Vector3::new(-20.0 * unit, -10.0 * unit, 0.0)
    } else {
        Vector3::zeros()
    };
    Air::new(40.0 * unit * unit, wind, Ground::Impermeable)
        .unwrap()
        .with_closest(1e-3 * unit)
        .unwrap()
}

/// Example B.
fn sensor(unit: f64, windy: bool) -> SourceSensor {
    let noise = 8e-6 / unit.powi(3);
    SourceSensor::new(air(unit, windy), vec![5.0, 10.0, 15.0, 20.0, 25.0], noise)
        .unwrap()
        .with_reach(250.0 * unit)
        .unwrap()
}

fn joint() -> RateModel {
    RateModel::Joint(RateRange::new(0.5, 1.5).unwrap())
}

fn field(unit: f64) -> SearchBox {
    SearchBox {
        lower: [-20.0 * unit; 2],
        upper: [120.0 * unit; 2],
    }
}
