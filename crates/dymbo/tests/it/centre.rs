//! Fusion centres of one-bit, three-bit and full sensors: health, learnt noise, late reports, stored states.

use fewbits_core::{
    Belief, BitString, Dynamics, FullValue, Gaussian, Link, MeasurementNoise, Observation, OnAxes, SchemeNode, Sensing,
    SensorNode, Sign,
};
use fewbits_dymbo::{CountFusion, InnovationWord, ParallelFilter, Prediction, ScalarPlant, SignBit};
use fewbits_filters::centre::{CentreState, Event, FusionCentre, NoiseLearning, RemoteSensor, Reporting, Slot};
use fewbits_filters::{BootstrapFilter, Error, GridFilter, Imm, MomentFilter, Particles, ResamplingRule, StateFilter};
use fewbits_models::{ContinuousLinear, LinearSensor, PLANE_POSITION};
use fewbits_monte_carlo::{Moments, Stream};
use nalgebra::{Matrix4, Vector1, Vector4};
use rand::{Rng, RngExt};
use rand_pcg::Pcg64Dxsm;

type Node = Box<dyn SensorNode<1>>;

/// How a sensor reports.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Bit,
    Word,
    Value,
}

/// Both halves of a sensor of noise variance `noise` behind `sensing`.
fn sensor<const D: usize>(
    kind: Kind,
    sensing: impl Sensing<D, 1> + Clone + 'static,
    noise: f64,
    loss: f64,
) -> (Box<dyn RemoteSensor<D>>, Node) {
    let link = Link::lossy(loss).unwrap();
    match kind {
        Kind::Bit => {
            let scheme = SignBit::new(noise).unwrap();
            let ask = |_: &Gaussian<D>, m: &Gaussian<1>| m.mean()[0];
            (Box::new(Reporting::new(sensing, scheme, link, ask)), Box::new(SchemeNode::new(scheme)))
        }
        Kind::Word => {
            let scheme = InnovationWord::new(noise, 3).unwrap();
            let ask = |_: &Gaussian<D>, m: &Gaussian<1>| Prediction::from(m);
            (Box::new(Reporting::new(sensing, scheme, link, ask)), Box::new(SchemeNode::new(scheme)))
        }
        Kind::Value => {
            let scheme = FullValue::new(noise).unwrap();
            (Box::new(Reporting::values(sensing, scheme, link)), Box::new(SchemeNode::new(scheme)))
        }
    }
}

/// A scalar Ornstein-Uhlenbeck world with `sensors` of one kind, seen by a centre that believes in `supposed`.
struct Scalar<F: StateFilter<1>> {
    world: ContinuousLinear<1>,
    truth: Vector1<f64>,
    rng: Pcg64Dxsm,
    centre: FusionCentre<1, F>,
    nodes: Vec<Node>,
    bias: f64,
}

/// `x' = a x + N(0, q)` as a continuous model of steps of one second.
fn first_order(a: f64, q: f64) -> ContinuousLinear<1> {
    ContinuousLinear::ornstein_uhlenbeck(0.0, -1.0 / a.ln(), q / (1.0 - a * a)).unwrap()
}

impl<F: StateFilter<1>> Scalar<F> {
    fn new(kind: Kind, sensors: u32, [a, q, r]: [f64; 3], supposed_q: f64, filter: F, seed: u64) -> Self {
        let mut rng = Stream::new(seed).rng();
        let world = first_order(a, q);
        let prior = Gaussian::scalar(0.0, q / (1.0 - a * a)).unwrap();
        let mut centre = FusionCentre::new(&mut rng, first_order(a, supposed_q), filter, &prior).unwrap();
        let mut nodes = Vec::new();
        for number in 0..sensors {
            let (remote, node) = sensor(kind, LinearSensor::direct(r).unwrap(), r, 0.0);
            centre.join_boxed(number, remote).unwrap();
            nodes.push(node);
        }
        let truth = prior.sample(&mut rng);
        Self {
            world,
            truth,
            rng,
            centre,
            nodes,
            bias: 0.0,
        }
    }

    /// One second: all sensors report; `bias` is added to the first one's measurements.
    fn step(&mut self, r: f64) -> Vec<Event> {
        self.truth = self.world.over(1.0).unwrap().propagate(&mut self.rng, &self.truth);
        let time = self.centre.time() + 1.0;
        self.centre.advance(&mut self.rng, time).unwrap();
        let mut slots = Vec::new();
        for (number, node) in self.nodes.iter_mut().enumerate() {
            let feedback = self.centre.feedback(number as u32).unwrap();
            let mut sample = LinearSensor::direct(r).unwrap().sample(&mut self.rng, &self.truth);
            sample[0] += if number == 0 { self.bias } else { 0.0 };
            let report = node.report(&mut self.rng, &sample, &feedback).unwrap();
            slots.push(Slot::new(number as u32, feedback, report.into()));
        }
        self.centre.receive(&mut self.rng, &slots).unwrap().events
    }

    fn error(&self) -> f64 {
        self.centre.estimate().mean()[0] - self.truth[0]
    }
}

#[test]
fn false_alarms_are_as_rare_as_stated() {
    // Three sensors that err by themselves, and five that err mostly with the prediction.
    for (sensors, plant, noise) in [(3_u32, [0.95, 0.2, 1.0], 1.0), (5, [0.8, 3.0, 0.5], 0.5)] {
        for kind in [Kind::Bit, Kind::Word, Kind::Value] {
            let mut run = Scalar::new(kind, sensors, plant, plant[1], MomentFilter, 5);
            let (steps, mut centre, mut excluded) = (40_000, 0, 0);
            for _ in 0..steps {
                for event in run.step(noise) {
                    centre += u32::from(matches!(event, Event::Lost | Event::NoiseOverstated));
                    excluded += u32::from(matches!(event, Event::Excluded(_)));
                }
            }
            println!(
                "{sensors} {kind:?}: {centre} of the centre (stated 40), excluded {excluded} (stated {:.2})",
                0.04 * f64::from(sensors)
            );
            // Four deviations of a Poisson count.
            assert!(centre <= 40 + 26, "{sensors} {kind:?}: {centre} of the centre");
            assert!(excluded <= 2, "{sensors} {kind:?}: {excluded} of sensors");
        }
    }
}

#[test]
fn a_biased_sensor_is_excluded() {
    for (kind, longest) in [(Kind::Bit, 250.0), (Kind::Word, 150.0), (Kind::Value, 150.0)] {
        let mut delays = Moments::default();
        for seed in 0..20 {
            let mut run = Scalar::new(kind, 4, [0.95, 0.2, 1.0], 0.2, MomentFilter, 100 + seed);
            (0..100).for_each(|_| drop(run.step(1.0)));
            // One innovation deviation and a half.
            run.bias = 2.0;
            let delay = (0..1000)
                .position(|_| run.step(1.0).contains(&Event::Excluded(0)))
                .unwrap_or(1000);
            delays.add(delay as f64);
        }
        assert!(delays.mean() < longest, "{kind:?}: {} steps", delays.mean());
        println!(
            "{kind:?}: biased sensor excluded after {:.0} +- {:.0} steps",
            delays.mean(),
            delays.standard_error()
        );
    }
}

/// Error over the second half of 2000 steps: one bit a sample, the process noise supposed `factor` times too small or large. If it
/// jumps to nine times its variance in the middle, over the last 600 steps.
fn learnt([a, q, r]: [f64; 3], factor: f64, learning: bool, jumps: bool, trials: u64) -> (f64, f64) {
    let (mut squares, mut scales) = (Moments::default(), Moments::default());
    for seed in 0..trials {
        let mut run = Scalar::new(Kind::Bit, 1, [a, q, r], q * factor, MomentFilter, seed);
        if learning {
            run.centre = run.centre.learning_noise(NoiseLearning::DEFAULT).unwrap();
        }
        for k in 0..2000 {
            if jumps && k == 1000 {
                run.world = first_order(a, 9.0 * q);
            }
            run.step(r);
            if k >= if jumps { 1400 } else { 1000 } {
                squares.add(run.error() * run.error());
            }
        }
        scales.add((run.centre.noise_scale() * factor).ln());
    }
    (squares.mean().sqrt(), scales.mean().exp())
}

#[test]
fn bits_alone_tell_the_process_noise() {
    // The specification's table has these errors in parts of knowing, from either side.
    for (setting, specified) in [
        ([0.9, 0.5, 1.0], 1.02),
        ([0.95, 0.2, 1.0], 1.03),
        ([0.99, 0.01, 1.0], 1.09),
        ([0.95, 2.0, 0.1], 1.04),
        ([0.999, 0.001, 0.01], 1.03),
    ] {
        let (known, _) = learnt(setting, 1.0, false, false, 20);
        let (fixed, _) = learnt(setting, 1.0 / 9.0, false, false, 20);
        for factor in [1.0 / 9.0, 9.0] {
            let (error, scale) = learnt(setting, factor, true, false, 20);
            assert!(error < (specified + 0.04) * known, "{setting:?}, {factor}: {} of knowing", error / known);
            assert!(error < fixed, "{setting:?}, {factor}: learning does not pay");
            assert!((0.7..1.5).contains(&scale), "{setting:?}, {factor}: scale {scale}");
            println!("{setting:?}, {factor:.2}: error {:.3} of knowing, scale {scale:.2}", error / known);
        }
    }
}

#[test]
fn a_jump_of_the_process_noise_is_followed() {
    let error = |factor, learning| learnt([0.95, 0.2, 1.0], factor, learning, true, 20).0;
    let known = error(9.0, false);
    assert!(error(1.0 / 9.0, true) < 1.1 * known, "{} of knowing", error(1.0 / 9.0, true) / known);
    assert!(error(1.0, false) > 1.3 * known, "without learning {} of knowing", error(1.0, false) / known);
}

#[test]
fn words_tell_the_process_noise_by_evidence() {
    let scales = vec![1.0 / 9.0, 1.0 / 3.0, 1.0, 3.0, 9.0];
    let mut weight = Moments::default();
    for seed in 0..10 {
        let bank = Imm::new(MomentFilter, scales.clone(), 1e-3).unwrap();
        // The stated noise is nine times too small: the largest scale is right.
        let mut run = Scalar::new(Kind::Word, 1, [0.95, 0.2, 1.0], 0.2 / 9.0, bank, seed);
        for k in 0..1500 {
            run.step(1.0);
            if k >= 1000 {
                weight.add(run.centre.filter().scale(run.centre.belief()).ln());
            }
        }
    }
    assert!((weight.mean().exp() / 9.0).ln().abs() < 0.5, "scale {} instead of 9", weight.mean().exp());
}

/// One range of a position in a plane, from `anchor`.
#[derive(Clone, Copy)]
struct Range([f64; 2], f64);

impl Sensing<2, 1> for Range {
    fn mean(&self, x: &nalgebra::Vector2<f64>) -> Vector1<f64> {
        Vector1::new((x[0] - self.0[0]).hypot(x[1] - self.0[1]))
    }

    fn jacobian(&self, x: &nalgebra::Vector2<f64>) -> nalgebra::RowVector2<f64> {
        nalgebra::RowVector2::new(x[0] - self.0[0], x[1] - self.0[1]) / self.mean(x)[0]
    }

    fn noise_covariance_at(&self, _: &nalgebra::Vector2<f64>) -> nalgebra::Matrix1<f64> {
        nalgebra::Matrix1::new(self.1)
    }

    fn sample(&self, rng: &mut dyn Rng, x: &nalgebra::Vector2<f64>) -> Vector1<f64> {
        Gaussian::from_symmetric_parts(self.mean(x), nalgebra::Matrix1::new(self.1)).sample(rng)
    }
}

/// Two one-bit sensors of a coordinate each, of which one dies, a three-bit range, and a full range that joins late; irregular time.
struct Plane<F: StateFilter<4>> {
    centre: FusionCentre<4, F>,
    nodes: Vec<Node>,
    truth: Vector4<f64>,
    world: ContinuousLinear<4>,
    rng: Pcg64Dxsm,
    filter_rng: Pcg64Dxsm,
}

fn coordinate(axis: usize) -> OnAxes<LinearSensor<1, 1>, 4, 1> {
    OnAxes::new(LinearSensor::direct(0.5).unwrap(), [axis]).unwrap()
}

fn range(anchor: [f64; 2]) -> OnAxes<Range, 4, 2> {
    OnAxes::new(Range(anchor, 0.04), PLANE_POSITION).unwrap()
}

const ANCHORS: [[f64; 2]; 2] = [[-20.0, 5.0], [30.0, -40.0]];

impl<F: StateFilter<4>> Plane<F> {
    fn new(filter: F, seed: u64) -> Self {
        let (mut rng, mut filter_rng) = (Stream::new(seed).rng(), Stream::new(seed).named("filter").rng());
        let world = ContinuousLinear::nearly_constant_velocity_2d(0.05).unwrap();
        let prior = Gaussian::new(Vector4::new(0.0, 1.0, 0.0, -0.5), Matrix4::identity()).unwrap();
        let mut centre = FusionCentre::new(&mut filter_rng, world, filter, &prior)
            .unwrap()
            .with_window(5.0)
            .unwrap();
        let mut nodes = Vec::new();
        for (number, axis) in PLANE_POSITION.into_iter().enumerate() {
            let (remote, node) = sensor(Kind::Bit, coordinate(axis), 0.5, 0.1);
            centre.join_boxed(number as u32, remote).unwrap();
            nodes.push(node);
        }
        let (remote, node) = sensor(Kind::Word, range(ANCHORS[0]), 0.04, 0.0);
        centre.join_boxed(2, remote).unwrap();
        nodes.push(node);
        Self {
            centre,
            nodes,
            truth: prior.sample(&mut rng),
            world,
            rng,
            filter_rng,
        }
    }

    fn join_late(&mut self) {
        let (remote, node) = sensor(Kind::Value, range(ANCHORS[1]), 0.04, 0.0);
        self.centre.join_boxed(3, remote).unwrap();
        self.nodes.push(node);
    }

    /// What is observed after a stretch of irregular time.
    fn observe(&mut self, k: u32) -> Vec<Slot> {
        let seconds = 0.2 + 1.6 * f64::from(k % 7) / 7.0;
        self.truth = self.world.over(seconds).unwrap().propagate(&mut self.rng, &self.truth);
        let time = self.centre.time() + seconds;
        self.centre.advance(&mut self.filter_rng, time).unwrap();
        let mut slots = Vec::new();
        for (number, node) in self.nodes.iter_mut().enumerate() {
            let feedback = self.centre.feedback(number as u32).unwrap();
            let sample = match number {
                0 | 1 => coordinate(PLANE_POSITION[number]).sample(&mut self.rng, &self.truth),
                _ => range(ANCHORS[number - 2]).sample(&mut self.rng, &self.truth),
            };
            let report = node.report(&mut self.rng, &sample, &feedback).unwrap();
            let gone = (number == 1 && k > 150) || (number < 2 && self.rng.random::<f64>() < 0.1);
            slots.push(Slot::new(number as u32, feedback, report.filter(|_| !gone).into()));
        }
        slots
    }

    fn step(&mut self, k: u32) -> f64 {
        if k == 100 {
            self.join_late();
        }
        let slots = self.observe(k);
        self.centre.receive(&mut self.filter_rng, &slots).unwrap();
        let mean = *self.centre.estimate().mean();
        (mean[0] - self.truth[0]).powi(2) + (mean[2] - self.truth[2]).powi(2)
    }
}

/// Root mean squared error over 200 steps; the dead sensor is known for dead, its neighbour is not.
fn three_kinds<F: StateFilter<4>>(filter: F) -> f64 {
    let mut plane = Plane::new(filter, 3);
    let squares: f64 = (0..200).map(|k| plane.step(k)).sum();
    assert!(plane.centre.sensor(1).unwrap().working < 0.01 && plane.centre.sensor(1).unwrap().declared_dead);
    assert!(plane.centre.sensor(0).unwrap().working > 0.9 && !plane.centre.sensor(0).unwrap().declared_dead);
    (squares / 200.0).sqrt()
}

#[test]
fn three_kinds_of_sensor_share_every_filter() {
    let moment = three_kinds(MomentFilter);
    let grid = three_kinds(GridFilter::<4, 2>::new(PLANE_POSITION).unwrap());
    let cloud = three_kinds(BootstrapFilter::new(ResamplingRule::default(), 20_000).unwrap());
    println!("RMS error: moments {moment:.3}, grid {grid:.3}, particles {cloud:.3}");
    for error in [moment, grid, cloud] {
        assert!(error < 1.5, "{moment} {grid} {cloud}");
    }
}

#[test]
fn axes_that_a_grid_does_not_have_are_refused() {
    // The position is on axes 0 and 2; a grid over 0 and 1 would quietly read a velocity.
    let mut plane = Plane::new(GridFilter::<4, 2>::new([0, 1]).unwrap(), 3);
    let before = plane.centre.estimate();
    let slots = plane.observe(1);
    let predicted = plane.centre.estimate();
    let refused = plane.centre.receive(&mut plane.filter_rng, &slots);
    assert!(matches!(refused, Err(Error::Argument(e)) if e.name == "observed"));
    assert!(plane.centre.estimate() == predicted && before != predicted);
    assert!(OnAxes::<_, 4, 2>::new(Range(ANCHORS[0], 0.04), [0, 4]).is_err());
    assert!(OnAxes::<_, 4, 2>::new(Range(ANCHORS[0], 0.04), [2, 2]).is_err());
}

#[test]
fn noise_that_is_stated_twice_must_agree() {
    let mut plane = Plane::new(MomentFilter, 3);
    let (other, _) = sensor(Kind::Bit, coordinate(0), 0.4, 0.0);
    let refused = plane.centre.join_boxed(9, other);
    assert!(matches!(refused, Err(Error::Argument(e)) if e.name == "noise"));
    assert_eq!(SignBit::new(0.4).unwrap().noise_covariance_at(&Vector1::new(1.0))[0], 0.4);
}

#[test]
fn a_restored_centre_goes_on_with_the_same_bits() {
    let filter = || BootstrapFilter::new(ResamplingRule::default(), 300).unwrap();
    let (mut first, mut second) = (Plane::new(filter(), 8), Plane::new(filter(), 8));
    for k in 0..60 {
        first.step(k);
    }
    // Stored as text: what the centre knows, and the streams.
    let state = serde_json::to_string(&first.centre.state()).unwrap();
    let streams = serde_json::to_string(&(&first.rng, &first.filter_rng)).unwrap();
    // Stored as bytes: less than half, and any other bytes are refused.
    let bytes = first.centre.state().to_bytes().unwrap();
    assert!(2 * bytes.len() < state.len(), "{} of {}", bytes.len(), state.len());
    assert!(CentreState::<Particles<4>>::from_bytes(&bytes).unwrap() == first.centre.state());
    let refused = |bytes: &[u8]| CentreState::<Particles<4>>::from_bytes(bytes).is_err();
    assert!(refused(&[]) && refused(&bytes[..bytes.len() - 1]) && refused(&[&bytes[..], &[0]].concat()));
    assert!(refused(&[&[1][..], &bytes[1..]].concat()));
    let state: CentreState<_> = serde_json::from_str(&state).unwrap();
    second.centre.restore(state).unwrap();
    (second.rng, second.filter_rng) = serde_json::from_str(&streams).unwrap();
    second.truth = first.truth;
    for k in 60..160 {
        assert_eq!(first.step(k).to_bits(), second.step(k).to_bits());
    }
    assert!(first.centre.state() == second.centre.state());
    let strange = FusionCentre::new(&mut first.rng, first.world, filter(), &Gaussian::known(Vector4::zeros()).unwrap());
    assert!(strange.unwrap().restore(first.centre.state()).is_err());
}

#[test]
fn late_reports_count_as_if_in_time() {
    let (mut prompt, mut late) = (Plane::new(MomentFilter, 4), Plane::new(MomentFilter, 4));
    for k in 0..50 {
        prompt.step(k);
        late.step(k);
    }
    // The same slots; the range comes after two more instants.
    let time = prompt.centre.time();
    let held = prompt.observe(50);
    let at = prompt.centre.time();
    assert!(late.observe(50) == held && at > time);
    prompt.centre.receive(&mut prompt.filter_rng, &held).unwrap();
    late.centre.receive(&mut late.filter_rng, &held[..2]).unwrap();
    for seconds in [0.5, 1.0] {
        for plane in [&mut prompt, &mut late] {
            let then = at + seconds;
            let feedback = held[0].feedback.clone();
            let slot = Slot::new(0, feedback, held[0].observation.clone());
            plane
                .centre
                .advance(&mut plane.filter_rng, then)
                .unwrap()
                .receive(&mut plane.filter_rng, &[slot])
                .unwrap();
        }
    }
    assert!(late.centre.late(&mut late.filter_rng, at, &held[2..]).unwrap());
    let (one, other) = (prompt.centre.estimate(), late.centre.estimate());
    // The range was linearised after the bits of its instant in both.
    assert!((one.mean() - other.mean()).amax() < 1e-9, "{} {}", one.mean(), other.mean());
    assert!((one.covariance() - other.covariance()).amax() < 1e-9);
    // Older than the window: dropped and counted.
    assert!(!late.centre.late(&mut late.filter_rng, at - 20.0, &held[2..]).unwrap());
    assert_eq!(late.centre.dropped(), 1);
}

#[test]
fn refused_calls_leave_the_centre_as_it_was() {
    let mut plane = Plane::new(MomentFilter, 4);
    plane.step(1);
    let before = plane.centre.state();
    let slots = plane.observe(2);
    plane.centre.restore(before.clone()).unwrap();
    for time in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(plane.centre.advance(&mut plane.filter_rng, time).is_err());
    }
    let unknown = Slot::new(77, slots[0].feedback.clone(), Observation::Nothing);
    assert!(matches!(
        plane.centre.receive(&mut plane.filter_rng, &[unknown]),
        Err(Error::Argument(e)) if e.value == "77"
    ));
    assert!(plane.centre.state() == before);
    // Another sensor's feedback does not decode: that report is rejected, and the others are used.
    let crossed = Slot::new(2, slots[0].feedback.clone(), slots[2].observation.clone());
    plane.centre.receive(&mut plane.filter_rng, &slots[..1]).unwrap();
    let alone = plane.centre.estimate();
    plane.centre.restore(before).unwrap();
    let found = plane
        .centre
        .receive(&mut plane.filter_rng, &[slots[0].clone(), crossed])
        .unwrap();
    assert_eq!(found.events, [Event::Rejected(2)]);
    assert_eq!((plane.centre.estimate(), plane.centre.sensor(2).unwrap().rejected), (alone, 1));
    assert!(plane.centre.leave(2) && !plane.centre.leave(2) && plane.centre.feedback(2).is_err());
}

/// Bits of sensors that answered the same threshold are a count: the centre's update is that of the exact parallel filter.
#[test]
fn the_bits_of_a_group_are_one_count() {
    let link = Link::flipping(0.1).unwrap();
    let prior = Gaussian::scalar(0.3, 2.0).unwrap();
    let bits = [true, true, false, true, true, true];
    let run = |grouped: bool| {
        let mut rng = Stream::new(1).rng();
        let world = ContinuousLinear::random_walk(0.5).unwrap();
        let mut centre = FusionCentre::new(&mut rng, world, MomentFilter, &prior).unwrap();
        for number in 0..bits.len() as u32 {
            let threshold = |_: &Gaussian<1>, m: &Gaussian<1>| m.mean()[0];
            let scheme = SignBit::new(1.0).unwrap();
            let sensor = Reporting::new(LinearSensor::direct(1.0).unwrap(), scheme, link, threshold);
            centre
                .join(number, if grouped { sensor.in_group(0) } else { sensor })
                .unwrap();
        }
        let told = centre.feedback(0).unwrap();
        let report = |above: bool| BitString::from_bytes(vec![if above { 0x80 } else { 0 }], 1).unwrap();
        let slot = |(number, above)| Slot::new(number, told.clone(), Observation::Received(report(above)));
        let slots: Vec<Slot> = (0..).zip(bits).map(slot).collect();
        let info = centre.receive(&mut rng, &slots).unwrap().info;
        (centre.estimate(), info.log_likelihood)
    };
    let plant = ScalarPlant::new(1.0, 0.5, 1.0).unwrap();
    let exact = ParallelFilter::new(plant, bits.len(), CountFusion::Exact).unwrap();
    let sent = bits.map(|above| Observation::Received(if above { Sign::Above } else { Sign::Below }));
    let (expected, info) = exact.with_link(link).update(&prior, &sent).unwrap();
    let (found, log_likelihood) = run(true);
    assert!((found.mean() - expected.mean()).amax() < 1e-9, "{} {}", found.mean(), expected.mean());
    assert!((found.covariance() - expected.covariance()).amax() < 1e-9);
    assert!((log_likelihood - info.log_likelihood).abs() < 1e-9);
    // One after the other is an approximation.
    assert!((run(false).0.covariance() - expected.covariance()).amax() > 1e-5);
}
