//! Whole searches.

use super::{RULES, field, joint, sensor};
use fewbits_baselines::diffusive::{lpg, particles};
use fewbits_diffusive::message::{SampleCode, Wire};
use fewbits_diffusive::{
    Envelope, Form, Outcome, RateModel, Search, SearchField, SelectionRule, Selector, SourceLikelihood, Status,
};
use fewbits_monte_carlo::Stream;
use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;

const SOURCE: [f64; 2] = [62.0, 50.0];

pub fn run(seed: u64, unit: f64, windy: bool, nodes: usize, change: impl FnOnce(&mut Search)) -> Outcome {
    let mut rng = Stream::new(seed).rng();
    let alarm = Vector2::new(44.396, 52.042) * unit;
    let deployed = Deployment::uniform(&mut rng, [0.0; 2], [100.0 * unit; 2], nodes).unwrap();
    let start = deployed.nearest_to(&alarm);
    let deployed = deployed.with_moved(start, alarm).unwrap();
    let graph = Graph::within(deployed.positions(), 15.0 * unit).unwrap();
    let sensor = sensor(unit, windy);
    let mut search = Search::new(&alarm, 50.0 * unit, field(unit), joint(), 1e-5 * unit.powi(4)).unwrap();
    change(&mut search);
    let source = Vector2::from(SOURCE) * unit;
    let field = SearchField::new(sensor.clone(), deployed, graph).unwrap();
    search
        .run(&field, start, |node| sensor.sample(&mut rng, &field.deployment().positions()[node], &source, 1.0))
        .unwrap()
}

fn error(outcome: &Outcome) -> f64 {
    (outcome.estimate().unwrap().mean() - Vector2::from(SOURCE)).norm()
}

#[test]
fn every_form_and_rule_finds_the_source() {
    for (form, rate, rule, windy) in [
        (Form::Raw, joint(), SelectionRule::MutualInformation, false),
        (Form::Raw, joint(), SelectionRule::MutualInformation, true),
        (Form::Mixture(4), joint(), SelectionRule::CramerRao, false),
        (Form::Mixture(4), joint(), SelectionRule::Covariance, false),
        (lpg::<2, 5>(), RateModel::Known(1.0), SelectionRule::Mahalanobis, false),
        (lpg::<2, 5>(), joint(), SelectionRule::PairwiseInformation, false),
        (particles::<25>(), RateModel::Known(1.0), SelectionRule::MutualInformation, false),
    ] {
        let outcome = run(3, 1.0, windy, 300, |search| {
            (search.form, search.rate, search.rule) = (form, rate, rule);
        });
        assert_eq!(outcome.status, Status::Converged, "{form:?} {rule:?}");
        assert!(error(&outcome) < 0.5, "{form:?} {rule:?}: {}", error(&outcome));
        assert!(outcome.bits() > 0 && outcome.steps[0].bits == 0 && outcome.steps[0].hops == 0);
    }
}

#[test]
fn a_search_does_not_depend_on_the_unit() {
    let route = |unit| {
        run(4, unit, false, 300, |_| ())
            .steps
            .iter()
            .map(|s| s.node)
            .collect::<Vec<_>>()
    };
    assert_eq!(route(1e4), route(1.0));
    assert_eq!(route(1e-4), route(1.0));
}

#[test]
fn quantised_samples_serve_as_well() {
    let nine = Wire {
        samples: Some(SampleCode { bits: 9, step: 1.0 }),
        ..Wire::default()
    };
    let outcome = run(3, 1.0, false, 300, |search| search.wire = nine);
    assert_eq!(outcome.status, Status::Converged);
    assert!(error(&outcome) < 0.5);
    let expected: usize = outcome
        .steps
        .iter()
        .enumerate()
        .skip(1)
        .map(|(i, step)| (11 + 54 * i) * step.hops)
        .sum();
    assert_eq!(outcome.bits(), expected);
}

#[test]
fn disconnected_networks_end_with_a_status() {
    let outcome = run(5, 1.0, false, 8, |_| ());
    assert_eq!(outcome.status, Status::Exhausted);
    let alone = run(5, 1.0, false, 1, |_| ());
    assert_eq!((alone.status, alone.steps.len()), (Status::Exhausted, 1));
}

#[test]
fn a_source_outside_the_box_ends_with_a_status() {
    let outcome = run(6, 1.0, false, 300, |search| {
        search.search.lower = [0.0, 0.0];
        search.search.upper = [56.0, 100.0];
    });
    let told = matches!(
        outcome.status,
        Status::OutsideField
            | Status::BeliefMiss
            | Status::Misfit
            | Status::NodeLimit
            | Status::Exhausted
            | Status::Unresolved
    );
    assert!(told, "{:?}", outcome.status);
}

#[test]
fn a_stalled_search_turns_to_information() {
    let nodes = |stall| {
        let all: Vec<usize> = (0..6)
            .map(|seed| {
                run(seed, 1.0, true, 300, |search| {
                    (search.rule, search.stall, search.max_nodes) = (SelectionRule::Mahalanobis, stall, 20);
                })
                .steps
                .len()
            })
            .collect();
        all.iter().sum::<usize>()
    };
    assert!(nodes(Some(3)) <= nodes(None));
}

#[test]
fn envelopes_are_between_certainties() {
    let outcome = run(3, 1.0, false, 300, |_| ());
    let likelihood = SourceLikelihood::new(outcome.records.clone(), joint()).unwrap();
    let area = Envelope::new(outcome.posterior.as_ref().unwrap(), &likelihood).unwrap();
    let radius = fewbits_models::diffusion::contour_radius(1.0, 1e-4, 100.0, 40.0).unwrap();
    let (low, middle, high) = (
        area.reach(&Vector2::from(SOURCE), 0.0, 100.0, 1e-4, 0.001)
            .unwrap()
            .unwrap(),
        area.reach(&Vector2::from(SOURCE), 0.0, 100.0, 1e-4, 0.5)
            .unwrap()
            .unwrap(),
        area.reach(&Vector2::from(SOURCE), 0.0, 100.0, 1e-4, 0.999)
            .unwrap()
            .unwrap(),
    );
    assert!(low < middle && middle < high && low < radius && radius < high, "{low} {middle} {high} {radius}");
    let inside = area.exceedance(&Vector2::new(62.0, 55.0), 100.0, 1e-4).unwrap();
    let outside = area.exceedance(&Vector2::new(5.0, 5.0), 100.0, 1e-4).unwrap();
    assert!(inside > 0.999 && outside < 1e-6);
    let edge = area
        .exceedance(&Vector2::new(SOURCE[0] + middle, SOURCE[1]), 100.0, 1e-4)
        .unwrap();
    assert!((edge - 0.5).abs() < 0.05, "{edge}");
}

/// Erratum `diffusive-8`.
#[test]
fn selectors_score_candidates() {
    let outcome = run(3, 1.0, false, 300, |search| search.max_nodes = 2);
    let posterior = outcome.posterior.unwrap();
    let estimate = posterior.gaussian();
    let score = |rule, x: f64| {
        let selector = Selector::new(rule, &posterior, &estimate, &joint()).unwrap();
        selector.score(&sensor(1.0, false), &Vector2::new(x, 50.0))
    };
    for x in [48.0, 56.0, 70.0] {
        // Of the same belief, though over fewer points.
        let (lower, exact, upper) = (
            score(SelectionRule::PairwiseInformation, x),
            score(SelectionRule::ExactInformation, x),
            score(SelectionRule::MutualInformation, x),
        );
        assert!(lower < exact + 0.1 && exact < upper + 0.1, "{lower} {exact} {upper}");
    }
    for rule in RULES {
        let selector = Selector::new(rule, &posterior, &estimate, &joint()).unwrap();
        assert_eq!(selector.best(&sensor(1.0, false), &[]), None);
        for x in [-1e6, 0.0, 44.0, 62.0, 1e6] {
            assert!(!selector.score(&sensor(1.0, false), &Vector2::new(x, 50.0)).is_nan(), "{rule:?} {x}");
        }
    }
}
