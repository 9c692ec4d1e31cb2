//! Reports that survive the loss of those before them.

use super::common::mixed;
use fewbits_adaptive::{CosetConfig, CosetReceiver, CosetSensor, TOLERATED};
use fewbits_core::{BitString, Link, Message, Observation};
use fewbits_monte_carlo::Stream;
use proptest::prelude::*;

const DELTA: f64 = 0.05;

proptest! {
    #[test]
    fn bound_holds_without_loss(samples in prop::collection::vec(-1e4..1e4_f64, 1..200), exponent in -5..4_i32) {
        let config = CosetConfig::new(10.0_f64.powi(exponent), 4, 50).unwrap();
        let (mut sensor, mut receiver) = (CosetSensor::new(config), CosetReceiver::new(config));
        for sample in samples {
            let tracked = receiver.receive(&sensor.encode(sample).unwrap().into()).unwrap();
            prop_assert!(tracked.synchronised && (tracked.value.unwrap() - sample).abs() <= config.delta());
            prop_assert_eq!(tracked.value, sensor.reconstruction());
        }
    }

    #[test]
    fn any_packet_gives_a_value_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..16), short in 0..8_usize) {
        let config = CosetConfig::new(DELTA, 4, 100).unwrap();
        let (mut sensor, mut receiver) = (CosetSensor::new(config), CosetReceiver::new(config));
        for sample in mixed(2, 20) {
            receiver.receive(&sensor.encode(sample).unwrap().into()).unwrap();
        }
        let bits = (8 * bytes.len()).saturating_sub(short);
        let packet = fewbits_adaptive::Packet::from_bits(&(), &BitString::from_bytes(bytes, bits).unwrap()).unwrap();
        let before = receiver.clone();
        match receiver.receive(&Observation::Received(packet)) {
            Ok(tracked) => prop_assert!(tracked.value.is_some_and(f64::is_finite)),
            Err(_) => prop_assert_eq!(receiver, before),
        }
    }
}

/// Whenever a packet arrives after at most `TOLERATED` lost ones, its value is right; no later slot is wrong without a further loss.
#[test]
fn lost_packets_cost_only_the_slots_until_the_next() {
    let config = CosetConfig::new(DELTA, 4, 128).unwrap();
    let link = Link::lossy(0.1).unwrap();
    for seed in 0..20 {
        let mut rng = Stream::new(seed).rng();
        let (mut sensor, mut receiver) = (CosetSensor::new(config), CosetReceiver::new(config));
        let (mut missing, mut broken) = (0, true);
        for sample in mixed(seed, 4000) {
            let report = sensor.encode(sample).unwrap();
            let observation = link.transmit(&mut rng, report.as_ref(), &()).unwrap();
            let arrived = observation.received().is_some();
            let tracked = receiver.receive(&observation).unwrap();
            if report.is_some() && !arrived {
                missing += 1;
            }
            if arrived {
                broken = !tracked.synchronised;
                assert!(!broken || missing > TOLERATED || tracked.value.is_none());
                missing = if broken { missing } else { 0 };
            }
            if missing == 0 && !broken {
                assert!((tracked.value.unwrap() - sample).abs() <= DELTA);
            }
        }
    }
}

/// At 2 % loss, at most 3 % of the slots are out of bound.
#[test]
fn two_percent_loss_leaves_three_percent_out_of_bound() {
    let config = CosetConfig::new(DELTA, 4, 128).unwrap();
    let link = Link::lossy(0.02).unwrap();
    let (mut out, mut slots) = (0, 0);
    for seed in 0..40 {
        let mut rng = Stream::new(seed).rng();
        let (mut sensor, mut receiver) = (CosetSensor::new(config), CosetReceiver::new(config));
        for sample in mixed(seed, 2000) {
            let report = sensor.encode(sample).unwrap();
            let tracked = receiver
                .receive(&link.transmit(&mut rng, report.as_ref(), &()).unwrap())
                .unwrap();
            out += usize::from(!tracked.value.is_some_and(|value| (value - sample).abs() <= DELTA));
            slots += 1;
        }
    }
    assert!(out * 100 <= 3 * slots, "{out} of {slots}");
}

#[test]
fn coset_halves_stored_go_on_alike() {
    let config = CosetConfig::new(0.1, 5, 64).unwrap();
    let (mut sensor, mut receiver) = (CosetSensor::new(config), CosetReceiver::new(config));
    for sample in mixed(4, 500) {
        receiver.receive(&sensor.encode(sample).unwrap().into()).unwrap();
        let stored = serde_json::to_string(&(&sensor, &receiver)).unwrap();
        assert_eq!(
            serde_json::from_str::<(CosetSensor, CosetReceiver)>(&stored).unwrap(),
            (sensor.clone(), receiver.clone())
        );
    }
    let mut stored = serde_json::to_value(&sensor).unwrap();
    stored["reported"][0] = i64::MAX.into();
    assert!(serde_json::from_value::<CosetSensor>(stored).is_err());
    assert!(
        CosetConfig::new(0.0, 4, 10).is_err()
            && CosetConfig::new(1.0, 1, 10).is_err()
            && CosetConfig::new(1.0, 4, 0).is_err()
    );
    let before = sensor.clone();
    for bad in [f64::NAN, 1e300, f64::INFINITY] {
        assert!(sensor.encode(bad).is_err());
    }
    assert_eq!(sensor, before);
}
