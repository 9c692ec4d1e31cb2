//! Random fault schedules. `PROPTEST_CASES=100000 cargo test -p fewbits-network --release faults` runs as many as the page reports.

use crate::books::conserves;
use crate::worlds::{Counted, clock, counted, plant, scalar, setup, start};
use fewbits_baselines::dymbo::centre::ParallelEstimator;
use fewbits_baselines::over_bits::OverBits;
use fewbits_core::{BitString, Link};
use fewbits_dymbo::{CountFusion, ParallelFilter};
use fewbits_monte_carlo::Stream;
use fewbits_network::{
    Batching, BitNode, Channel, Check, Fault, FaultKind, Field, Log, Loss, Note, Seconds, SensorId, Setup, Simulator,
    Walk,
};
use fewbits_protocol::{BoxError, Feedback, Lead, Leader, Receiver};
use proptest::prelude::*;
use rand::Rng;
use std::collections::BTreeMap;

/// Slots under faults, and quiet ones after them.
const FAULTY: u32 = 10;
const QUIET: u32 = 6;

fn seconds(s: f64) -> Seconds {
    Seconds::new(s).unwrap()
}

fn schedules() -> impl Strategy<Value = Setup> {
    let kind = prop_oneof![
        1 => Just(FaultKind::Death),
        3 => Just(FaultKind::Restart),
        2 => (0.0..4.0_f64).prop_map(|s| FaultKind::Outage(seconds(s))),
    ];
    let fault = (0.0..f64::from(FAULTY), 0_u32..3, kind).prop_map(|(at, node, kind)| Fault {
        at: seconds(at),
        node: SensorId(node),
        kind,
    });
    let often = |p: f64| prop_oneof![Just(0.0), 0.0..p];
    let channel = (often(0.6), often(0.02), often(1.5), often(0.6), often(0.4), often(0.4), often(2.5));
    let burst = (0.0..1.0_f64, 0.1..3.0_f64).prop_map(|(bad, mean)| Loss::Burst {
        good: 0.0,
        bad,
        mean_good: seconds(2.0),
        mean_bad: seconds(mean),
    });
    let batching = (2_usize..4, 0.0..0.3_f64).prop_map(|(max_frames, hold)| Batching {
        max_frames,
        hold: seconds(hold),
    });
    let extras = (prop::option::of(burst), prop::option::weighted(0.2, batching));
    let rest = (prop::option::of(0_u32..3), any::<bool>(), prop::collection::vec(fault, 0..5), any::<u64>(), extras);
    (channel, rest).prop_map(|((loss, crossover, delay, jitter, duplication, reordering, held), rest)| {
        let (retries, header, faults, seed, (burst, batching)) = rest;
        Setup {
            channel: Channel {
                loss: Loss::Fixed(loss),
                crossover,
                delay: seconds(delay * 0.3),
                jitter: seconds(jitter),
                duplication,
                reordering,
                held: seconds(held),
            },
            link_loss: burst
                .into_iter()
                .map(|loss| ((SensorId(1), SensorId(0)), loss))
                .collect(),
            batching: batching.unwrap_or(Batching::NONE),
            retries,
            report_check: if header { Check::Header } else { Check::Whole },
            faults,
            ..setup(seed)
        }
    })
}

/// The same network over clear air.
fn quiet(setup: Setup) -> Setup {
    Setup {
        channel: Channel::PERFECT,
        link_loss: BTreeMap::new(),
        faults: Vec::new(),
        ..setup
    }
}

fn faulty_star(feedback: Feedback) -> Counted {
    counted(Link::new(0.3, 0.01).unwrap(), feedback, scalar(3, (FAULTY + QUIET) as usize, 1))
}

fn disagreements(log: &Log) -> usize {
    log.notes()
        .filter(|(_, _, note)| {
            matches!(
                note,
                Note::Frame {
                    note: fewbits_protocol::Note::Disagreement { .. },
                    ..
                }
            )
        })
        .count()
}

fn finite(estimates: &[Vec<f64>]) -> bool {
    estimates.iter().flatten().all(|x| x.is_finite())
}

/// A receiver in this state, predicted into a slot.
fn predicted(state: &BitString, slot: u32) -> BitString {
    let filter = ParallelFilter::new(plant(), 3, CountFusion::Linear).unwrap();
    let mut receiver = OverBits::new(ParallelEstimator::new(filter, start()).unwrap());
    receiver.restore(state).unwrap();
    receiver.predict(u64::from(slot)).unwrap();
    receiver.state().unwrap()
}

fn state(node: &BitNode<OverBits<ParallelEstimator>, 1>) -> BitString {
    node.receiver().unwrap().state().unwrap()
}

/// The centre and its replicas, slot by slot: whoever answers in a slot has predicted from the centre's state after the slot before. A replica
/// that begins anew after its answer is in slot 0.
fn follow(
    network: &mut Simulator<Counted>,
    slots: std::ops::RangeInclusive<u32>,
    mut before: BitString,
) -> Result<BitString, TestCaseError> {
    for slot in slots {
        network.run_until(clock().end(slot)).unwrap();
        let expected = predicted(&before, slot);
        for sensor in &network.nodes()[1..] {
            let own = state(sensor);
            if sensor.answered() == Some(slot) && own.bytes()[..8] == expected.bytes()[..8] {
                prop_assert_eq!(&own, &expected, "silent divergence in slot {}", slot);
            }
        }
        before = state(&network.nodes()[0]);
    }
    Ok(before)
}

proptest! {
    #[test]
    fn a_centre_that_tells_survives(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let mut network = faulty_star(Feedback::Told).simulate(10.0, setup).unwrap();
        network.run_until(clock().end(slots)).unwrap();
        prop_assert!(finite(&network.nodes()[0].means()));
        conserves(network.ledger());
        let seen = disagreements(network.log()) as u64;
        prop_assert_eq!(seen, network.ledger().faults().disagreements);
    }

    #[test]
    fn replicas_by_echo_never_part_in_silence(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let star = || faulty_star(Feedback::Echoed);
        let mut network = star().simulate(10.0, setup.clone()).unwrap();
        let first = state(&network.nodes()[0]);
        let before = follow(&mut network, 1..=FAULTY, first)?;
        prop_assert!(finite(&network.nodes()[0].means()));
        conserves(network.ledger());
        // The air clears: everybody who lives comes together again.
        let mut stored = Vec::new();
        network.snapshot(&mut stored).unwrap();
        let quiet = quiet(setup);
        let field = Field::star(3, 10.0).unwrap();
        let mut network = Simulator::restore(star(), field, quiet, stored.as_slice()).unwrap();
        follow(&mut network, FAULTY + 1..=slots, before)?;
        if network.is_alive(SensorId(0)) {
            for (i, node) in network.nodes().iter().enumerate().skip(1) {
                if network.is_alive(SensorId(i as u32)) && !out(&network, i) {
                    prop_assert_eq!(node.answered(), Some(slots), "node {} is still lost", i);
                }
            }
        }
    }

    #[test]
    fn a_walking_belief_never_doubles_in_silence(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let retries = Some(setup.retries.unwrap_or(1));
        let walk = Walk::new(StepCounter, clock(), slots, Stream::new(1)).unwrap();
        let field = Field::star(3, 10.0).unwrap();
        let mut network = walk.simulate(field, SensorId(0), Setup { retries, ..setup }).unwrap();
        network.run_until(clock().end(slots)).unwrap();
        conserves(network.ledger());
        let leaders = network.nodes().iter().filter(|node| node.leads().is_some()).count();
        let retained = network.log().notes().any(|(_, _, note)| matches!(note, Note::Frame { note: fewbits_protocol::Note::Retained { .. }, .. }));
        prop_assert!(leaders <= 1 || retained);
        let mut led: Vec<u32> = network.nodes().iter().flat_map(|n| n.estimates().iter().map(|(slot, _)| *slot)).collect();
        led.sort_unstable();
        prop_assert!(retained || led.windows(2).all(|pair| pair[0] < pair[1]), "{:?}", led);
    }
}

/// Whether a node's last outage outlasts the run: restored outages are not part of a setup.
fn out(network: &Simulator<Counted>, node: usize) -> bool {
    network.is_out(SensorId(node as u32)) || network.is_out(SensorId(0))
}

/// A belief that counts its steps and goes round.
struct StepCounter;

impl Leader for StepCounter {
    fn lead(&self, _: &mut dyn Rng, slot: u64, node: u32, message: Option<&BitString>) -> Result<Lead, BoxError> {
        let steps = message.map_or(0, |bits| bits.bytes()[0]);
        Ok(Lead {
            message: BitString::from_bytes(vec![steps.wrapping_add(1)], 8)?,
            next: Some((node + 1) % 4),
            estimate: vec![slot as f64],
        })
    }
}
