//! Any bits give a reconstruction or an error, and an error changes nothing.

use super::common::mixed;
use fewbits_adaptive::{Config, FixedRate, Packet, Receiver, Sensor, Silence, StreamReader, StreamWriter};
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

/// Truncated at every word, every bit flipped, and read too far: none of it gives samples.
#[test]
fn damaged_sealed_streams_are_refused() {
    let config = Config::new(0.1).unwrap();
    let (mut sensor, mut stream) = (Sensor::new(config), StreamWriter::new(Silence::Coded));
    let samples = mixed(9, 600);
    for sample in &samples {
        sensor.write_after(1, *sample, &mut stream).unwrap();
    }
    let words = stream.seal();
    let open = |words: &[u32]| StreamReader::open(words, Silence::Coded).map(|reader| reader.slots_left());
    assert_eq!(open(&words).unwrap(), Some(600));
    for end in 0..words.len() {
        assert!(open(&words[..end]).is_err(), "{end}");
    }
    for bit in 0..32 * words.len() {
        let mut flipped = words.clone();
        flipped[bit / 32] ^= 1 << (bit % 32);
        assert!(open(&flipped).is_err(), "{bit}");
    }
    let mut reader = StreamReader::open(&words, Silence::Coded).unwrap();
    let mut receiver = Receiver::new(config);
    for sample in &samples {
        assert!((receiver.read_after(1, &mut reader).unwrap() - sample).abs() <= 0.1);
    }
    let before = receiver.clone();
    assert!(receiver.read_after(1, &mut reader).is_err());
    assert_eq!(receiver, before);
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

/// A packet with other bits; packets are stored as they are.
fn changed(packet: &Packet, change: impl FnOnce(u64) -> u64) -> Packet {
    let mut stored = serde_json::to_value(packet).unwrap();
    stored["word"] = change(stored["word"].as_u64().unwrap()).into();
    serde_json::from_value(stored).unwrap()
}

/// Every single wrong bit of every packet: an error that changes nothing, or a finite value; a refresh repairs it.
#[test]
fn every_flipped_bit_is_survived() {
    let line = Config::new(0.1).unwrap().resilient(4, Some(40)).unwrap();
    for config in [
        line,
        line.circular(360.0).unwrap(),
        line.with_delta(1e300).unwrap(),
        line.with_delta(1e-12).unwrap(),
    ] {
        let scale = if config.delta() > 1.0 { 1e300 } else { 1.0 };
        let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
        for (n, x) in mixed(12, 120).into_iter().enumerate() {
            let report = sensor.encode(scale * x).unwrap();
            let small = report.filter(|report| report.packet.bits() <= 63);
            for bit in 0..small.map_or(0, |report| report.packet.bits()) {
                let mut other = receiver.clone();
                let flipped = changed(&small.unwrap().packet, |word| word ^ (1 << bit));
                match other.receive(&Observation::Received(flipped)) {
                    Ok(tracked) => assert!(tracked.value.is_none_or(f64::is_finite), "{n} {bit}"),
                    Err(_) => assert_eq!(other, receiver),
                }
                for _ in 0..3 {
                    other.receive(&Observation::Nothing).unwrap();
                }
                let mut repaired = Sensor::new(config);
                let refresh = repaired.encode(scale).unwrap().unwrap();
                assert!(
                    other
                        .receive(&Observation::Received(refresh.packet))
                        .unwrap()
                        .synchronised
                );
            }
            receiver.receive(&report.map(|r| r.packet).into()).unwrap();
        }
    }
}

#[test]
fn a_refresh_that_names_no_model_is_refused() {
    let config = Config::new(0.1).unwrap().resilient(4, Some(40)).unwrap();
    let mut receiver = Receiver::new(config);
    let refresh = Sensor::new(config).encode(1.0).unwrap().unwrap().packet;
    let before = receiver.clone();
    let error = receiver
        .receive(&Observation::Received(changed(&refresh, |word| word | 31)))
        .unwrap_err();
    assert!(error.to_string().contains("model"), "{error}");
    assert_eq!(receiver, before);
}

#[test]
fn stored_packets_are_checked() {
    for (word, bits) in [(0, 129), (4, 2), (1, 0), (0, u32::MAX)] {
        let stored = serde_json::json!({"word": word, "bits": bits});
        assert!(serde_json::from_value::<Packet>(stored).is_err(), "{word} {bits}");
    }
}

/// A receiver that believes a silence that is none drifts, but neither overflows nor leaves the numbers.
#[test]
fn endless_silence_after_a_ramp_stays_finite() {
    for (delta, slope) in [(0.1, 10.0), (1e290, 1e302), (1e-9, 1e-3)] {
        let config = Config::new(delta).unwrap();
        let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
        for n in 0..50 {
            let report = sensor.encode(slope * f64::from(n)).unwrap();
            receiver.receive(&report.map(|r| r.packet).into()).unwrap();
        }
        for _ in 0..20_000 {
            let tracked = receiver.receive_after(1000, &Observation::Nothing).unwrap();
            assert!(tracked.value.is_some_and(f64::is_finite));
        }
        serde_json::from_str::<Receiver>(&serde_json::to_string(&receiver).unwrap()).unwrap();
    }
}

/// Around a circle of one, two or three points, differences of turns mean nothing, however long the gaps are.
#[test]
fn circles_of_few_points_never_wind_up() {
    for delta in [40.0, 70.0, 100.0, 200.0] {
        for elapsed in [1, 2, 64] {
            let config = Config::new(delta).unwrap().circular(360.0).unwrap();
            let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
            for n in 0..3000 {
                let sample = f64::from(n % 2) * 180.0 + f64::from(n % 3);
                let report = sensor.encode_after(elapsed, sample).unwrap();
                let tracked = receiver
                    .receive_after(elapsed, &report.map(|r| r.packet).into())
                    .unwrap();
                let straight = (tracked.value.unwrap() - sample).abs();
                assert!(straight.min(360.0 - straight) <= delta);
            }
        }
    }
}

/// A stream holds no headers: a resilient configuration reads back what it wrote.
#[test]
fn streams_of_resilient_configurations_agree() {
    let config = Config::new(0.05).unwrap().resilient(4, Some(10)).unwrap();
    let (mut sensor, mut stream) = (Sensor::new(config), StreamWriter::new(Silence::Coded));
    let samples = mixed(3, 2000);
    for x in &samples {
        sensor.write_after(1, *x, &mut stream).unwrap();
    }
    let words = stream.finish();
    let (mut receiver, mut reader) = (Receiver::new(config), StreamReader::new(&words, Silence::Coded).unwrap());
    for x in &samples {
        assert!((receiver.read_after(1, &mut reader).unwrap() - x).abs() <= 0.05);
    }
    assert_eq!(receiver.model_weights(), sensor.model_weights());
}

/// Words at any scale, and samples beyond it: an error that changes nothing, or a finite estimate.
#[test]
fn fixed_rate_words_survive_extremes() {
    for unit in [1e-300, 1e-150, 1e-9, 1.0, 1e9, 1e150, 1e300] {
        let Ok(mut sensor) = FixedRate::new(2, unit, 0.0) else {
            continue;
        };
        for x in [0.0, 1.0, -1e308, 1e308, 1e-308, 3.0 * unit, f64::MAX, f64::MIN, 0.0] {
            let before = sensor.clone();
            match sensor.encode(x) {
                Ok(_) => assert!(sensor.estimate().is_finite(), "{unit} {x}"),
                Err(_) => assert_eq!(sensor, before, "{unit} {x}"),
            }
        }
    }
}
