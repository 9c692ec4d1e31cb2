//! The five data paths of `docs/architecture.md`, each followed once, and the names in that list.

use fewbits::cfwmd::scheme::CovarianceFeedback;
use fewbits::core::{
    Belief, BitString, Gaussian, Link, Message, NumberFormat, Observation, SchemeNode, SensorNode, Sign,
};
use fewbits::densities::Mixture;
use fewbits::diffusive::{Action, RateModel, RateRange, Search, SearchBox, SearchField, SourceSensor};
use fewbits::dymbo::{DymboFilter, ScalarFilter, ScalarPlant, SignBit};
use fewbits::filters::centre::{FusionCentre, Reporting, Slot};
use fewbits::filters::{BootstrapFilter, GridFilter, MomentFilter, ResamplingRule, StateFilter};
use fewbits::handoff::{Coded, HandoffFilter};
use fewbits::link::FusionReceiver;
use fewbits::mixture_codec::Reduction;
use fewbits::mixture_codec::wire::{CodedMixture, WireFormat};
use fewbits::models::diffusion::{Air, Ground};
use fewbits::models::{ContinuousLinear, LinearSensor, PLANE_POSITION};
use fewbits::monte_carlo::Stream;
use fewbits::pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
use fewbits::protocol::{
    self, Action as CentreAction, CentreSettings, CentreTimer, Check, Feedback, Kind, Member, Outcome, Payload,
    ReportLength, Schedule, SensorSettings, Task, predict_and_ask, update_or_drop,
};
use fewbits::topology::{Deployment, Graph};
use nalgebra::{Matrix4, Vector1, Vector2, Vector3, Vector4};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};

/// Path (a): the belief behind frames is that of the closed form.
#[test]
fn a_sample_becomes_a_bit_and_a_belief() {
    let (scheme, start) = (SignBit::new(1.0).unwrap(), Gaussian::scalar(0.3, 2.0).unwrap());
    let world = ContinuousLinear::random_walk(0.5).unwrap();
    let mut centre = FusionCentre::new(&mut Stream::new(1).rng(), world, MomentFilter, &start).unwrap();
    let told = |_: &Gaussian<1>, measured: &Gaussian<1>| measured.mean()[0];
    let sensing = LinearSensor::<1, 1>::direct(1.0).unwrap();
    centre
        .join(0, Reporting::new(sensing, scheme, Link::PERFECT, told))
        .unwrap();
    let mut receiver = FusionReceiver::new(centre, 1.0, Stream::new(2));

    let (feedback, report) = (Feedback::Told, ReportLength::Fixed(1));
    let members = vec![Member { feedback, report }];
    let schedule = Schedule::new(NonZeroU64::new(1000).unwrap());
    let mut machine = protocol::Centre::new(CentreSettings::new(members.clone(), schedule));
    let mut sensor = protocol::Sensor::new(SensorSettings::new(feedback));
    let mut node = SchemeNode::new(scheme);

    let mut actions = Vec::new();
    machine.on_timer(1000, CentreTimer::SlotBegins, &mut actions);
    assert_eq!(actions.pop(), Some(CentreAction::Predict { slot: 1 }));
    actions.clear();
    let (asked, state) = predict_and_ask(&mut receiver, &members, 1).unwrap();
    machine.on_predicted(&asked, state.as_ref(), &mut actions);
    let Some(CentreAction::Send { frame, .. }) = actions.pop() else {
        panic!("no feedback was sent");
    };
    let Task::Sample { feedback, .. } = sensor.on_frame(0, &frame).task else {
        panic!("the sensor was not asked");
    };
    let sample = Vector1::new(1.4);
    let bits = node
        .report(&mut Stream::new(3).rng(), &sample, &feedback.into())
        .unwrap();
    let bits = bits.unwrap();
    let Task::Send(report) = sensor.on_sample(0, Some(Payload::from(&bits))).task else {
        panic!("the sensor was silent");
    };
    assert_eq!((report.kind, bits.bits()), (Kind::Report, 1));
    machine.on_frame(0, &report.to_bytes(Check::Whole), &mut actions);
    machine.on_timer(1900, CentreTimer::Deadline, &mut actions);
    let Some(CentreAction::Update { observed, .. }) = actions.pop() else {
        panic!("no update");
    };
    assert!(matches!(update_or_drop(&mut receiver, &observed), Outcome::Used));

    let closed = DymboFilter::new(ScalarPlant::new(1.0, 0.5, 1.0).unwrap());
    let expected = closed.step(&start, &Observation::Received(Sign::Above)).unwrap().0;
    let found = receiver.centre().estimate();
    assert!((found.mean() - expected.mean()).amax() < 1e-12);
    assert!((found.covariance() - expected.covariance()).amax() < 1e-12);
}

/// A centre of one censoring sensor under a filter, after a slot of silence over a lossy link.
fn silent<F: StateFilter<1>>(filter: F) -> FusionCentre<1, F> {
    let mut rng = Stream::new(4).rng();
    let sensing = LinearSensor::<1, 1>::direct(1.0).unwrap();
    let scheme = CovarianceFeedback::new(sensing, 0.8, NumberFormat::Double).unwrap();
    let (world, prior) = (ContinuousLinear::random_walk(0.5).unwrap(), Gaussian::scalar(0.0, 4.0).unwrap());
    let mut centre = FusionCentre::new(&mut rng, world, filter, &prior).unwrap();
    let ask = |state: &Gaussian<1>, _: &Gaussian<1>| *state;
    let remote = Reporting::new(sensing, scheme.clone(), Link::lossy(0.1).unwrap(), ask);
    centre.join(0, remote).unwrap();
    centre.advance(&mut rng, 1.0).unwrap();
    let told = centre.feedback(0).unwrap();
    let report = SchemeNode::new(scheme)
        .report(&mut rng, &Vector1::new(0.2), &told)
        .unwrap();
    assert_eq!(report, None, "a measurement near its prediction is not sent");
    centre.receive(&mut rng, &[Slot::new(0, told, report.into())]).unwrap();
    centre
}

/// Path (b): silence weighs particles as it conditions a Gaussian.
#[test]
fn a_censored_measurement_weighs_particles() {
    const PARTICLES: usize = 40_000;
    let exact = silent(MomentFilter).estimate();
    let cloud = silent(BootstrapFilter::new(ResamplingRule::default(), PARTICLES).unwrap()).estimate();
    assert!(exact.covariance()[0] < 4.0, "silence tells something");
    // Standard errors of a mean and of a variance of so many draws; the weights lose less than half of them.
    let n = PARTICLES as f64 / 2.0;
    let variance = exact.covariance()[0];
    assert!((cloud.mean()[0] - exact.mean()[0]).abs() < 4.0 * (variance / n).sqrt());
    assert!((cloud.covariance()[0] - variance).abs() < 4.0 * variance * (2.0 / n).sqrt());
}

/// A centre of three range sensors under a filter, after one slot of levels of two bits.
fn ranged<F: StateFilter<4>>(filter: F) -> FusionCentre<4, F> {
    let (noise, loading) = (RangeNoise::constant(0.4).unwrap(), optimal_loading(4).unwrap());
    let scheme = QuantizedRange::new(4, noise).unwrap();
    let prior = Gaussian::new(Vector4::new(9.0, 0.0, 9.0, 0.5), Matrix4::identity() * 0.1).unwrap();
    let (mut rng, world) = (Stream::new(5).rng(), ContinuousLinear::nearly_constant_velocity_2d(0.02).unwrap());
    let mut centre = FusionCentre::new(&mut rng, world, filter, &prior).unwrap();
    let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 16.0]].map(Vector2::from);
    for (number, place) in (0..).zip(places) {
        let sensor = RangeSensor::new(place, noise)
            .unwrap()
            .on_axes::<4>(PLANE_POSITION)
            .unwrap();
        let ask = move |_: &Gaussian<4>, range: &Gaussian<1>| RangeReference::about(range, loading);
        centre
            .join(number, Reporting::new(sensor, scheme.clone(), Link::PERFECT, ask))
            .unwrap();
    }
    centre.advance(&mut rng, 1.0).unwrap();
    let slot = |(number, place): (u32, Vector2<f64>)| {
        let told = centre.feedback(number).unwrap();
        let range = Vector1::new((Vector2::new(9.3, 9.6) - place).norm());
        let report = SchemeNode::new(scheme.clone())
            .report(&mut Stream::new(6).rng(), &range, &told)
            .unwrap();
        assert_eq!(report.as_ref().map(BitString::bits), Some(2));
        Slot::new(number, told, report.into())
    };
    let slots: Vec<_> = (0..).zip(places).map(slot).collect();
    centre.receive(&mut rng, &slots).unwrap();
    centre
}

/// Path (c): a grid and particles take the same levels for the same.
#[test]
fn a_range_becomes_a_level_and_a_belief_on_a_grid() {
    const PARTICLES: usize = 40_000;
    let grid = ranged(GridFilter::new(PLANE_POSITION).unwrap()).estimate();
    let cloud = ranged(BootstrapFilter::new(ResamplingRule::default(), PARTICLES).unwrap()).estimate();
    for axis in PLANE_POSITION {
        let deviation = grid.covariance()[(axis, axis)].sqrt();
        // After the second its variance was .1 + .1 + .02 / 3.
        assert!(deviation < 0.8 * f64::sqrt(0.2 + 0.02 / 3.0), "levels tell something: {deviation}");
        // The effective sample size is a tenth of the particles at least.
        let error = 4.0 * deviation / (PARTICLES as f64 / 10.0).sqrt();
        assert!((grid.mean()[axis] - cloud.mean()[axis]).abs() < error, "{axis}");
    }
}

/// Path (d): the next leader begins with what the bits say, to the bit.
#[test]
fn particles_become_bytes_and_the_next_leader_begins_with_them() {
    let format = WireFormat::new(Vector1::zeros(), 50.0, 1.0, &[0.1]).unwrap();
    let (components, reduction, resolution) = (3, Reduction::default(), 0);
    let reducer = Coded {
        components,
        reduction,
        format: format.clone(),
        resolution,
    };
    let filter = HandoffFilter::new(500, reducer).unwrap();
    let dynamics = ContinuousLinear::random_walk(0.5).unwrap().over(1.0).unwrap();
    let start = Mixture::single(&Gaussian::scalar(0.0, 4.0).unwrap()).unwrap();
    let sensing = LinearSensor::<1, 1>::direct(1.0).unwrap();
    let value = fewbits::core::factor::Value::new(Vector1::new(1.0), [[1.0]].into()).unwrap();
    let observed = fewbits::core::Observed::new(sensing, value);
    let mut rng = Stream::new(7).rng();
    let (sent, info) = filter.step(&mut rng, &start, &dynamics, &observed).unwrap();
    let bits = sent.message().unwrap();
    let received = CodedMixture::from_bits(&format, bits).unwrap().into_mixture();
    assert_eq!(&received, sent.mixture());
    assert!(bits.bits() < 8 * 40 && info.kept > 100, "{} bits", bits.bits());
    // Kalman: N(0, 4.5) with a value of unit noise. The estimate has 500 particles.
    let (gain, variance) = (4.5 / 5.5, 4.5 / 5.5);
    assert!((received.mean()[0] - gain).abs() < 4.0 * (variance / 100.0_f64).sqrt() + 0.1);
    assert!(filter.step(&mut rng, &received, &dynamics, &observed).is_ok());
}

/// Path (e): a search whose nodes know only bits is the search in one memory.
#[test]
fn a_concentration_becomes_a_belief_and_the_next_sensor() {
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable).unwrap();
    let sensor = SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 8e-6).unwrap();
    let mut rng = Stream::new(8).rng();
    let nodes = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300).unwrap();
    let graph = Graph::within(nodes.positions(), 15.0).unwrap();
    let start = nodes.nearest_to(&Vector2::new(44.0, 52.0));
    let source = Vector2::new(62.0, 50.0);
    let taken = |place: &Vector2<f64>| sensor.sample(&mut rng, place, &source, 1.0).unwrap();
    let samples: Vec<_> = nodes.positions().to_vec().iter().map(taken).collect();
    let field = SearchField::new(sensor, nodes, graph).unwrap();
    let everywhere = SearchBox {
        lower: [-20.0; 2],
        upper: [120.0; 2],
    };
    let rate = RateModel::Joint(RateRange::new(0.5, 1.5).unwrap());
    let search = Search::new(&field.deployment().positions()[start], 50.0, everywhere, rate, 1e-5).unwrap();
    let whole = search.run(&field, start, |node| Ok(samples[node].clone())).unwrap();

    let (mut node, mut state, mut visited) = (start, search.start(&field).unwrap(), vec![start]);
    let status = loop {
        let next = search.step(&field, state, node, &samples[node]).unwrap();
        match next.action {
            Action::Ask { node: asked, .. } => node = asked,
            Action::End { status, .. } => break status,
            _ => panic!("another action"),
        }
        visited.push(node);
        let message = search.encode(&field, &next.state).unwrap();
        state = search.decode(&field, &message).unwrap();
    };
    assert_eq!(status, whole.status);
    assert!(visited.len() > 2);
    assert_eq!(visited, whole.steps.iter().map(|step| step.node).collect::<Vec<_>>());
}

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            into.push(path);
        }
    }
}

/// Each name of the list is a type or trait, or a function of one, of some crate.
#[test]
fn the_names_of_the_paths_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let page = std::fs::read_to_string(root.join("docs/architecture.md")).unwrap();
    let list = page
        .split("## Five data paths")
        .nth(1)
        .unwrap()
        .split("\n## ")
        .next()
        .unwrap();
    let lines: Vec<_> = list.lines().filter(|line| line.contains(" -> ")).collect();
    assert_eq!(lines.len(), 5, "one line for each path");
    let mut files = Vec::new();
    sources(&root.join("crates"), &mut files);
    files.retain(|file| file.components().any(|part| part.as_os_str() == "src"));
    let texts: Vec<_> = files
        .iter()
        .map(|file| std::fs::read_to_string(file).unwrap())
        .collect();
    let declares = |text: &str, kinds: &[&str], name: &str| {
        let named = |(at, found): (usize, &str)| {
            !text[at + found.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_')
        };
        kinds
            .iter()
            .any(|kind| text.match_indices(&format!("{kind} {name}")).any(named))
    };
    for line in lines {
        let (_, path) = line.split_once(") ").unwrap();
        for step in path.split(" -> ") {
            let (owner, function) = step
                .trim()
                .split_once("::")
                .map_or((step.trim(), None), |(a, b)| (a, Some(b)));
            let is_function = owner.starts_with(char::is_lowercase);
            let kinds: &[&str] = if is_function {
                &["fn"]
            } else {
                &["struct", "enum", "trait"]
            };
            let owners = texts.iter().filter(|text| declares(text, kinds, owner)).count();
            assert!(owners > 0, "{owner} of {line}");
            let found = function.is_none_or(|f| {
                texts
                    .iter()
                    .any(|text| text.contains(owner) && declares(text, &["fn"], f))
            });
            assert!(found, "{step} of {line}");
        }
    }
}
