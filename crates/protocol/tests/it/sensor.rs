//! The sensor's machine.

use fewbits_protocol::{
    Check, Feedback, Frame, Kind, Note, Payload, Reaction, Schedule, Sensor, SensorSettings, SensorTimer, Slot, Task,
    digest,
};
use std::num::NonZeroU64;

fn slot(count: u64) -> Slot {
    Slot::of_count(count)
}

fn told(count: u64, byte: &[u8; 1]) -> Vec<u8> {
    let payload = Payload::new(byte, 8).unwrap();
    bytes(Frame::new(Kind::Feedback, slot(count), digest(slot(count), payload), payload))
}

fn bytes(frame: Frame<'_>) -> Vec<u8> {
    let mut bytes = vec![0; frame.len()];
    frame.encode(Check::Whole, &mut bytes).unwrap();
    bytes
}

fn one() -> Option<Payload<'static>> {
    Payload::new(&[0x80], 1)
}

fn sent<'a>(reaction: &Reaction<'a>) -> Frame<'a> {
    match reaction.task {
        Task::Send(frame) => frame,
        other => panic!("{other:?}"),
    }
}

#[test]
fn told_sensor_answers_each_slot_once() {
    let mut sensor = Sensor::new(SensorSettings::new(Feedback::Told));
    for count in [5, 6, 9] {
        let frame = told(count, &[7]);
        assert!(matches!(sensor.on_frame(0, &frame).task, Task::Sample { .. }));
        let report = sensor.on_sample(0, one());
        assert_eq!((sent(&report).slot, sent(&report).kind), (slot(count), Kind::Report));
        assert_eq!(sensor.on_frame(0, &frame).note, Some(Note::Duplicate { slot: slot(count) }));
    }
    assert_eq!(sensor.on_frame(0, &told(8, &[7])).note, Some(Note::Late { slot: slot(8) }));
    assert_eq!(sensor.on_sample(0, None).note, Some(Note::Misuse));
}

#[test]
fn reports_carry_the_digest_of_what_was_told() {
    let mut sensor = Sensor::new(SensorSettings::new(Feedback::Told));
    let payload = Payload::new(&[7], 8).unwrap();
    sensor.on_frame(0, &told(5, &[7]));
    assert_eq!(sent(&sensor.on_sample(0, one())).digest, digest(slot(5), payload));
    // A frame whose payload is not that of its digest is not answered.
    let other = bytes(Frame::new(Kind::Feedback, slot(6), 1, payload));
    let reaction = sensor.on_frame(0, &other);
    assert_eq!((reaction.task, reaction.note), (Task::Wait, Some(Note::Disagreement { slot: slot(6) })));
}

#[test]
fn damaged_and_future_frames_are_left_alone() {
    let mut sensor = Sensor::new(SensorSettings::new(Feedback::Told));
    let before = sensor.clone();
    let mut frame = told(5, &[7]);
    frame[3] ^= 1;
    assert!(matches!(sensor.on_frame(0, &frame).note, Some(Note::Damaged(_))));
    frame[0] ^= 0b1100_0000;
    assert_eq!(sensor.on_frame(0, &frame).note, Some(Note::FutureVersion { found: 2 }));
    assert_eq!(sensor, before);
}

#[test]
fn silence_is_followed_by_a_heartbeat() {
    let mut settings = SensorSettings::new(Feedback::Told);
    settings.heartbeat_after = 3;
    let mut sensor = Sensor::new(settings);
    let beats: Vec<bool> = (1..=9)
        .map(|count| {
            sensor.on_frame(0, &told(count, &[7]));
            sensor.on_sample(0, None).task != Task::Wait
        })
        .collect();
    assert_eq!(beats, [false, false, true, false, false, true, false, false, true]);
}

#[test]
fn reports_are_repeated_until_acknowledged() {
    let mut settings = SensorSettings::new(Feedback::Told);
    (settings.repeats, settings.patience) = (2, 100);
    let mut sensor = Sensor::new(settings);
    sensor.on_frame(0, &told(1, &[7]));
    let (at, timer) = sensor.on_sample(10, one()).timer.unwrap();
    assert_eq!(at, 110);
    assert_eq!(sensor.on_timer(at, timer).task, Task::SendAgain);
    let ack = bytes(Frame::new(Kind::Acknowledgement, slot(1), 0, Payload::EMPTY));
    assert_eq!(sensor.on_frame(120, &ack).note, None);
    assert_eq!(sensor.on_timer(210, timer).task, Task::Wait);
    // Without acknowledgement: two repeats, then a note.
    sensor.on_frame(300, &told(2, &[7]));
    let (_, timer) = sensor.on_sample(300, one()).timer.unwrap();
    assert_eq!(sensor.on_timer(400, timer).task, Task::SendAgain);
    assert_eq!(sensor.on_timer(500, timer).task, Task::SendAgain);
    assert_eq!(sensor.on_timer(600, timer).note, Some(Note::Unacknowledged { slot: slot(2) }));
    assert_eq!(sensor.on_timer(700, timer), sensor.on_ack(slot(2)));
}

#[test]
fn follower_asks_for_the_state_after_a_gap() {
    let mut sensor = Sensor::new(SensorSettings::new(Feedback::Echoed));
    let echo = |count: u64, kind| bytes(Frame::new(kind, slot(count), 40 + count as u32, Payload::EMPTY));
    for count in [1, 2] {
        let frame = echo(count, Kind::Echo);
        assert!(matches!(sensor.on_frame(0, &frame).task, Task::Follow { .. }));
        assert!(matches!(sensor.on_followed(Some(40 + count as u32)).task, Task::Sample { .. }));
        sensor.on_sample(0, None);
    }
    let frame = echo(4, Kind::Echo);
    assert_eq!(sent(&sensor.on_frame(0, &frame)).kind, Kind::Request);
    let frame = echo(5, Kind::Snapshot);
    assert!(matches!(
        sensor.on_frame(0, &frame).task,
        Task::Follow {
            kind: Kind::Snapshot,
            ..
        }
    ));
    assert_eq!(sensor.on_followed(Some(45)).note, Some(Note::Resynchronised { slot: slot(5) }));
    sensor.on_sample(0, None);
    // A replica of another digest asks, too.
    let frame = echo(6, Kind::Echo);
    sensor.on_frame(0, &frame);
    assert_eq!(sent(&sensor.on_followed(Some(0))).kind, Kind::Request);
}

#[test]
fn clocked_sensor_follows_the_centres_clock() {
    let mut settings = SensorSettings::new(Feedback::Clock);
    settings.schedule = Some(Schedule::new(NonZeroU64::new(1000).unwrap()));
    let mut sensor = Sensor::new(settings);
    let begin = SensorTimer::SlotBegins;
    let first = sensor.on_timer(1000, begin);
    assert!(matches!(first.task, Task::Sample { .. }));
    assert_eq!(first.timer, Some((2000, begin)));
    sensor.on_sample(1000, one());
    // Its clock is 300 ns behind: slot 2 of the centre begins at its 1700.
    let beat = bytes(Frame::new(Kind::Heartbeat, slot(2), 0, Payload::EMPTY));
    assert_eq!(sensor.on_frame(1700, &beat).timer, Some((2700, begin)));
    // The timer of before is stale; the new one is slot 3.
    assert_eq!(sensor.on_timer(2000, begin).timer, None);
    sensor.on_timer(2700, begin);
    assert_eq!(sent(&sensor.on_sample(2700, one())).slot, slot(3));
}

/// Defect: slots and times at the end of their range overflowed.
#[test]
fn schedules_end_with_the_range_of_times() {
    let longest = Schedule::new(NonZeroU64::new(u64::MAX).unwrap());
    assert_eq!(longest.start(u64::MAX), u64::MAX);
    let mut settings = SensorSettings::new(Feedback::Clock);
    settings.schedule = Some(Schedule::new(NonZeroU64::MIN));
    let reaction = Sensor::new(settings).on_timer(u64::MAX, SensorTimer::SlotBegins);
    assert_eq!(reaction.timer, Some((u64::MAX, SensorTimer::SlotBegins)));
}

/// What reports mean is part of the digest of every answer and of the frame by which a sensor says that it is there, and the frames are no
/// longer. A sensor that says nothing of it sends what it always sent.
#[test]
fn answers_say_what_they_mean() {
    let payload = Payload::new(&[7], 8).unwrap();
    for meaning in [0, 3] {
        let mut settings = SensorSettings::new(Feedback::Told);
        (settings.meaning, settings.heartbeat_after) = (meaning, 1);
        let mut sensor = Sensor::new(settings);
        let hello = sensor.hello();
        assert_eq!((hello.slot, hello.digest, hello.kind), (slot(0), meaning, Kind::Heartbeat));
        sensor.on_frame(0, &told(5, &[7]));
        let answer = digest(slot(5), payload) ^ meaning;
        assert_eq!(sent(&sensor.on_sample(0, one())).digest, answer);
        sensor.on_frame(0, &told(6, &[7]));
        let silent = sensor.on_sample(0, None);
        assert_eq!((sent(&silent).digest, sent(&silent).kind), (digest(slot(6), payload) ^ meaning, Kind::Heartbeat));
        assert_eq!(sensor.hello().slot, if meaning == 0 { slot(6) } else { slot(0) });
        // What the centre was told: nothing, the same, something else.
        let notes = [0, 3, 4].map(|found| {
            let frame = bytes(Frame::new(Kind::Heartbeat, slot(6), found, Payload::EMPTY));
            let reaction = sensor.on_frame(0, &frame);
            assert_eq!(reaction.task, Task::Wait);
            reaction.note
        });
        let other = Note::OtherMeaning {
            slot: slot(6),
            found: 4,
        };
        assert_eq!(notes, [None, None, (meaning == 3).then_some(other)]);
    }
}
