//! The ledger's laws.

use crate::worlds::{clock, counted, plane, plane_sensors, plane_start, scalar, setup, star};
use fewbits_baselines::cfwmd::centre::CensoringEstimator;
use fewbits_cfwmd::network::Network;
use fewbits_core::{BitString, Link, SensorNode};
use fewbits_models::constant_velocity_2d;
use fewbits_network::{
    Batching, Bits, Channel, Context, Detail, Error, Field, Frame, Instant, Joules, Kind, Ledger, Loss, Protocol,
    Radio, Seconds, SensorId, Setup, Simulator,
};
use fewbits_protocol::{Feedback, ReportLength};
use proptest::prelude::*;

pub fn near(a: Joules, b: Joules) -> bool {
    (a.value() - b.value()).abs() <= 1e-9 * (a.value() + b.value())
}

/// Sum over nodes is sum over messages; nothing is negative.
pub fn conserves(ledger: &Ledger) {
    let (nodes, messages) = (ledger.sum(), ledger.messages());
    assert_eq!((nodes.payload, nodes.air), (messages.payload, messages.air));
    assert!(near(nodes.sending, messages.sending) && near(nodes.receiving, messages.receiving));
    assert!(messages.payload <= messages.air);
    for account in ledger.accounts() {
        assert!(account.sending >= Joules::ZERO && account.receiving >= Joules::ZERO && account.awake >= Seconds::ZERO);
    }
}

proptest! {
    #[test]
    fn bits_and_joules_conserve(
        seed in any::<u64>(), loss in 0.0..1.0_f64, crossover in 0.0..0.05_f64, duplication in 0.0..0.5_f64,
        retries in prop::option::of(0_u32..4), shadowed in any::<bool>(), first_order in any::<bool>(),
        max_frames in 1_usize..4,
    ) {
        let loss = if shadowed {
            Loss::Shadowing { half: 12.0, exponent: 3.0, deviation: 4.0 }
        } else {
            Loss::Fixed(loss)
        };
        let radio = if first_order { Radio::first_order() } else { Radio::cc2420(-5.0).unwrap() };
        let setup = Setup {
            radio,
            channel: Channel { loss, crossover, duplication, ..Channel::PERFECT },
            retries,
            batching: Batching { max_frames, hold: Seconds::new(0.05).unwrap() },
            detail: Detail::Everything,
            ..setup(seed)
        };
        let link = Link::lossy(0.5).unwrap();
        let star = counted(link, Feedback::Told, scalar(3, 6, seed));
        let mut network = star.simulate(10.0, setup).unwrap();
        network.run_until(clock().end(6)).unwrap();
        conserves(network.ledger());
        // The log has the same messages.
        let log = network.log();
        let messages = network.ledger().messages();
        let first = || log.transmissions().filter(|t| t.attempt == 0);
        prop_assert_eq!(first().count() as u64, messages.messages);
        prop_assert_eq!(first().map(|t| t.payload).sum::<u64>(), messages.payload.0);
        let (sent, answered) = (log.transmissions().map(|t| t.air), log.acknowledgements().map(|a| a.air));
        prop_assert_eq!(sent.chain(answered).sum::<u64>(), messages.air.0);
        let (sent, answered) = (log.transmissions().map(|t| t.sending), log.acknowledgements().map(|a| a.sending));
        prop_assert!(near(sent.chain(answered).sum(), messages.sending));
        prop_assert!(near(log.transmissions().map(|t| t.receiving).sum(), messages.receiving));
        // Everything is sending, receiving or idle.
        let whole: Joules = (0..4).map(|i| network.energy(SensorId(i)).unwrap()).sum();
        let idle: Joules = network.ledger().accounts().iter().map(|a| a.idle(&radio, network.now())).sum();
        prop_assert!(near(whole, messages.sending + messages.receiving + idle));
    }
}

#[test]
fn silence_costs_nothing_on_air() {
    // A threshold that nothing crosses: the sensors hear the centre and are silent.
    let network = Network::new(plane_sensors(), 1e6, Link::PERFECT).unwrap();
    let dynamics = constant_velocity_2d(1.0, 0.05).unwrap();
    let estimator = CensoringEstimator::own(network, dynamics, plane_start(), 10).unwrap();
    let nodes = estimator.clone();
    let node = move |i| -> Box<dyn SensorNode<1>> { Box::new(nodes.node(i)) };
    let star = star(estimator, Feedback::Told, ReportLength::Fixed(64), node, plane(10));
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(10)).unwrap();
    for sensor in &network.ledger().accounts()[1..] {
        assert_eq!((sensor.payload, sensor.air, sensor.frames, sensor.sending), (Bits(0), Bits(0), 0, Joules::ZERO));
        assert!(sensor.receiving > Joules::ZERO);
    }
}

#[test]
fn a_frame_costs_what_the_data_sheet_says() {
    let star = counted(Link::PERFECT, Feedback::Told, scalar(3, 1, 1));
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(1)).unwrap();
    let sensor = network.ledger().accounts()[1];
    // Preamble 48, link header 72, header 64, one bit, check 16.
    assert_eq!((sensor.payload, sensor.air), (Bits(1), Bits(201)));
    let wake = 62e-3 * 0.244e-3;
    assert!((sensor.sending.value() - (201.0 / 250e3 * 57.42e-3 + wake)).abs() < 1e-12);
    // The question of 64 bits.
    assert!((sensor.receiving.value() - (264.0 / 250e3 * 62e-3 + wake)).abs() < 1e-12);
}

#[test]
fn repetitions_and_acknowledgements_are_charged() {
    let run = |loss: f64, retries: Option<u32>| {
        let setup = Setup {
            channel: Channel::lossy(loss).unwrap(),
            retries,
            ..setup(3)
        };
        let star = counted(Link::lossy(0.5).unwrap(), Feedback::Told, scalar(3, 30, 1));
        let mut network = star.simulate(10.0, setup).unwrap();
        network.run_until(clock().end(30)).unwrap();
        conserves(network.ledger());
        network.ledger().clone()
    };
    let (plain, acknowledged, repeated) = (run(0.0, None), run(0.0, Some(0)), run(0.4, Some(5)));
    assert_eq!(acknowledged.messages().air.0 - plain.messages().air.0, 90 * 88);
    assert!(acknowledged.messages().sending > plain.messages().sending);
    let each = |ledger: &Ledger| ledger.accounts()[1].air.0 as f64 / ledger.accounts()[1].payload.0 as f64;
    assert!(each(&repeated) > 1.3 * each(&acknowledged));
}

/// Every node sends one frame of one bit to node 0 at each timer.
pub struct Chatter;

impl Protocol for Chatter {
    type Node = u32;

    fn on_timer(&self, _: &mut u32, context: &mut Context<'_>, _: u32) -> Result<(), Error> {
        let bit = BitString::from_bytes(vec![0x80], 1)?;
        context
            .send(SensorId(0), &Frame::new(Kind::Report, 1.into(), 0, (&bit).into()))
            .map(|_| ())
    }

    fn on_frame(&self, node: &mut u32, _: &mut Context<'_>, _: SensorId, _: &Frame<'_>) -> Result<(), Error> {
        *node += 1;
        Ok(())
    }

    fn on_restart(&self, _: &mut u32, _: &mut Context<'_>) -> Result<(), Error> {
        Ok(())
    }
}

#[test]
fn frames_that_wait_for_company_share_preamble_and_header() {
    let run = |batching: Batching| {
        let setup = Setup { batching, ..setup(1) };
        let mut network = Simulator::new(Chatter, vec![0; 2], Field::star(1, 10.0).unwrap(), setup).unwrap();
        for k in 0..7 {
            network.start(SensorId(1), Instant(k * 1_000_000), 0).unwrap();
        }
        network.run_until(Instant(u64::MAX / 2)).unwrap();
        assert_eq!(network.nodes()[0], 7);
        conserves(network.ledger());
        *network.ledger().messages()
    };
    let hold = Seconds::new(0.0025).unwrap();
    let (alone, pairs) = (run(Batching::NONE), run(Batching { max_frames: 3, hold }));
    assert_eq!((alone.messages, pairs.messages), (7, 3));
    assert_eq!((alone.payload, pairs.payload), (Bits(7), Bits(7)));
    // Two batches of three with a length of 16 bits each, and the last one alone.
    assert_eq!(alone.air, Bits(7 * 201));
    assert_eq!(pairs.air, Bits(3 * 120 + 7 * 81 + 6 * 16));
    assert!(pairs.sending < alone.sending);
}

#[test]
fn batteries_end() {
    let mut radio = Radio::cc2420(0.0).unwrap();
    radio.battery = Some(Joules::new(1.0).unwrap());
    let star = counted(Link::lossy(0.5).unwrap(), Feedback::Told, scalar(3, 300, 1));
    let mut network = star.simulate(10.0, Setup { radio, ..setup(1) }).unwrap();
    network.run_until(clock().end(300)).unwrap();
    // Idle, it listens 9.9 % of the time: 62 mW then and .066 mW asleep are 6.2 mW, which alone end it after 161.3 s.
    let died = network.ledger().accounts()[1].died.unwrap().since_start().value();
    assert!((146.0..161.4).contains(&died), "{died}");
    assert!((network.energy(SensorId(1)).unwrap().value() - 1.0).abs() < 0.01);
    assert!(!network.is_alive(SensorId(1)));
}

#[test]
fn a_centre_on_the_mains_outlives_its_sensors() {
    let mut radio = Radio::cc2420(0.0).unwrap();
    radio.battery = Some(Joules::new(1.0).unwrap());
    let radios = [(SensorId(0), radio.on_mains())].into();
    let star = counted(Link::lossy(0.5).unwrap(), Feedback::Told, scalar(3, 300, 1));
    let mut network = star
        .simulate(
            10.0,
            Setup {
                radio,
                radios,
                ..setup(1)
            },
        )
        .unwrap();
    network.run_until(clock().end(300)).unwrap();
    assert!(network.is_alive(SensorId(0)) && !network.is_alive(SensorId(1)));
    assert!(network.energy(SensorId(0)).unwrap() > Joules::new(1.8).unwrap());
    let (life, node) = network.summary().lifetime.unwrap();
    assert!(node != SensorId(0) && (146.0..161.4).contains(&life.value()));
}
