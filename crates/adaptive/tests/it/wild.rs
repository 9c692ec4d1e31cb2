//! Wild arguments: every step of a sensor or receiver is within its guarantee, or is refused and changes nothing.

use fewbits_adaptive::{Config, FixedRate, Packet, Receiver, Sensor};
use fewbits_core::laws::wild;
use fewbits_core::{BitString, Message, Observation};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn config(x: &[f64; 3], sequence_bits: u32) -> Option<Config> {
    let config = Config::new(x[0]).or_else(|_| Config::exact(x[0])).ok()?;
    let config = config.circular(x[1]).unwrap_or(config);
    let config = config.with_delta(x[2]).unwrap_or(config);
    Some(config.resilient(sequence_bits, Some(3)).unwrap_or(config))
}

proptest! {
    #[test]
    fn sensors_and_receivers_hold_numbers(x in prop::array::uniform3(wild()), samples in prop::collection::vec(wild(), 1..8), bits in 0..20_u32, elapsed in 0..3_u32, junk in prop::collection::vec(any::<u8>(), 0..20)) {
        let Some(config) = config(&x, bits) else { return Ok(()) };
        let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
        for sample in &samples {
            let before = sensor.clone();
            match sensor.encode_after(elapsed.max(1), *sample) {
                Ok(report) => {
                    prop_assert!(sample.is_finite());
                    prop_assert!(sensor.reconstruction().is_none_or(f64::is_finite), "{:?} {:?}", config, samples);
                    prop_assert!(sensor.model_weights().iter().all(|w| w.is_finite()));
                    let seen = Observation::from(report.map(|report| report.packet));
                    let tracked = receiver.receive_after(elapsed.max(1), &seen);
                    prop_assert!(tracked.is_ok_and(|t| t.value.is_none_or(f64::is_finite)), "{:?} {:?}", config, samples);
                }
                Err(_) => prop_assert_eq!(&sensor, &before),
            }
        }
        prop_assert!(sensor.encode_after(0, 1.0).is_err() && receiver.receive_after(0, &Observation::Nothing).is_err());
        let before = receiver.clone();
        let bits = junk.len() * 8;
        let Ok(packet) = BitString::from_bytes(junk, bits).map_err(|_| ()).and_then(|b| Packet::from_bits(&(), &b).map_err(|_| ())) else { return Ok(()) };
        match receiver.receive(&Observation::Received(packet)) {
            Ok(tracked) => prop_assert!(tracked.value.is_none_or(f64::is_finite), "{:?} {:?}", config, tracked),
            Err(_) => prop_assert_eq!(&receiver, &before),
        }
    }

    #[test]
    fn fixed_rates_hold_numbers(x in prop::array::uniform3(wild()), samples in prop::collection::vec(wild(), 1..8), bits in 0..20_u32) {
        if let Ok(mut sensor) = FixedRate::new(bits, x[0], x[1]) {
            let mut receiver = sensor.clone();
            for sample in &samples {
                let before = sensor.clone();
                match sensor.encode(*sample) {
                    Ok(word) => {
                        prop_assert!(sensor.estimate().is_finite(), "{} {:?}", sensor.estimate(), samples);
                        prop_assert_eq!(receiver.receive(word).ok(), Some(sensor.estimate()));
                    }
                    // What is stored is the state; scratch space is not.
                    Err(_) => prop_assert_eq!(serde_json::to_string(&sensor).unwrap(), serde_json::to_string(&before).unwrap()),
                }
            }
            if let Ok(estimate) = receiver.miss() {
                prop_assert!(estimate.is_finite());
            }
        }
    }
}
