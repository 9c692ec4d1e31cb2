//! Forged, truncated and replayed envelopes; a thousand sensors.

use crate::world::{Reports, key, peers, receiver, settings};
use fewbits_core::{BitString, Observation};
use fewbits_link::{Direction, Output, Peer, Station};
use fewbits_protocol::{BoxError, Check, Frame, Kind, Payload, Receiver, Slot, digest};
use std::net::SocketAddr;

const SECOND: u64 = 1_000_000_000;

fn address() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 9))
}

/// Resident memory of this process in bytes.
fn memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(text.split(' ').nth(1)?.parse::<u64>().ok()? * 4096)
}

fn attack(count: u32) {
    let mut station =
        Station::new(settings(Reports::Signs, SECOND, 10), receiver(Reports::Signs, 0.05), peers(10), None).unwrap();
    let mut outputs = Vec::new();
    station.on_time(SECOND, &mut outputs).unwrap();
    let slot = Slot::of_count(1);
    let bit = Payload::new(&[0x80], 1).unwrap();
    let frame = Frame::new(Kind::Report, slot, digest(slot, Payload::EMPTY), bit);
    let mut buffer = [0; 32];
    let frame = frame.encode(Check::Whole, &mut buffer).unwrap();
    let good = key(3).seal(Direction::ToCentre, 3, 1, frame);
    station.on_datagram(address(), &good, &mut outputs).unwrap();
    assert_eq!(station.counts().taken, 1);
    let before = memory();
    let mut state = std::env::var("FEWBITS_SEED").map_or(1_u64, |seed| seed.parse().unwrap());
    for _ in 0..count {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let (kind, at) = ((state >> 33) % 4, (state >> 40) as usize);
        let mut bad = good.clone();
        match kind {
            // Replayed as it was, one bit inverted, cut short, and sent under another's name.
            0 => {}
            1 => bad[at / 8 % good.len()] ^= 0x80 >> (at % 8),
            2 => bad.truncate(at % good.len()),
            _ => bad[..4].copy_from_slice(&((at as u32) % 64).to_be_bytes()),
        }
        if kind == 3 && bad == good {
            continue;
        }
        outputs.clear();
        station.on_datagram(address(), &bad, &mut outputs).unwrap();
        assert!(outputs.is_empty());
    }
    let counts = station.counts();
    assert_eq!(counts.taken, 1);
    assert!(counts.replayed > 0 && counts.forged > 0 && counts.short > 0 && counts.unknown > 0, "{counts:?}");
    if let (Some(before), Some(after)) = (before, memory()) {
        assert!(after < before + (4 << 20), "memory rose from {before} to {after}");
    }
}

#[test]
fn no_forged_envelope_is_taken() {
    attack(50_000);
}

#[test]
#[ignore = "10^6 envelopes"]
fn no_forged_envelope_of_a_million_is_taken() {
    attack(1_000_000);
}

/// A receiver that costs nothing: what is measured is the link.
struct Idle(usize);

impl Receiver for Idle {
    fn sensors(&self) -> usize {
        self.0
    }
    fn predict(&mut self, _: u64) -> Result<(), BoxError> {
        Ok(())
    }
    fn feedback(&self, _: usize) -> Result<BitString, BoxError> {
        Ok(BitString::from_bytes(vec![0; 8], 64)?)
    }
    fn update(&mut self, _: &[(usize, Observation<BitString>)]) -> Result<(), BoxError> {
        Ok(())
    }
    fn estimate(&self) -> Vec<(f64, f64)> {
        Vec::new()
    }
    fn state(&self) -> Result<BitString, BoxError> {
        Ok(BitString::default())
    }
    fn restore(&mut self, _: &BitString) -> Result<(), BoxError> {
        Ok(())
    }
}

/// Ten slots of a thousand sensors, feedback and report under the keys: a second of air in less than a second of one core.
#[test]
#[ignore = "a measurement"]
fn thousand_sensors_at_ten_slots_a_second() {
    const MANY: u32 = 1000;
    let folder = tempfile::tempdir().unwrap();
    let store = fewbits_link::Store::new(folder.path().join("state"));
    let known: Vec<Peer> = (0..MANY)
        .map(|number| Peer {
            address: Some(address()),
            number,
            key: key(number),
        })
        .collect();
    let mut station =
        Station::new(settings(Reports::Signs, SECOND / 10, MANY as usize), Idle(MANY as usize), known, Some(store))
            .unwrap();
    let told = Payload::new(&[0; 8], 64).unwrap();
    let (mut steps, mut envelopes, mut spent) = (0, 0_u64, std::time::Duration::ZERO);
    for count in 1..=100_u64 {
        let slot = Slot::of_count(count);
        let bit = Payload::new(&[0x80], 1).unwrap();
        let mut buffer = [0; 32];
        let frame = Frame::new(Kind::Report, slot, digest(slot, told), bit);
        let frame = frame.encode(Check::Whole, &mut buffer).unwrap();
        let reports: Vec<_> = (0..MANY)
            .map(|i| key(i).seal(Direction::ToCentre, i, count, frame))
            .collect();
        let start = std::time::Instant::now();
        let mut outputs = Vec::new();
        station.on_time(count * SECOND / 10, &mut outputs).unwrap();
        for report in &reports {
            station.on_datagram(address(), report, &mut outputs).unwrap();
        }
        station
            .on_time(count * SECOND / 10 + SECOND * 9 / 100, &mut outputs)
            .unwrap();
        spent += start.elapsed();
        envelopes += outputs.iter().filter(|o| matches!(o, Output::Datagram { .. })).count() as u64;
        steps += outputs.iter().filter(|o| matches!(o, Output::Step(step) if step.observed.iter().all(|o| matches!(o, Observation::Received(_))))).count();
    }
    println!("{spent:?} for 10 s of air: {steps} steps, {envelopes} envelopes out");
    assert_eq!((steps, envelopes), (100, 100_000));
    assert!(spent.as_secs_f64() < 10.0, "{spent:?} for 10 s of air");
}
