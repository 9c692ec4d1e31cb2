//! The machines of `fewbits-protocol` over the simulated radio.

use crate::books::conserves;
use crate::worlds::{clock, setup};
use fewbits_core::{BitString, Error, Observation, SensorNode};
use fewbits_monte_carlo::Stream;
use fewbits_network::{
    BitNode, BitStar, Channel, Check, Detail, Fault, FaultKind, Field, Frame, Kind, Measurements, Note, Seconds,
    SensorId, Setup, Simulator, on_air,
};
use fewbits_protocol::{BoxError, Feedback, Member, Payload, Receiver, ReportLength};
use nalgebra::{SVector, Vector1};
use rand::Rng;

const SENSORS: usize = 3;
const SLOTS: u32 = 200;

/// Counts reports of one bit; the state is slot and count.
#[derive(Debug, Default)]
pub struct Counter {
    slot: u64,
    count: u64,
}

impl Receiver for Counter {
    fn sensors(&self) -> usize {
        SENSORS
    }
    fn predict(&mut self, slot: u64) -> Result<(), BoxError> {
        self.slot = slot;
        Ok(())
    }
    fn feedback(&self, sensor: usize) -> Result<BitString, BoxError> {
        Ok(BitString::from_bytes(vec![sensor as u8, self.count as u8], 16)?)
    }
    fn update(&mut self, observed: &[(usize, Observation<BitString>)]) -> Result<(), BoxError> {
        let received = observed.iter().filter(|(_, o)| matches!(o, Observation::Received(_)));
        self.count += received.count() as u64;
        Ok(())
    }
    fn estimate(&self) -> Vec<(f64, f64)> {
        vec![(self.count as f64, 0.0)]
    }
    fn state(&self) -> Result<BitString, BoxError> {
        let bytes = [self.slot.to_be_bytes(), self.count.to_be_bytes()].concat();
        Ok(BitString::from_bytes(bytes, 128)?)
    }
    fn restore(&mut self, state: &BitString) -> Result<(), BoxError> {
        let (slot, count) = state.bytes().split_at_checked(8).ok_or("state")?;
        self.slot = u64::from_be_bytes(slot.try_into()?);
        self.count = u64::from_be_bytes(count.try_into()?);
        Ok(())
    }
}

/// Sends one bit in every slot.
pub struct Speaker;

impl SensorNode<1> for Speaker {
    fn report(&mut self, _: &mut dyn Rng, _: &SVector<f64, 1>, _: &BitString) -> Result<Option<BitString>, Error> {
        Ok(BitString::from_bytes(vec![0x80], 1).ok())
    }
}

fn run(feedback: Feedback, setup: Setup) -> Simulator<BitStar<Counter, 1>> {
    let measured = Measurements::from_fn(SLOTS, |_, _| Some(Vector1::new(0.0)));
    let node = |_| -> Box<dyn SensorNode<1>> { Box::new(Speaker) };
    let start = || Ok(Counter::default());
    let star = BitStar::new(start, feedback, ReportLength::Fixed(1), node, measured, clock(), Stream::new(1)).unwrap();
    let mut network = star.simulate_on(Field::star(SENSORS, 10.0).unwrap(), setup).unwrap();
    network.run_until(clock().end(SLOTS)).unwrap();
    conserves(network.ledger());
    network
}

fn count(network: &Simulator<BitStar<Counter, 1>>, slot: u32) -> f64 {
    let estimates = network.nodes()[0].estimates();
    estimates.iter().find(|(at, _)| *at == slot).unwrap().1[0].0
}

#[test]
fn every_report_arrives_over_a_perfect_channel() {
    for feedback in [Feedback::Told, Feedback::Clock, Feedback::Echoed] {
        let network = run(feedback, setup(1));
        assert_eq!(network.log().entries, [], "{feedback:?}");
        assert_eq!(network.nodes()[0].estimates().len(), SLOTS as usize);
        assert_eq!(count(&network, SLOTS), f64::from(SLOTS * SENSORS as u32), "{feedback:?}");
    }
}

#[test]
fn a_sensor_that_is_told_nothing_reports_beside_those_that_are() {
    let measured = Measurements::from_fn(6, |_, _| Some(Vector1::new(0.0)));
    let node = |_| -> Box<dyn SensorNode<1>> { Box::new(Speaker) };
    let (start, length) = (|| Ok(Counter::default()), ReportLength::Fixed(1));
    let star = BitStar::new(start, Feedback::Told, length, node, measured, clock(), Stream::new(1)).unwrap();
    let clocked = Member {
        feedback: Feedback::Clock,
        report: length,
    };
    assert!(star.clone().with_member(3, clocked).is_err());
    let mut network = star.with_member(1, clocked).unwrap().simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(6)).unwrap();
    assert_eq!(count(&network, 6), 18.0);
    assert!(network.log().entries.is_empty());
}

#[test]
fn followers_come_back_after_losses_and_restarts() {
    let restart = |slot: f64, node: u32| Fault {
        at: Seconds::new(slot * clock().period().value()).unwrap(),
        node: SensorId(node),
        kind: FaultKind::Restart,
    };
    let network = run(
        Feedback::Echoed,
        Setup {
            channel: Channel::lossy(0.1).unwrap(),
            faults: vec![restart(50.5, 2), restart(100.5, 0)],
            ..setup(1)
        },
    );
    let noted = |wanted: fn(&Note) -> bool| network.log().notes().filter(|(_, _, note)| wanted(note)).count();
    assert!(
        noted(|note| matches!(
            note,
            Note::Frame {
                note: fewbits_protocol::Note::Disagreement { .. },
                ..
            }
        )) > 10
    );
    assert!(
        noted(|note| matches!(
            note,
            Note::Frame {
                note: fewbits_protocol::Note::Resynchronised { .. },
                ..
            }
        )) > 10
    );
    // The centre began anew after slot 100. Frames pass two links of 10 % loss, and a missed echo costs a slot more.
    let reports = count(&network, SLOTS) - count(&network, 102);
    assert!(reports > 0.5 * 98.0 * SENSORS as f64, "{reports}");
    assert!(matches!(network.nodes()[1], BitNode::Sensor(_)));
}

fn speakers(feedback: Feedback, slots: u32, sensors: usize) -> BitStar<Counter, 1> {
    assert_eq!(sensors, SENSORS);
    let measured = Measurements::from_fn(slots, |_, _| Some(Vector1::new(0.0)));
    let node = |_| -> Box<dyn SensorNode<1>> { Box::new(Speaker) };
    let start = || Ok(Counter::default());
    BitStar::new(start, feedback, ReportLength::Fixed(1), node, measured, clock(), Stream::new(1)).unwrap()
}

/// A line: the centre, and three sensors of which each reaches only the next.
#[test]
fn sensors_out_of_range_report_through_others() {
    let line = || Field::from_csv("0,1,10\n1,2,10\n2,3,10").unwrap();
    for feedback in [Feedback::Told, Feedback::Clock, Feedback::Echoed] {
        let star = speakers(feedback, 20, 3);
        let refused = star.clone().simulate_on(line(), setup(1)).err();
        assert!(matches!(refused, Some(fewbits_network::Error::OutOfRange { from: 2, to: 0 })));
        let logged = Setup {
            detail: Detail::Everything,
            ..setup(1)
        };
        let mut network = star.relaying().simulate_on(line(), logged).unwrap();
        network.run_until(clock().end(20)).unwrap();
        assert_eq!(network.log().notes().count(), 0, "{feedback:?}");
        assert_eq!(count(&network, 20), 60.0, "{feedback:?}");
        conserves(network.ledger());
        // In a slot: reports over one, two and three hops; what is for one sensor over as many, what is for all once from each that passes it on.
        let down = match feedback {
            Feedback::Told => 1 + 2 + 3,
            Feedback::Clock => 0,
            _ => 3,
        };
        assert_eq!(network.log().transmissions().count(), 20 * (6 + down), "{feedback:?}");
        // A report of one bit is payload of every node that sends it.
        let sensors = &network.ledger().accounts()[1..];
        if feedback == Feedback::Clock {
            assert_eq!(sensors.iter().map(|account| account.payload.0).collect::<Vec<_>>(), [60, 40, 20]);
            // Alone 201 bits; on its way 112 of a header of its own besides, and the check within.
            assert_eq!(sensors[2].air.0, 20 * (201 + 112));
        }
    }
    let apart = Field::from_csv("0,1\n2,3").unwrap();
    let refused = speakers(Feedback::Told, 5, 3)
        .relaying()
        .simulate_on(apart, setup(1))
        .err();
    assert!(matches!(refused, Some(fewbits_network::Error::Disconnected { reached: 2, .. })));
}

#[test]
fn relayed_frames_survive_losses_and_strangers() {
    let line = Field::from_csv("0,1\n1,2\n2,3").unwrap();
    let setup = Setup {
        channel: Channel::lossy(0.1).unwrap(),
        retries: Some(2),
        ..setup(3)
    };
    let mut network = speakers(Feedback::Echoed, 200, 3)
        .relaying()
        .simulate_on(line, setup)
        .unwrap();
    for (to, sensor) in (0..4).flat_map(|to| [0, 1, 3, 9].map(|sensor| (to, sensor))) {
        let carrying = |frame: BitString| {
            let frame = Frame {
                destination: sensor,
                ..Frame::new(Kind::Handover, 7.into(), 1, (&frame).into())
            };
            on_air(&frame, Check::Whole)
        };
        let report = carrying(on_air(&Frame::new(Kind::Report, 7.into(), 1, Payload::EMPTY), Check::Whole));
        let twice = carrying(report.clone());
        for bits in [report, twice] {
            network
                .inject(clock().start(7), SensorId(to ^ 1), SensorId(to), bits)
                .unwrap();
        }
    }
    network.run_until(clock().end(200)).unwrap();
    conserves(network.ledger());
    // Nearly all hops succeed with two repetitions; broadcasts are not repeated and pass up to three lossy links.
    assert!(count(&network, 200) > 0.6 * 600.0, "{}", count(&network, 200));
}

/// Clocks that gain or lose two parts in a thousand.
#[test]
fn heartbeats_keep_drifting_clocks_in_their_slots() {
    let seconds = |s| Seconds::new(s).unwrap();
    let run = |every: u32, rate: f64| {
        let star = speakers(Feedback::Clock, 600, 3).announcing(every);
        let star = star.reporting_at(seconds(0.1), seconds(0.1));
        let setup = Setup {
            drift: [(SensorId(1), rate), (SensorId(2), -rate)].into(),
            ..setup(1)
        };
        let mut network = star.simulate(10.0, setup).unwrap();
        network.run_until(clock().end(600)).unwrap();
        (count(&network, 600), network.ledger().faults().late)
    };
    // The first is 0.1 s ahead after 50 slots, and early from then on. The second is 0.7 s behind after 349, and misses the deadline.
    let (received, late) = run(0, 2e-3);
    assert!((990.0..1006.0).contains(&received) && (795..807).contains(&late), "{received} {late}");
    assert_eq!(run(10, 2e-3), (1800.0, 0));
    assert_eq!(run(0, 0.0), (1800.0, 0));
}

#[test]
fn recorded_losses_are_those_that_happen() {
    let measured = Measurements::from_fn(20, |_, _| Some(Vector1::new(0.0)));
    let node = |_| -> Box<dyn SensorNode<1>> { Box::new(Speaker) };
    let start = || Ok(Counter::default());
    let star =
        BitStar::new(start, Feedback::Told, ReportLength::Fixed(1), node, measured, clock(), Stream::new(1)).unwrap();
    let star = star.with_recorded_losses(|slot, sensor| slot % 2 == 0 || sensor == 1);
    let mut network = star.simulate_on(Field::star(SENSORS, 10.0).unwrap(), setup(1)).unwrap();
    network.run_until(clock().end(20)).unwrap();
    // Ten slots of three reports, ten of one.
    assert_eq!(count(&network, 20), 40.0);
}
