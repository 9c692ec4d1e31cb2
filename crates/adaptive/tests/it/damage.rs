//! Any bits give a reconstruction or an error, and an error changes nothing.

use super::common::mixed;
use fewbits_adaptive::{Config, Packet, Receiver, Sensor, Silence, StreamReader};
use fewbits_core::{BitString, Message, Observation, laws};
use proptest::prelude::*;

proptest! {
    #[test]
    fn any_packet(bytes in prop::collection::vec(any::<u8>(), 0..16), short in 0..8_usize, resilient in any::<bool>()) {
        let mut config = Config::new(0.1).unwrap();
        if resilient {
            config = config.resilient(4, Some(100)).unwrap();
        }
        let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
        for x in mixed(2, 60) {
            let report = sensor.encode(x).unwrap();
            receiver.receive(&report.map(|r| r.packet).into()).unwrap();
        }
        let bits = (8 * bytes.len()).saturating_sub(short);
        let packet = Packet::from_bits(&(), &BitString::from_bytes(bytes, bits).unwrap()).unwrap();
        let before = receiver.clone();
        match receiver.receive(&Observation::Received(packet)) {
            Ok(tracked) => prop_assert!(tracked.value.is_some_and(f64::is_finite)),
            Err(_) => prop_assert_eq!(receiver, before),
        }
    }

    #[test]
    fn any_stream(words in prop::collection::vec(any::<u32>(), 0..40), coded in any::<bool>()) {
        let silence = if coded { Silence::Coded } else { Silence::Timed };
        let mut receiver = Receiver::new(Config::new(0.1).unwrap());
        let mut reader = StreamReader::new(&words, silence).unwrap();
        for _ in 0..200 {
            match receiver.read_after(1, &mut reader) {
                Ok(value) => prop_assert!(value.is_finite()),
                Err(_) => break,
            }
        }
    }
}

#[test]
fn packets_are_messages() {
    let mut sensor = Sensor::new(Config::new(0.01).unwrap().resilient(7, Some(31)).unwrap());
    for x in mixed(6, 500).into_iter().chain([1e300, 1.0 / 3.0, -1e-200, 0.5]) {
        if let Some(report) = sensor.encode(x).unwrap() {
            laws::message::round_trip(&report.packet, &()).unwrap();
        }
    }
}
