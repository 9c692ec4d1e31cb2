//! A search as its nodes make it: each decodes a message, makes one step and encodes what it sends on.

use super::{field, joint, sensor};
use fewbits_baselines::diffusive::{LAPLACE, lpg, particles};
use fewbits_core::BitString;
use fewbits_diffusive::message::{SampleCode, Wire};
use fewbits_diffusive::{
    Action, Error, Form, ModelGrid, Outcome, RateModel, Search, SearchField, SelectionRule, SourceChain, Status,
};
use fewbits_monte_carlo::Stream;
use fewbits_protocol::Leader;
use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;

const LPG: Form = lpg::<2, 3>();

struct Place {
    nodes: SearchField,
    start: usize,
    samples: Vec<Vec<f64>>,
}

fn place(count: usize, models: impl Into<ModelGrid>) -> Place {
    let truth = sensor(1.0, false);
    let mut rng = Stream::new(3).rng();
    let alarm = Vector2::new(44.396, 52.042);
    let deployed = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], count).unwrap();
    let start = deployed.nearest_to(&alarm);
    let graph = Graph::within(deployed.positions(), 15.0).unwrap();
    let sampled = |p: &Vector2<f64>| truth.sample(&mut rng, p, &Vector2::new(62.0, 50.0), 1.0).unwrap();
    let samples = deployed.positions().iter().map(sampled).collect();
    let nodes = SearchField::new(models, deployed, graph).unwrap();
    Place { nodes, start, samples }
}

fn search(place: &Place, form: Form, rate: RateModel) -> Search {
    let alarm = place.nodes.deployment().positions()[place.start];
    let mut search = Search::new(&alarm, 50.0, field(1.0), rate, 1e-5).unwrap();
    (search.form, search.max_nodes) = (form, 6);
    search
}

/// Nodes in the order of their visits, with the means after each.
type Visits = Vec<(usize, Vector2<f64>)>;

/// The nodes, estimates and status of a search of which every node knows only the bits that it received; then all messages.
fn by_messages(search: &Search, place: &Place) -> (Visits, Status, Vec<BitString>) {
    let (mut node, mut steps, mut messages) = (place.start, Vec::new(), Vec::new());
    loop {
        let state = match messages.last() {
            None => search.start(&place.nodes).unwrap(),
            Some(bits) => search.decode(&place.nodes, bits).unwrap(),
        };
        let next = search.step(&place.nodes, state, node, &place.samples[node]).unwrap();
        steps.extend(next.step.as_ref().map(|step| (node, *step.estimate.mean())));
        match next.action {
            Action::Ask { node: asked, .. } => {
                messages.push(search.encode(&place.nodes, &next.state).unwrap());
                node = asked;
            }
            Action::End { status, .. } => return (steps, status, messages),
            _ => panic!("unknown action"),
        }
    }
}

fn alone(search: &Search, place: &Place) -> Outcome {
    search
        .run(&place.nodes, place.start, |node| Ok(place.samples[node].clone()))
        .unwrap()
}

#[test]
fn every_form_travels_through_its_messages() {
    let place = place(300, sensor(1.0, false));
    for (form, rate) in [
        (Form::Gaussian, joint()),
        (Form::Mixture(4), joint()),
        (Form::Mixture(3), RateModel::Known(1.0)),
        (LPG, RateModel::Known(1.0)),
        (particles::<25>(), RateModel::Known(1.0)),
        (LAPLACE, RateModel::Known(1.0)),
    ] {
        let search = search(&place, form, rate);
        let (outcome, (steps, status, messages)) = (alone(&search, &place), by_messages(&search, &place));
        let expected: Vec<_> = outcome.steps.iter().map(|s| (s.node, *s.estimate.mean())).collect();
        assert!(steps.len() > 2, "{form:?}");
        assert_eq!((steps, status), (expected, outcome.status), "{form:?}");
        // The belief and the route.
        for (i, message) in messages.iter().enumerate() {
            let per_hop = outcome.steps[i + 1].bits / outcome.steps[i + 1].hops;
            assert_eq!(message.bits(), per_hop + 10 + 9 * (i + 1), "{form:?} {i}");
        }
    }
}

#[test]
fn raw_records_travel_quantised_or_not_and_under_several_models() {
    let code = Some(SampleCode { bits: 9, step: 1.0 });
    let several = ModelGrid::uniform(vec![sensor(1.0, false), sensor(1.0, true)]).unwrap();
    for (models, samples) in [
        (sensor(1.0, false).into(), None),
        (sensor(1.0, false).into(), code),
        (several, code),
    ] {
        let place = place(300, models);
        let mut search = search(&place, Form::Raw, joint());
        search.wire.samples = samples;
        let (outcome, (steps, status, messages)) = (alone(&search, &place), by_messages(&search, &place));
        assert!(steps.len() > 2);
        assert_eq!(status, outcome.status);
        for (step, (node, mean)) in outcome.steps.iter().zip(&steps) {
            assert_eq!(step.node, *node);
            assert!((step.estimate.mean() - mean).norm() < 1e-6, "{}", step.estimate.mean() - mean);
        }
        for (i, message) in messages.iter().enumerate() {
            assert_eq!(message.bits() * outcome.steps[i + 1].hops, outcome.steps[i + 1].bits);
        }
    }
}

/// The determinants that the rule of a stalled search compares travel, too.
#[test]
fn stalled_searches_travel() {
    let place = place(300, sensor(1.0, false));
    let mut search = search(&place, Form::Mixture(4), joint());
    (search.rule, search.stall, search.max_nodes) = (SelectionRule::Mahalanobis, Some(2), 12);
    let outcome = alone(&search, &place);
    let (steps, status, _) = by_messages(&search, &place);
    let expected: Vec<_> = outcome.steps.iter().map(|s| (s.node, *s.estimate.mean())).collect();
    assert_eq!((steps, status), (expected, outcome.status));
}

#[test]
fn other_messages_are_refused() {
    let place = place(300, sensor(1.0, false));
    for form in [Form::Raw, Form::Mixture(2)] {
        let search = search(&place, form, joint());
        let (_, _, messages) = by_messages(&search, &place);
        let bits = &messages[1];
        let cut = |bits: &BitString, n: usize| fewbits_core::BitReader::new(bits).read_message(n).unwrap();
        assert!(search.decode(&place.nodes, &cut(bits, bits.bits() - 1)).is_err());
        let mut long = fewbits_core::BitWriter::new();
        long.append(bits);
        long.write(1, 1).unwrap();
        assert!(search.decode(&place.nodes, &long.finish()).is_err());
        let mut other = search.clone();
        other.form = if form == Form::Raw { Form::Gaussian } else { Form::Raw };
        assert!(other.decode(&place.nodes, bits).is_err());
        // A route of one node twice, or of a node of another field.
        let state = search.decode(&place.nodes, bits).unwrap();
        let before = state.route()[0];
        assert!(
            search
                .step(&place.nodes, state, before, &place.samples[before])
                .is_err()
        );
    }
    let small = Place {
        ..self::place(20, sensor(1.0, false))
    };
    let search = search(&place, Form::Mixture(2), joint());
    let (_, _, messages) = by_messages(&search, &place);
    assert!(search.decode(&small.nodes, &messages[1]).is_err());
}

/// What a message cannot hold is refused before the first node samples.
#[test]
fn limits_of_messages_are_refused_at_the_start() {
    let place = place(40, sensor(1.0, false));
    let refused = |change: fn(&mut Search)| {
        let mut search = search(&place, Form::Raw, RateModel::Known(1.0));
        change(&mut search);
        let asked = std::cell::Cell::new(false);
        let failed = search.run(&place.nodes, place.start, |node| {
            asked.set(true);
            Ok(place.samples[node].clone())
        });
        assert!(!asked.get());
        matches!(failed, Err(Error::Argument(_)))
    };
    assert!(refused(|s| s.form = Form::Mixture(32)));
    assert!(refused(|s| s.form = particles::<32>()));
    assert!(refused(|s| s.form = lpg::<32, 2>()));
    assert!(refused(|s| s.wire.index_bits = 5));
    assert!(refused(|s| s.wire.index_bits = 33));
    assert!(refused(|s| s.wire.samples = Some(SampleCode { bits: 33, step: 1.0 })));
    assert!(refused(|s| s.wire.samples = Some(SampleCode { bits: 9, step: 0.0 })));
    let mut largest = search(&place, Form::Mixture(31), RateModel::Known(1.0));
    largest.max_nodes = 1;
    assert_eq!(alone(&largest, &place).steps.len(), 1);
}

/// A chain that was accepted leads, also with a code of the samples.
#[test]
fn chains_that_are_accepted_lead() {
    let place = place(300, sensor(1.0, false));
    let mut rng = Stream::new(1).rng();
    for samples in [None, Some(SampleCode { bits: 9, step: 1.0 })] {
        for form in [Form::Raw, Form::Mixture(4)] {
            let mut search = search(&place, form, joint());
            search.wire = Wire { samples, ..search.wire };
            let chain = SourceChain::new(search, place.nodes.clone(), place.samples.clone()).unwrap();
            let first = chain.lead(&mut rng, 1, place.start as u32, None).unwrap();
            let second = chain
                .lead(&mut rng, 2, first.next.unwrap(), Some(&first.message))
                .unwrap();
            assert!(second.estimate.iter().all(|x| x.is_finite()));
            assert!(
                chain
                    .lead(&mut rng, 3, place.start as u32, Some(&first.message))
                    .is_err()
            );
        }
    }
    let search = search(&place, Form::Mixture(32), joint());
    assert!(SourceChain::new(search.clone(), place.nodes.clone(), place.samples.clone()).is_err());
    let mut wrong = place.samples.clone();
    wrong[7][2] = f64::NAN;
    let search = self::search(&place, Form::Raw, joint());
    assert!(SourceChain::new(search, place.nodes, wrong).is_err());
}
