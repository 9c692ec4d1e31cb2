//! Random fault schedules. `PROPTEST_CASES=100000 cargo test -p fewbits-network --release faults` runs as many as the page reports.

use crate::books::conserves;
use crate::worlds::{clock, counted, scalar, setup, start};
use fewbits_adaptive::Config;
use fewbits_core::{BitString, Gaussian, Link};
use fewbits_models::{Ar1, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_network::estimators::{Followers, ParallelDymboEstimator};
use fewbits_network::{
    AdHoc, Batching, Channel, Check, Error, Fault, FaultKind, Field, Lead, Log, Loss, Note, Seconds, SensorId, Setup,
    Simulator, Star, StarNode, Walk, Walker,
};
use proptest::prelude::*;
use rand_pcg::Pcg64Dxsm;
use std::collections::BTreeMap;

/// Slots under faults, and quiet ones after them.
const FAULTY: u32 = 10;
const QUIET: u32 = 6;
/// Slots after which a silent anchor of an ad-hoc network sends its digest.
const BEACON: u32 = 2;

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

fn estimator() -> ParallelDymboEstimator {
    counted(Link::new(0.3, 0.01).unwrap())
}

fn disagreements(log: &Log) -> usize {
    log.notes()
        .filter(|(_, _, note)| matches!(note, Note::Disagreement { .. }))
        .count()
}

fn finite(estimates: &[Vec<f64>]) -> bool {
    estimates.iter().flatten().all(|x| x.is_finite())
}

/// The centre and its replicas, slot by slot: whoever answers in a slot shares the centre's belief after the slot before.
fn follow(
    network: &mut Simulator<Star<ParallelDymboEstimator>>,
    slots: std::ops::RangeInclusive<u32>,
    mut before: Gaussian<1>,
) -> Result<Gaussian<1>, TestCaseError> {
    for slot in slots {
        network.run_until(clock().end(slot)).unwrap();
        for sensor in &network.nodes()[1..] {
            if sensor.answered() == Some(slot)
                && let Some((at, belief)) = sensor.belief()
                && at + 1 == slot
            {
                prop_assert_eq!(belief, &before, "silent divergence in slot {}", slot);
            }
        }
        before = *network.nodes()[0].belief().unwrap().1;
    }
    Ok(before)
}

proptest! {
    #[test]
    fn a_centre_that_tells_survives(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let star = Star::told(estimator(), scalar(3, slots as usize, 1), clock(), Stream::new(1)).unwrap();
        let mut network = star.simulate(10.0, setup).unwrap();
        network.run_until(clock().end(slots)).unwrap();
        prop_assert!(finite(network.nodes()[0].estimates()));
        conserves(network.ledger());
        let seen = disagreements(network.log()) as u64;
        prop_assert_eq!(seen, network.ledger().faults().disagreements);
    }

    #[test]
    fn followed_signals_survive(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let followers = Followers {
            dynamics: Ar1::new(0.9, 0.5).unwrap(),
            sensors: vec![LinearSensor::<1, 1>::direct(1.0).unwrap(); 3],
            noise_variance: 1.0,
            config: Config::new(0.5).and_then(|c| c.resilient(4, Some(4))).unwrap(),
            start: start(),
        };
        // A damaged packet can be one that the sensor might have sent: its check covers all of it.
        let setup = Setup { report_check: Check::Whole, ..setup };
        let measurements = scalar(3, slots as usize, 1);
        let star = Star::told(followers, measurements.clone(), clock(), Stream::new(1)).unwrap();
        let mut network = star.simulate(10.0, setup.clone()).unwrap();
        network.run_until(clock().end(FAULTY)).unwrap();
        let mut stored = Vec::new();
        network.snapshot(&mut stored).unwrap();
        let star = network.protocol().clone();
        let quiet = quiet(setup);
        let mut network = Simulator::restore(star, Field::star(3, 10.0).unwrap(), quiet, stored.as_slice()).unwrap();
        network.run_until(clock().end(slots)).unwrap();
        prop_assert!(finite(network.nodes()[0].estimates()));
        conserves(network.ledger());
        // After a refresh over clear air, whoever lives is followed within delta again.
        if let Some((slot, followed)) = network.nodes()[0].belief()
            && slot == slots
        {
            let last = &measurements[slots as usize - 1];
            for ((receiver, z), sensor) in followed.receivers().iter().zip(last).zip(&network.nodes()[1..]) {
                if sensor.answered() == Some(slots) && receiver.tracked().synchronised {
                    prop_assert!((receiver.tracked().value.unwrap() - z[0]).abs() <= 0.5);
                }
            }
        }
    }

    #[test]
    fn replicas_by_echo_never_part_in_silence(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let star = || Star::echoed(estimator(), scalar(3, slots as usize, 1), clock(), Stream::new(1)).unwrap();
        let mut network = star().simulate(10.0, setup.clone()).unwrap();
        let before = follow(&mut network, 1..=FAULTY, start())?;
        prop_assert!(finite(network.nodes()[0].estimates()));
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
                let StarNode::Sensor(_) = node else { continue };
                if network.is_alive(SensorId(i as u32)) && !out(&network, i) {
                    prop_assert_eq!(node.answered(), Some(slots), "node {} is still lost", i);
                }
            }
        }
    }

    #[test]
    fn peers_come_together_and_the_log_says_that_they_had_parted(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let peers = || AdHoc::new(estimator(), scalar(3, slots as usize, 1), clock(), BEACON, Stream::new(1)).unwrap();
        let mut network = peers().simulate(10.0, setup.clone()).unwrap();
        network.run_until(clock().end(FAULTY)).unwrap();
        conserves(network.ledger());
        prop_assert!(network.nodes().iter().all(|peer| finite(peer.estimates())));
        let mut stored = Vec::new();
        network.snapshot(&mut stored).unwrap();
        let alive: Vec<bool> = (0..3).map(|i| network.is_alive(SensorId(i))).collect();
        let parted = alive[0] && (1..3).any(|i| {
            alive[i] && network.nodes()[i].belief() != network.nodes()[0].belief()
        });
        let quiet = quiet(setup);
        let field = Field::ring(3, 10.0).unwrap();
        let mut network = Simulator::restore(peers(), field, quiet, stored.as_slice()).unwrap();
        network.run_until(clock().end(slots)).unwrap();
        prop_assert!(!parted || disagreements(network.log()) > 0);
        for i in (1..3).filter(|i| alive[0] && alive[*i]) {
            prop_assert_eq!(network.nodes()[i].belief(), network.nodes()[0].belief());
            prop_assert!(!network.nodes()[i].is_lost());
        }
    }

    #[test]
    fn a_walking_belief_never_doubles_in_silence(setup in schedules()) {
        let slots = FAULTY + QUIET;
        let retries = Some(setup.retries.unwrap_or(1));
        let walk = Walk::new(StepCounter, clock(), slots, Stream::new(1));
        let field = Field::star(3, 10.0).unwrap();
        let mut network = walk.simulate(field, SensorId(0), Setup { retries, ..setup }).unwrap();
        network.run_until(clock().end(slots)).unwrap();
        conserves(network.ledger());
        let leaders = network.nodes().iter().filter(|node| node.leads().is_some()).count();
        let retained = network.log().notes().any(|(_, _, note)| matches!(note, Note::Retained { .. }));
        prop_assert!(leaders <= 1 || retained);
        let mut led: Vec<u32> = network.nodes().iter().flat_map(|n| n.estimates().iter().map(|(slot, _)| *slot)).collect();
        led.sort_unstable();
        prop_assert!(retained || led.windows(2).all(|pair| pair[0] < pair[1]), "{:?}", led);
    }
}

/// Whether a node's last outage outlasts the run: restored outages are not part of a setup.
fn out(network: &Simulator<Star<ParallelDymboEstimator>>, node: usize) -> bool {
    network.is_out(SensorId(node as u32)) || network.is_out(SensorId(0))
}

/// A belief that counts its steps and goes round.
struct StepCounter;

impl Walker for StepCounter {
    fn lead(&self, _: &mut Pcg64Dxsm, slot: u32, node: SensorId, message: Option<&BitString>) -> Result<Lead, Error> {
        let steps = message.map_or(0, |bits| bits.bytes()[0]);
        Ok(Lead {
            message: BitString::from_bytes(vec![steps.wrapping_add(1)], 8)?,
            next: Some(SensorId((node.0 + 1) % 4)),
            estimate: vec![f64::from(slot)],
        })
    }
}
