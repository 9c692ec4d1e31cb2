//! `receive --sensor`: frames of a sensor with the adaptive encoder.

use super::{folder, good, text};
use fewbits_adaptive::{Config, Sensor as Encoder};
use fewbits_core::Message;
use fewbits_protocol::{Check, Feedback, Payload, Schedule, Sensor, SensorSettings, SensorTimer, Task};
use std::num::NonZeroU64;

const DELTA: f64 = 0.05;
const REFRESH: u64 = 50;
const SLOTS: u64 = 1000;

/// A slow wave with a step every 90 slots.
fn sample(slot: u64) -> f64 {
    (0.02 * slot as f64).sin() + (slot / 90) as f64
}

/// The frames of all slots, each with its slot, as they go over a line.
fn frames(heartbeat_after: u32) -> Vec<(u64, Vec<u8>)> {
    let config = Config::new(DELTA).unwrap().resilient(4, Some(REFRESH)).unwrap();
    let period = NonZeroU64::new(1_000_000).unwrap();
    let mut settings = SensorSettings::new(Feedback::Clock);
    settings.schedule = Some(Schedule::new(period));
    settings.heartbeat_after = heartbeat_after;
    let (mut encoder, mut sensor, mut frames) = (Encoder::new(config), Sensor::new(settings), Vec::new());
    for slot in 0..SLOTS {
        let now = slot * period.get();
        sensor.on_timer(now, SensorTimer::SlotBegins);
        let report = encoder.encode(sample(slot)).unwrap();
        let bits = report.map(|report| report.packet.to_bits(&()).unwrap());
        if let Task::Send(frame) = sensor.on_sample(now, bits.as_ref().map(Payload::from)).task {
            let mut line = cobs::encode_vec(frame.encode(Check::Whole, &mut [0; 64]).unwrap());
            line.push(0);
            frames.push((slot, line));
        }
    }
    frames
}

/// Slots and values, after a check that values that are there are within the bound.
fn received(stream: &[u8]) -> Vec<(u64, Option<f64>)> {
    let (_kept, folder) = folder();
    let table = text(&good(&folder, &["receive", "--sensor", "±0.05"], stream));
    let rows = table.lines().skip(1).map(|line| {
        let (slot, value) = line.split_once(',').unwrap();
        (slot.parse().unwrap(), value.parse().ok())
    });
    let rows: Vec<(u64, Option<f64>)> = rows.collect();
    for (slot, value) in &rows {
        assert!(value.is_none_or(|value| (value - sample(*slot)).abs() <= DELTA), "slot {slot}");
    }
    rows
}

fn line(frames: &[(u64, Vec<u8>)]) -> Vec<u8> {
    frames.iter().flat_map(|(_, frame)| frame.clone()).collect()
}

#[test]
fn every_slot_up_to_the_last_frame_is_within_the_bound() {
    let frames = frames(10);
    let rows = received(&line(&frames));
    let last = frames.last().unwrap().0;
    assert!(last >= SLOTS - 10);
    assert!(rows.iter().map(|row| row.0).eq(0..=last));
    assert!(rows.iter().all(|row| row.1.is_some()));
}

#[test]
fn lost_and_damaged_frames_cost_gaps_up_to_the_next_refresh() {
    let mut frames = frames(0);
    let count = frames.len();
    frames.remove(count / 3);
    let damaged = &mut frames[2 * count / 3].1;
    damaged[5] ^= 0x40;
    // The receiver begins in the middle of the second frame.
    let rows = received(&line(&frames)[frames[0].1.len() + 3..]);
    let gaps = rows.iter().filter(|row| row.1.is_none()).count() as u64;
    assert!((3..=3 * REFRESH).contains(&gaps), "{gaps} gaps");
    assert_eq!(rows.last().unwrap().0, frames.last().unwrap().0);
}

#[test]
fn bound_of_a_share_is_refused_for_a_sensor() {
    let (_kept, folder) = folder();
    let refused = super::fewbits(&folder, &["receive", "--sensor", "1%"], b"");
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("--sensor"));
}

#[test]
fn stream_without_a_whole_frame_is_an_error() {
    let (_kept, folder) = folder();
    let whole = &frames(10)[0].1;
    let mut damaged = whole.clone();
    damaged[3] ^= 1;
    for stream in [&b""[..], b"slot,value\n", &whole[..whole.len() - 3], &damaged] {
        let refused = super::fewbits(&folder, &["receive", "--sensor", "±0.05"], stream);
        assert_eq!(refused.status.code(), Some(1));
        assert!(text(&refused.stderr).contains("standard input: no whole frame"), "{}", text(&refused.stderr));
    }
}

/// A sensor that reports by the clock with words of a quantizer, bits or values: a row a slot, gaps where it was silent.
#[test]
fn words_and_values_are_rows_too() {
    let period = NonZeroU64::new(1_000_000).unwrap();
    let stream = |report: &dyn Fn(u64) -> Option<(Vec<u8>, usize)>| {
        let mut settings = SensorSettings::new(Feedback::Clock);
        settings.schedule = Some(Schedule::new(period));
        let (mut sensor, mut line) = (Sensor::new(settings), Vec::new());
        for slot in 0..20 {
            let now = slot * period.get();
            sensor.on_timer(now, SensorTimer::SlotBegins);
            let bits = report(slot);
            let payload = bits.as_ref().map(|(bytes, bits)| Payload::new(bytes, *bits).unwrap());
            if let Task::Send(frame) = sensor.on_sample(now, payload).task {
                line.extend(cobs::encode_vec(frame.encode(Check::Whole, &mut [0; 64]).unwrap()));
                line.push(0);
            }
        }
        line
    };
    let speaks = |slot: u64| slot % 5 != 3 || slot == 19;
    let word = |slot: u64| speaks(slot).then(|| (vec![((slot * 3 % 8) as u8) << 5], 3));
    let bit = |slot: u64| speaks(slot).then(|| (vec![((slot % 2) as u8) << 7], 1));
    let wide = |slot: u64| speaks(slot).then(|| (((slot as u32) << 20 | 7).to_be_bytes().to_vec(), 32));
    let value = |slot: u64| speaks(slot).then(|| ((0.1 * slot as f64).to_be_bytes().to_vec(), 64));
    let (_kept, folder) = folder();
    let rows = |option: &str, stream: &[u8]| -> Vec<(u64, Option<f64>)> {
        let table = text(&good(&folder, &["receive", "--sensor", option], stream));
        let rows = table.lines().skip(1).map(|line| line.split_once(',').unwrap());
        rows.map(|(slot, value)| (slot.parse().unwrap(), value.parse().ok()))
            .collect()
    };
    let expected = |of: &dyn Fn(u64) -> f64| -> Vec<(u64, Option<f64>)> {
        (0..20).map(|slot| (slot, speaks(slot).then(|| of(slot)))).collect()
    };
    assert_eq!(rows("word:3", &stream(&word)), expected(&|slot| (slot * 3 % 8) as f64));
    assert_eq!(rows("bit", &stream(&bit)), expected(&|slot| (slot % 2) as f64));
    assert_eq!(rows("word:32", &stream(&wide)), expected(&|slot| ((slot << 20) + 7) as f64));
    assert_eq!(rows("value", &stream(&value)), expected(&|slot| 0.1 * slot as f64));
    // Another length than was said is a gap, and named; what is no scheme is refused.
    let output = super::fewbits(&folder, &["receive", "--sensor", "word:4"], &stream(&word));
    assert!(text(&output.stdout).lines().skip(1).all(|line| line.ends_with(',')));
    assert!(text(&output.stderr).contains("it has 3 bits, `--sensor` says 4"));
    for wrong in ["word:0", "word:33", "word:x", "words"] {
        let output = super::fewbits(&folder, &["receive", "--sensor", wrong], &[]);
        assert!(!output.status.success() && text(&output.stderr).contains("word:32"), "{wrong}");
    }
}
