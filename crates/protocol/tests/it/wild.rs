//! Wild events: machines driven with any times, frames and bits in any order answer, and wait for what they asked for.

use fewbits_core::{BitString, Observation};
use fewbits_protocol::{
    Action, Centre, CentreSettings, CentreTimer, Check, Feedback, Frame, Kind, Member, Payload, ReportLength, Schedule,
    Sensor, SensorSettings, SensorTimer, Slot, Task, digest, echo, reports_of,
};
use proptest::prelude::*;
use std::num::NonZeroU64;

/// Times and counts at the ends of their range and in it.
fn number() -> impl Strategy<Value = u64> {
    prop_oneof![
        2 => 0..5000_u64,
        1 => any::<u64>(),
        1 => prop::sample::select(vec![0, 1, (1 << 24) - 1, 1 << 24, u64::MAX - 1, u64::MAX]),
    ]
}

fn feedback(which: u64) -> Feedback {
    [Feedback::Told, Feedback::Clock, Feedback::Echoed][(which % 3) as usize]
}

fn length(which: u64) -> ReportLength {
    if which.is_multiple_of(2) {
        ReportLength::Varying
    } else {
        ReportLength::Fixed((which % 40) as u32)
    }
}

fn kind(which: u64) -> Kind {
    let all = [
        Kind::Feedback,
        Kind::Report,
        Kind::Echo,
        Kind::Snapshot,
        Kind::Request,
        Kind::Heartbeat,
        Kind::Handover,
        Kind::Acknowledgement,
    ];
    all[(which % all.len() as u64) as usize]
}

fn bits(bytes: &[u8], which: u64) -> BitString {
    let bits = (which % (8 * bytes.len() as u64 + 1)) as usize;
    BitString::from_bytes(bytes.to_vec(), bits).unwrap_or_default()
}

proptest! {
    #[test]
    fn centres_answer_any_events(period in number(), which in prop::array::uniform4(any::<u64>()), events in prop::collection::vec((0..8_u8, number(), number(), prop::collection::vec(any::<u8>(), 0..30)), 0..20)) {
        let schedule = Schedule::new(NonZeroU64::new(period).unwrap_or(NonZeroU64::MIN));
        let members = which[..3].iter().map(|w| Member { feedback: feedback(*w), report: length(*w >> 8) }).collect();
        let mut settings = CentreSettings::new(members, schedule);
        (settings.deadline, settings.acknowledges, settings.announce_every) = (which[3], which[0] & 64 == 0, (which[1] % 4) as u32);
        let mut centre = Centre::new(settings);
        let mut actions = Vec::new();
        for (event, a, b, bytes) in events {
            let (before, sensor) = (centre.slot(), (b % 5) as usize);
            let given = bits(&bytes, b);
            match event {
                0 => centre.on_timer(a, CentreTimer::SlotBegins, &mut actions),
                1 => centre.on_timer(a, CentreTimer::Deadline, &mut actions),
                2 => centre.on_predicted(&vec![given; sensor], None, &mut actions),
                3 => centre.on_predicted(&[], Some(&given), &mut actions),
                4 => centre.on_frame(sensor, &bytes, &mut actions),
                5 => {
                    let payload = Payload::from(&given);
                    let slot = Slot::of_count(if a % 2 == 0 { before } else { a });
                    centre.on_decoded(sensor, &Frame::new(kind(b), slot, digest(slot, payload), payload), &mut actions);
                }
                6 => centre.on_damaged(sensor),
                _ if a % 2 == 0 => centre.on_memory_lost(),
                _ => centre.resume(b),
            }
            // Slots never go back, and what is handed on is one observation for each sensor.
            prop_assert!(centre.slot() >= before);
            for action in actions.drain(..) {
                match action {
                    Action::Update { slot, observed } => prop_assert!(slot <= centre.slot() && observed.len() == 3),
                    Action::Send { frame, .. } => prop_assert!(Frame::decode(&frame, Check::Whole).is_ok()),
                    Action::Predict { slot } => prop_assert_eq!(slot, centre.slot()),
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn sensors_answer_any_events(which in any::<u64>(), period in number(), events in prop::collection::vec((0..8_u8, number(), number(), prop::collection::vec(any::<u8>(), 0..30)), 0..20)) {
        let mut settings = SensorSettings::new(feedback(which));
        settings.schedule = NonZeroU64::new(period).map(Schedule::new);
        (settings.heartbeat_after, settings.repeats, settings.patience) = ((which >> 8) as u32 % 3, (which >> 16) as u8 % 4, which >> 24);
        let mut sensor = Sensor::new(settings);
        for (event, a, b, bytes) in events {
            let given = bits(&bytes, b);
            let payload = Payload::from(&given);
            let slot = Slot::of_count(b);
            let reaction = match event {
                0 => sensor.on_frame(a, &bytes),
                1 | 2 => sensor.on_decoded(a, Frame::new(kind(b >> 3), slot, digest(slot, payload), payload)),
                3 => sensor.on_followed((a % 3 > 0).then_some(digest(slot.before(), payload))),
                4 => sensor.on_sample(a, (b % 3 > 0).then_some(payload)),
                5 => sensor.on_ack(slot),
                6 => sensor.on_timer(a, SensorTimer::SlotBegins),
                _ if a % 2 == 0 => sensor.on_timer(b, SensorTimer::Unacknowledged { slot }),
                _ => { sensor.on_memory_lost(); continue }
            };
            if let Some((at, _)) = reaction.timer {
                // Beyond the last count that a schedule holds, slots begin no more.
                prop_assert!(event == 7 || at >= a || a > u64::MAX / 2, "{} before {}", at, a);
            }
            if let Task::Sample { slot, .. } = reaction.task {
                prop_assert_eq!(sensor.answered(), Some(slot));
            }
            if let Task::Send(frame) = reaction.task {
                let mut buffer = vec![0; frame.len()];
                prop_assert!(frame.encode(Check::Whole, &mut buffer).is_some());
                prop_assert_eq!(Frame::decode(&buffer, Check::Whole), Ok(frame));
            }
        }
    }

    #[test]
    fn echoes_return_what_was_observed(which in prop::array::uniform3(any::<u64>()), bytes in prop::collection::vec(any::<u8>(), 0..30)) {
        let lengths = which.map(|w| length(w >> 2));
        let observed = which.map(|w| match w % 5 {
            0 => Some(Observation::Nothing),
            1 => Some(Observation::Lost),
            2 => None,
            _ => Some(Observation::Received(bits(&bytes, w >> 8))),
        });
        let allowed = observed.iter().zip(lengths).all(|(seen, length)| match seen {
            Some(Observation::Received(report)) => match length {
                ReportLength::Fixed(expected) => report.bits() == expected as usize,
                ReportLength::Varying => report.bits() < 1 << 16,
            },
            _ => true,
        });
        if let Ok(told) = echo(&observed, &lengths) && allowed {
            prop_assert_eq!(reports_of(&told, &lengths).ok(), Some(observed.to_vec()));
        }
        if let Ok(read) = reports_of(&bits(&bytes, which[0]), &lengths) {
            prop_assert_eq!(echo(&read, &lengths).ok(), Some(bits(&bytes, which[0])));
        }
    }

    #[test]
    fn schedules_count_what_they_start(period in number(), count in number(), now in number()) {
        let schedule = Schedule::new(NonZeroU64::new(period).unwrap_or(NonZeroU64::MIN));
        prop_assert!(schedule.start(schedule.count(now)) <= now);
        let _ = schedule.start(count);
    }
}
