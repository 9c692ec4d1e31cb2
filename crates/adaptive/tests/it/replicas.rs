//! Both ends, streams, and restarts: the same bits.

use super::common::mixed;
use fewbits_adaptive::{Config, FixedRate, Receiver, Sensor, Silence, StreamReader, StreamWriter};
use fewbits_core::Message;

/// Sensor and receiver stored as text and read back every 1000 slots go on as those that never stopped.
#[test]
fn replicas_agree_to_the_bit_across_restarts() {
    let config = Config::new(0.02).unwrap();
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    let (mut other, mut other_receiver) = (sensor.clone(), receiver.clone());
    for (n, sample) in mixed(7, 20_000).into_iter().enumerate() {
        let report = sensor.encode(sample).unwrap();
        receiver.receive(&report.map(|r| r.packet).into()).unwrap();
        assert_eq!(other.encode(sample).unwrap(), report);
        other_receiver.receive(&report.map(|r| r.packet).into()).unwrap();
        assert_eq!(receiver.tracked().value, sensor.reconstruction());
        if n % 1000 == 999 {
            other = serde_json::from_str(&serde_json::to_string(&other).unwrap()).unwrap();
            other_receiver = serde_json::from_str(&serde_json::to_string(&other_receiver).unwrap()).unwrap();
            assert_eq!(sensor, other);
            assert_eq!(receiver, other_receiver);
            let bits = |weights: [f64; 24]| weights.map(f64::to_bits);
            assert_eq!(bits(sensor.model_weights()), bits(receiver.model_weights()));
        }
    }
}

/// As above, over ten million samples; ten seconds.
#[test]
#[ignore = "long: cargo test -p fewbits-adaptive --release -- --ignored ten_million"]
fn replicas_agree_to_the_bit_over_ten_million_samples() {
    let config = Config::new(0.05).unwrap();
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    let (mut n, mut reports) = (0_u64, 0_u64);
    for seed in 0..100 {
        for sample in mixed(seed, 100_000) {
            let report = sensor.encode(sample).unwrap();
            reports += u64::from(report.is_some());
            let tracked = receiver.receive(&report.map(|r| r.packet).into()).unwrap();
            assert_eq!(tracked.value.map(f64::to_bits), sensor.reconstruction().map(f64::to_bits));
            assert!((tracked.value.unwrap() - sample).abs() <= 0.05);
            n += 1;
        }
        let bits = |weights: [f64; 24]| weights.map(f64::to_bits);
        assert_eq!(bits(sensor.model_weights()), bits(receiver.model_weights()));
        let stored = [
            serde_json::to_value(&sensor).unwrap(),
            serde_json::to_value(&receiver).unwrap(),
        ];
        assert_eq!(stored[0]["replica"], stored[1]["replica"]);
        let [left, right] = stored;
        sensor = serde_json::from_value(left).unwrap();
        receiver = serde_json::from_value(right).unwrap();
    }
    assert_eq!(n, 10_000_000);
    println!("{reports} reports");
}

#[test]
fn what_was_not_stored_by_a_sensor_is_refused() {
    let mut sensor = Sensor::new(Config::new(0.1).unwrap());
    sensor.encode(1.5).unwrap();
    let stored = serde_json::to_value(&sensor).unwrap();
    for (path, value) in [
        ("/replica/bank/w/3", serde_json::json!(-0.5)),
        ("/replica/residuals/0/total", serde_json::json!(u32::MAX)),
        ("/config/delta", serde_json::json!(0.0)),
        ("/replica/lattice/step", serde_json::json!(0.0)),
        ("/replica/last", serde_json::json!(i64::MAX)),
        ("/replica/gap", serde_json::json!(0)),
        ("/replica/lattice/delta", serde_json::json!(0.2)),
        ("/replica/bank/x/0", serde_json::json!(1e300)),
    ] {
        let mut broken = stored.clone();
        *broken.pointer_mut(path).unwrap() = value;
        assert!(serde_json::from_value::<Sensor>(broken).is_err(), "{path}");
    }
}

/// Two thousand sensors and receivers, each stored after another number of samples, and all go on with the same bits.
#[test]
fn sensors_stored_as_text_go_on_with_the_same_bits() {
    let config = Config::new(0.037).unwrap().circular(359.9).unwrap();
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    for sample in mixed(11, 2000) {
        let report = sensor.encode(sample).unwrap();
        receiver.receive(&report.map(|r| r.packet).into()).unwrap();
        let stored = [
            serde_json::to_value(&sensor).unwrap(),
            serde_json::to_value(&receiver).unwrap(),
        ];
        assert_eq!(serde_json::from_str::<Sensor>(&stored[0].to_string()).unwrap(), sensor);
        receiver = serde_json::from_str(&stored[1].to_string()).unwrap();
        assert_eq!(receiver.tracked().value, sensor.reconstruction());
        let bits = |weights: [f64; 24]| weights.map(f64::to_bits);
        assert_eq!(bits(sensor.model_weights()), bits(receiver.model_weights()));
    }
}

#[test]
fn fixed_rates_stored_as_text_go_on_with_the_same_bits() {
    for bits in 1..=3 {
        let (mut sensor, mut receiver) =
            (FixedRate::new(bits, 0.3, 20.0).unwrap(), FixedRate::new(bits, 0.3, 20.0).unwrap());
        for sample in mixed(12, 700) {
            let word = sensor.encode(sample).unwrap();
            let stored = serde_json::to_value(&receiver).unwrap();
            receiver = serde_json::from_str(&stored.to_string()).unwrap();
            assert_eq!(receiver.receive(word).unwrap().to_bits(), sensor.estimate().to_bits());
        }
        let mut strange = serde_json::to_value(&sensor).unwrap();
        strange["belief"] = serde_json::json!({"probabilities": [1.0], "modes": [{"mean": [0.0, 0.0], "covariance": [1.0, 0.0, 0.0, 1.0]}]});
        assert!(serde_json::from_value::<FixedRate>(strange).is_err());
    }
}

/// Packets survive as bits, their lengths are less than a bit above the ideal ones, and a stream is within one percent.
#[test]
fn lengths_are_what_they_should_be() {
    let config = Config::new(0.02).unwrap();
    let samples = mixed(8, 30_000);
    for silence in [Silence::Timed, Silence::Coded] {
        let (mut sensor, mut packets) = (Sensor::new(config), Sensor::new(config));
        let mut stream = StreamWriter::new(silence);
        let (mut ideal, mut quiet) = (0.0, Vec::new());
        for sample in &samples {
            sensor.write_after(1, *sample, &mut stream).unwrap();
            let report = packets.encode(*sample).unwrap();
            quiet.push(report.is_none());
            if let Some(report) = report {
                let bits = report.packet.to_bits(&()).unwrap();
                assert_eq!(fewbits_adaptive::Packet::from_bits(&(), &bits).unwrap(), report.packet);
                // What follows an escape costs a prefix.
                let most = if bits.bits() > 24 { 2.0 } else { 1.0 };
                assert!((bits.bits() as f64) < report.information + most + 1e-9);
                ideal += report.information;
            }
        }
        assert_eq!(sensor, packets);
        let words = stream.finish();
        let spent = 32.0 * words.len() as f64;
        match silence {
            Silence::Timed => assert!((spent - ideal).abs() < 0.01 * ideal + 64.0, "{spent} {ideal}"),
            Silence::Coded => assert!(spent > ideal && spent < ideal + 1.01 * samples.len() as f64),
        }
        let mut receiver = Receiver::new(config);
        let mut reader = StreamReader::new(&words, silence).unwrap();
        for (sample, quiet) in samples.iter().zip(quiet) {
            reader.next_slot(quiet);
            let value = receiver.read_after(1, &mut reader).unwrap();
            assert!((value - sample).abs() <= 0.02);
        }
    }
}

#[test]
fn gaps_between_samples_are_known_to_both() {
    let config = Config::new(0.05).unwrap();
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    let signal = |t: u32| 3.0 * (f64::from(t) * 0.05).sin();
    let (mut t, mut bits) = (0, 0.0);
    for n in 0..2000 {
        let elapsed = [1, 1, 2, 7, 1, 300][n % 6];
        t += elapsed;
        let report = sensor.encode_after(elapsed, signal(t)).unwrap();
        bits += report.map_or(0.0, |r| r.information);
        let tracked = receiver
            .receive_after(elapsed, &report.map(|r| r.packet).into())
            .unwrap();
        assert!((tracked.value.unwrap() - signal(t)).abs() <= 0.05);
    }
    assert!(bits < 8.0 * 2000.0);
}

#[test]
fn fixed_rate_replicas_agree_and_follow() {
    for bits in 1..=3 {
        let (mut sensor, mut receiver) =
            (FixedRate::new(bits, 0.1, 0.0).unwrap(), FixedRate::new(bits, 0.1, 0.0).unwrap());
        let mut squares = 0.0;
        for n in 0..600 {
            let sample = (f64::from(n) * 0.05).sin() + 0.3 * (f64::from(n) * 0.31).sin();
            let word = sensor.encode(sample).unwrap();
            let estimate = receiver.receive(word).unwrap();
            assert_eq!(sensor, receiver);
            squares += (estimate - sample).powi(2) / 600.0;
        }
        let most = [0.25, 0.12, 0.05][bits as usize - 1];
        assert!(squares.sqrt() < most, "{bits}: {}", squares.sqrt());
        assert!(sensor.encode(f64::NAN).is_err());
        assert_eq!(sensor, receiver);
    }
    assert!(FixedRate::new(4, 1.0, 0.0).is_err() && FixedRate::new(1, 0.0, 0.0).is_err());
}
