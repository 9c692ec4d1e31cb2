//! Regressions: what used to be wrong, each with a case that showed it.

use crate::bit_star::{Counter, Speaker};
use crate::worlds::{AllSend, clock, counted, each, plant, scalar, setup, star, start};
use fewbits_baselines::dymbo::centre::ParallelEstimator;
use fewbits_baselines::over_bits::OverBits;
use fewbits_core::{BitString, FullValue, Link, SchemeNode, SensorNode};
use fewbits_dymbo::{CountFusion, ParallelFilter};
use fewbits_monte_carlo::Stream;
use fewbits_network::{
    BitStar, Channel, Check, Clock, Detail, Error, Fault, FaultKind, Field, Frame, Instant, Kind, Loss, Measurements,
    Note, Radio, Seconds, SensorId, Setup, Stage, Walk, on_air,
};
use fewbits_protocol::{BoxError, Feedback, Lead, Leader, ReportLength, Slot, digest};
use fewbits_topology::Deployment;
use nalgebra::{Vector1, Vector2};
use rand::Rng;

fn all_send(link: Link, measurements: impl Into<Measurements<Vector1<f64>>>) -> BitStar<OverBits<AllSend>, 1> {
    let nodes = each(FullValue::new(1.0).unwrap());
    star(AllSend(link), Feedback::Clock, ReportLength::Fixed(64), nodes, measurements)
}

#[test]
fn a_misconfigured_estimator_ends_the_run() {
    let star = all_send(Link::flipping(0.01).unwrap(), scalar(3, 20, 1));
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    let error = network.run_until(clock().end(20)).unwrap_err();
    let Error::MostSlotsFailed {
        failed: 11, slots: 20, ..
    } = &error
    else {
        panic!("{error}");
    };
    let expected = "update failed, slot 11: argument `crossover` is 0.01";
    assert!(error.to_string().contains(expected), "{error}");
    let notes: Vec<String> = network.log().notes().map(|(_, _, note)| note.to_string()).collect();
    assert!(notes[0].starts_with("update failed, slot 1: argument `crossover` is 0.01"), "{notes:?}");
    assert_eq!(network.ledger().faults().failures, 11);
}

#[test]
fn reports_of_half_the_slots_may_fail() {
    // An infinite measurement fits no format: the sensor notes it and the slot passes.
    let measure = |slot: u32, _: usize| Some(Vector1::new(if slot.is_multiple_of(2) { f64::NAN } else { 1.0 }));
    let run = |slots: u32, measure: fn(u32, usize) -> Option<Vector1<f64>>| {
        let link = Link::lossy(0.5).unwrap();
        let measurements = Measurements::from_fn(slots, measure);
        let star = all_send(link, measurements);
        let mut network = star.simulate(10.0, setup(1)).unwrap();
        network
            .run_until(clock().end(slots))
            .map(|_| network.ledger().faults().failures)
    };
    assert_eq!(run(20, measure).unwrap(), 30);
    let never = run(20, |_, _| Some(Vector1::new(f64::NAN)));
    assert!(matches!(
        never,
        Err(Error::MostSlotsFailed {
            node: SensorId(1),
            failed: 11,
            ..
        })
    ));
}

#[test]
fn missing_measurements_are_silence() {
    let link = Link::lossy(0.5).unwrap();
    let measure = |slot: u32, sensor: usize| (sensor != 1 || slot > 5).then(|| Vector1::new(1.0));
    let measurements = Measurements::from_fn(8, measure);
    let star = all_send(link, measurements);
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(8)).unwrap();
    let frames: Vec<u32> = network.ledger().accounts()[1..]
        .iter()
        .map(|account| account.frames)
        .collect();
    assert_eq!(frames, [8, 3, 8]);
    let missing = network
        .log()
        .notes()
        .filter(|(_, node, note)| *node == SensorId(2) && matches!(note, Note::NotMeasured { .. }));
    assert_eq!(missing.count(), 5);
    // The same from an iterator.
    let table: Measurements<Vector1<f64>> = (1..=8).map(|slot| (0..3).map(|i| measure(slot, i)).collect()).collect();
    let star = all_send(link, table);
    let mut again = star.simulate(10.0, setup(1)).unwrap();
    again.run_until(clock().end(8)).unwrap();
    assert_eq!(again.nodes()[0].estimates(), network.nodes()[0].estimates());
}

/// What a centre sees of reports whose header alone is checked: the share of slots without any arrival is the loss of the link.
#[test]
fn link_loss_is_the_share_of_silent_slots() {
    let slots = 1500;
    for (channel, question) in [
        (Channel::flipping(0.01).unwrap(), None),
        (
            Channel {
                crossover: 0.01,
                ..Channel::lossy(0.2).unwrap()
            },
            Some(144),
        ),
    ] {
        let link = channel.link(10.0, question, Check::Header).unwrap();
        assert_eq!(link.crossover(), 0.01);
        let setup = Setup {
            channel,
            report_check: Check::Header,
            detail: Detail::Everything,
            ..setup(2)
        };
        let mut arrived = 0;
        let mut count = |log: &fewbits_network::Log| {
            let reports = log.transmissions().filter(|t| t.from != SensorId(0));
            arrived += reports.filter(|t| !t.receptions[0].copies.is_empty()).count();
        };
        if question.is_some() {
            let star = counted(Link::new(0.6, 0.01).unwrap(), Feedback::Told, scalar(3, slots, 1));
            let mut network = star.simulate(10.0, setup).unwrap();
            network.run_until(clock().end(slots as u32)).unwrap();
            count(network.log());
        } else {
            let centre = || Ok(Counter::default());
            let node = |_| -> Box<dyn SensorNode<1>> { Box::new(Speaker) };
            let (length, measured) = (ReportLength::Fixed(1), scalar(3, slots, 1));
            let star = BitStar::new(centre, Feedback::Clock, length, node, measured, clock(), Stream::new(1)).unwrap();
            let mut network = star.simulate(10.0, setup).unwrap();
            network.run_until(clock().end(slots as u32)).unwrap();
            count(network.log());
        }
        let n = 3.0 * slots as f64;
        let silent = 1.0 - arrived as f64 / n;
        // The three sensors miss the same question only if each of its copies is lost: independent.
        let spread = (link.loss() * (1.0 - link.loss()) / n).sqrt();
        assert!((silent - link.loss()).abs() <= 4.0 * spread, "{silent} for {}", link.loss());
    }
}

#[test]
fn slots_without_time_for_all_are_refused() {
    let filter = ParallelFilter::new(plant(), 1000, CountFusion::Linear).unwrap();
    let centre = move || Ok(OverBits::new(ParallelEstimator::new(filter, start())?));
    let scheme = fewbits_dymbo::SignBit::new(1.0).unwrap();
    let node = move |_| -> Box<dyn SensorNode<1>> { Box::new(SchemeNode::new(scheme)) };
    let measurements = || Measurements::from_fn(3, |_, _| Some(Vector1::new(0.0)));
    let star = |period: f64| {
        let clock = Clock::new(Seconds::new(period).unwrap()).unwrap();
        let length = ReportLength::Fixed(1);
        BitStar::new(centre, Feedback::Echoed, length, node, measurements(), clock, Stream::new(1)).unwrap()
    };
    let refused = star(0.01).simulate(10.0, setup(1)).err();
    let Some(Error::SlotTooShort {
        frames: 1001,
        needed,
        available,
    }) = refused
    else {
        panic!("{refused:?}");
    };
    // 1000 reports of 200 bits, and an echo of 80 + 1000 bits in two link frames, at 250 kbit/s.
    let echo = 1080.0 + 2.0 * (120.0 + 56.0);
    assert!((needed.value() - (1000.0 * 200.0 + echo) / 250e3).abs() < 1e-9, "{needed}");
    assert!((available.value() - 0.009).abs() < 1e-12);
    assert!(star(2.0).simulate(10.0, setup(1)).is_ok());
}

/// Transmissions of neighbours do not overlap.
#[test]
fn frames_wait_until_the_air_is_free() {
    let star = counted(Link::PERFECT, Feedback::Told, scalar(3, 4, 1));
    let mut network = star
        .simulate(
            10.0,
            Setup {
                detail: Detail::Everything,
                ..setup(1)
            },
        )
        .unwrap();
    network.run_until(clock().end(4)).unwrap();
    let mut free = 0;
    for sent in network.log().transmissions() {
        assert!(sent.at.0 >= free, "{} < {free}", sent.at.0);
        free = sent.at.0 + sent.air * 4_000;
    }
    assert_eq!(network.log().transmissions().count(), 16);
}

#[test]
fn every_link_has_its_own_loss() {
    let link_loss = [((SensorId(2), SensorId(0)), Loss::Fixed(1.0))].into();
    let star = counted(Link::lossy(0.5).unwrap(), Feedback::Told, scalar(3, 10, 1));
    let setup = Setup {
        link_loss,
        detail: Detail::Everything,
        ..setup(1)
    };
    let mut network = star.simulate(10.0, setup).unwrap();
    network.run_until(clock().end(10)).unwrap();
    for sent in network.log().transmissions().filter(|t| t.from != SensorId(0)) {
        assert_eq!(sent.receptions[0].copies.is_empty(), sent.from == SensorId(2));
    }
}

#[test]
fn a_sensor_out_of_range_of_the_centre_is_refused() {
    let at = |x: &[f64]| Deployment::given(x.iter().map(|x| Vector2::new(*x, 0.0)).collect()).unwrap();
    let star = || counted(Link::PERFECT, Feedback::Told, scalar(3, 4, 1));
    let field = |x: &[f64]| Field::new(&at(x), 2.0).unwrap();
    let refused = star().simulate_on(field(&[0.0, 1.0, 2.0, 3.0]), setup(1)).err();
    assert!(matches!(refused, Some(Error::OutOfRange { from: 3, to: 0 })));
    let refused = star().simulate_on(field(&[0.0, 1.0]), setup(1)).err();
    assert!(matches!(refused, Some(Error::UnknownNode { node: 2, nodes: 2 })));
    let mut network = star().simulate_on(field(&[0.0, 1.0, 2.0, -1.5]), setup(1)).unwrap();
    network.run_until(clock().end(4)).unwrap();
    assert_eq!(network.nodes()[0].means().len(), 4);
}

/// Never leads on.
struct Last;

impl Leader for Last {
    fn lead(&self, _: &mut dyn Rng, _: u64, _: u32, _: Option<&BitString>) -> Result<Lead, BoxError> {
        Ok(Lead {
            message: BitString::default(),
            next: None,
            estimate: Vec::new(),
        })
    }
}

/// Node 1 is to lead in slot 8. It relays a handover to node 2, which is dead. What cannot be passed on is kept only if it has seen more slots.
#[test]
fn a_relay_that_leads_keeps_its_newer_belief() {
    let leads_after = |relayed: u64| {
        let at = |x: f64| Instant::default().after(Seconds::new(x).unwrap());
        let line = [0.0, 1.0, 2.0].map(|x| Vector2::new(x, 0.0)).to_vec();
        let field = Field::new(&Deployment::given(line).unwrap(), 1.5).unwrap();
        let death = Fault {
            at: Seconds::ZERO,
            node: SensorId(2),
            kind: FaultKind::Death,
        };
        let setup = Setup {
            faults: vec![death],
            retries: Some(1),
            radio: Radio::cc2420(0.0).unwrap(),
            ..setup(1)
        };
        let walk = Walk::new(Last, clock(), 20, Stream::new(1)).unwrap();
        let mut network = walk.simulate(field, SensorId(0), setup).unwrap();
        let mut handover = |time: f64, destination: u32, slot: u64, byte: u8| {
            let slot = Slot::of_count(slot);
            let payload = BitString::from_bytes(vec![byte], 8).unwrap();
            let frame = Frame {
                destination,
                ..Frame::new(Kind::Handover, slot, digest(slot, (&payload).into()), (&payload).into())
            };
            network
                .inject(at(time), SensorId(0), SensorId(1), on_air(&frame, Check::Whole))
                .unwrap();
        };
        handover(2.0, 1, 8, 1);
        handover(2.1, 2, relayed, 2);
        network.run_until(at(3.0)).unwrap();
        let kept = |note: &Note| {
            matches!(
                note,
                Note::Frame {
                    note: fewbits_protocol::Note::Retained { .. },
                    ..
                }
            )
        };
        assert_eq!(network.log().notes().filter(|(_, _, note)| kept(note)).count(), 1);
        network.nodes()[1].leads()
    };
    assert_eq!(leads_after(5), Some(8));
    assert_eq!(leads_after(9), Some(9));
}

#[test]
fn a_leader_that_always_fails_ends_the_run() {
    struct Failing;
    impl Leader for Failing {
        fn lead(&self, _: &mut dyn Rng, slot: u64, node: u32, _: Option<&BitString>) -> Result<Lead, BoxError> {
            Err(format!("node {node} has no reading in slot {slot}").into())
        }
    }
    let walk = Walk::new(Failing, clock(), 10, Stream::new(1)).unwrap();
    let mut network = walk
        .simulate(Field::ring(3, 10.0).unwrap(), SensorId(0), setup(1))
        .unwrap();
    let error = network.run_until(clock().end(10)).unwrap_err();
    let Error::MostSlotsFailed {
        failed: 6,
        last: Note::Failed {
            stage: Stage::Lead,
            slot: 6,
            reason,
        },
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!(reason, "node 0 has no reading in slot 6");
}
