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
mod steps;
mod unknown_models;
mod wild;

use fewbits_diffusive::density::CellOptions;
use fewbits_diffusive::{
    Error, Form, ModelGrid, Outcome, Posterior, Prior, RateModel, RateRange, Search, SearchBox, SearchField,
    SelectionRule, SourceLikelihood, SourceSensor,
};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_monte_carlo::Stream;
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector2, Vector3};

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

/// The posterior over the field from a prior and records.
fn posterior_of(prior: &Prior, likelihood: &SourceLikelihood) -> Result<Posterior, Error> {
    Posterior::new(prior, likelihood, &field(1.0), None, &CellOptions::default())
}

/// A search for a source at (62, 50) among `nodes` nodes of a range of `reach`, and how far its estimate is off; NaN without estimate.
fn searched(
    (seed, nodes, reach, threshold): (u64, usize, f64, f64),
    form: Form,
    models: &ModelGrid,
    truth: &SourceSensor,
) -> Result<(Outcome, f64), Error> {
    let mut rng = Stream::new(seed).rng();
    let alarm = Vector2::new(44.396, 52.042);
    let deployed = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], nodes).unwrap();
    let start = deployed.nearest_to(&alarm);
    let graph = Graph::within(deployed.positions(), reach).unwrap();
    let mut search = Search::new(&alarm, 50.0, field(1.0), joint(), threshold)?;
    search.form = form;
    let source = Vector2::new(62.0, 50.0);
    let nodes = SearchField::new(models.clone(), deployed, graph)?;
    let outcome = search
        .run(&nodes, start, |node| truth.sample(&mut rng, &nodes.deployment().positions()[node], &source, 1.0))?;
    let error = outcome.estimate().map_or(f64::NAN, |e| (e.mean() - source).norm());
    Ok((outcome, error))
}
