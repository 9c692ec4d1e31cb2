//! Searches, rules and envelopes in rooms: the medium is a field on a grid.

use super::joint;
use fewbits_core::{Belief, Gaussian};
use fewbits_diffusion::{FluxRule, Plan, PotentialFlow, SensorField, Transport};
use fewbits_diffusive::density::CellOptions;
use fewbits_diffusive::{
    Envelope, Error, Form, Outcome, Posterior, Prior, Search, SearchBox, SearchField, SelectionRule, SourceLikelihood,
    SourceSensor, Status,
};
use fewbits_models::SourceModel;
use fewbits_models::diffusion::{Air, Ground};
use fewbits_monte_carlo::Stream;
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Matrix2, Vector2, Vector3};
use std::sync::Arc;

/// Two rooms and a corridor, 6 m by 4 m; wind from the left to the right of the corridor.
const PLAN: &str = "
############
.....#.....#
.....#.....#
.....#.....#
###.###.####
I..........O
I..........O
############";

/// In the left room.
const SOURCE: [f64; 2] = [1.4, 1.2];
const ROOMS: SearchBox = SearchBox {
    lower: [0.0; 2],
    upper: [6.0, 4.0],
};

/// Places of sensors, on a lattice over the free squares.
fn places() -> Vec<Vector2<f64>> {
    let squares: Vec<Vec<char>> = PLAN.trim().lines().map(|line| line.chars().collect()).collect();
    let free = |x: usize, y: usize| squares[y][x] != '#';
    let all = (0..8).flat_map(|y| (0..12).map(move |x| [x, y]));
    let free = all.filter(|[x, y]| free(*x, *y));
    free.map(|[x, y]| Vector2::new(0.5 * x as f64 + 0.3, 0.5 * y as f64 + 0.2))
        .collect()
}

/// What the sensors measure, by squares in `split` by `split` cells.
fn field(split: usize) -> Arc<SensorField> {
    let domain = Plan::parse(PLAN).unwrap().domain(0.5, split, 0.0).unwrap();
    let wind = PotentialFlow::new(&domain, 0.05).unwrap().flow;
    let transport = Transport::new(domain, 0.05, &wind, 0.0, FluxRule::default()).unwrap();
    let points: Vec<[f64; 3]> = places().iter().map(|p| [p.x, p.y, 0.0]).collect();
    Arc::new(SensorField::steady(&transport, &points).unwrap())
}

/// Five readings of the steady field; the median concentration is about 3.
fn sensor(model: impl SourceModel + Send + Sync + 'static) -> SourceSensor {
    SourceSensor::new(model, vec![1.0, 2.0, 3.0, 4.0, 5.0], 0.1).unwrap()
}

/// What a node reads of the true field.
fn reading(truth: &SourceSensor, seed: u64, node: usize, place: &Vector2<f64>) -> Result<Vec<f64>, Error> {
    let mut rng = Stream::new(seed).indexed(node as u64).rng();
    truth.sample(&mut rng, place, &Vector2::from(SOURCE), 1.0)
}

fn run(seed: u64, model: &SourceSensor, truth: &SourceSensor, change: impl FnOnce(&mut Search)) -> Outcome {
    let deployed = Deployment::given(places()).unwrap();
    let graph = Graph::within(deployed.positions(), 1.2).unwrap();
    let alarm = Vector2::new(5.3, 2.7);
    let mut search = Search::new(&alarm, 3.0, ROOMS, joint(), 1e-5).unwrap();
    search.max_nodes = 12;
    change(&mut search);
    let start = deployed.nearest_to(&alarm);
    let nodes = SearchField::new(model.clone(), deployed, graph).unwrap();
    let asked = |node: usize| reading(truth, seed, node, &nodes.deployment().positions()[node]);
    search.run(&nodes, start, asked).unwrap()
}

#[test]
fn every_rule_finds_the_source_behind_the_wall() {
    let model = sensor(field(2));
    for rule in [SelectionRule::MutualInformation, SelectionRule::CramerRao] {
        let outcome = run(1, &model, &model, |search| search.rule = rule);
        let error = (outcome.estimate().unwrap().mean() - Vector2::from(SOURCE)).norm();
        assert!(error < 0.25, "{rule:?}: {:?} {error}", outcome.status);
    }
}

#[test]
fn every_form_travels_through_rooms() {
    let model = sensor(field(2));
    for form in [Form::Raw, Form::Mixture(4)] {
        let outcome =
            run(2, &model, &model, |search| (search.form, search.rule) = (form, SelectionRule::MutualInformation));
        let error = (outcome.estimate().unwrap().mean() - Vector2::from(SOURCE)).norm();
        assert!(error < 0.5, "{form:?}: {:?} {error}", outcome.status);
    }
}

#[test]
fn free_space_is_refused_in_rooms() {
    let truth = sensor(field(2));
    let air = Air::new(0.05, Vector3::new(0.05, 0.0, 0.0), Ground::None)
        .unwrap()
        .with_closest(0.1)
        .unwrap();
    let mut refused = 0;
    for seed in 0..2 {
        let outcome = run(seed, &sensor(air), &truth, |search| search.max_nodes = 8);
        let error = outcome
            .estimate()
            .map_or(f64::INFINITY, |e| (e.mean() - Vector2::from(SOURCE)).norm());
        assert!(outcome.status != Status::Converged || error < 0.5, "{seed}: {error}");
        refused += usize::from(outcome.status == Status::Misfit);
    }
    assert_eq!(refused, 2);
}

#[test]
fn exceedance_follows_the_field_of_the_rooms() {
    let model = sensor(field(2));
    let source = Vector2::from(SOURCE);
    let all = places();
    let records = all
        .iter()
        .step_by(5)
        .map(|place| model.record(place, &model.responses(place, &source).unwrap()).unwrap());
    let likelihood = SourceLikelihood::new(records.collect(), joint()).unwrap();
    let prior = Prior::Exact(Gaussian::new(source, Matrix2::identity() * 4.0).unwrap());
    let posterior = Posterior::new(&prior, &likelihood, &ROOMS, None, &CellOptions::default()).unwrap();
    assert!((posterior.cells.mean() - source).norm() < 0.1);
    let area = Envelope::new(&posterior, &likelihood).unwrap();
    for place in all.iter().skip(2).step_by(7) {
        let truth = model.responses(place, &source).unwrap()[0];
        let above = |share: f64| area.exceedance(place, 5.0, share * truth).unwrap();
        assert!(above(0.8) > 0.95 && above(1.25) < 0.05, "{place}: {} {}", above(0.8), above(1.25));
    }
    assert!(matches!(area.reach(&source, 0.0, 5.0, 1.0, 0.5), Err(Error::Argument(e)) if e.name == "model"));
}
