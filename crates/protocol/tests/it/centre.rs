//! The centre's machine, alone and with sensors around it.

use fewbits_core::{BitString, Observation};
use fewbits_protocol::{
    Action, Centre, CentreSettings, CentreTimer, Check, Feedback, Frame, Kind, Member, Note, Outcome, Payload,
    Receiver, Recipient, ReportLength, Schedule, Sensor, SensorSettings, Slot, Task, digest, reports_of,
    update_or_drop,
};
use std::num::NonZeroU64;

fn settings(feedback: Feedback, sensors: usize) -> CentreSettings {
    let report = ReportLength::Fixed(1);
    let schedule = Schedule::new(NonZeroU64::new(1000).unwrap());
    CentreSettings::new(vec![Member { feedback, report }; sensors], schedule)
}

fn bit() -> BitString {
    BitString::from_bytes(vec![0x80], 1).unwrap()
}

fn begin(centre: &mut Centre, slot: u64, told: &[BitString], state: Option<&BitString>) -> Vec<Action> {
    let mut actions = Vec::new();
    centre.on_timer(1000 * slot, CentreTimer::SlotBegins, &mut actions);
    assert_eq!(actions.last(), Some(&Action::Predict { slot }));
    actions.clear();
    centre.on_predicted(told, state, &mut actions);
    actions
}

fn report(slot: u64, sum: u32) -> Vec<u8> {
    let mut bytes = vec![0; 11];
    let bit = Payload::new(&[0x80], 1).unwrap();
    Frame::new(Kind::Report, Slot::of_count(slot), sum, bit)
        .encode(Check::Whole, &mut bytes)
        .unwrap();
    bytes
}

fn observed(centre: &mut Centre) -> Vec<Option<Observation<BitString>>> {
    let mut actions = Vec::new();
    centre.on_timer(u64::MAX, CentreTimer::Deadline, &mut actions);
    match actions.pop() {
        Some(Action::Update { observed, .. }) => observed,
        other => panic!("{other:?}"),
    }
}

#[test]
fn equal_feedback_is_sent_once() {
    let mut centre = Centre::new(settings(Feedback::Told, 3));
    let told = begin(&mut centre, 1, &vec![bit(); 3], None);
    assert!(matches!(&told[..], [Action::Send { to: Recipient::All, .. }]));
    let mut different = vec![bit(); 3];
    different[1] = BitString::from_bytes(vec![0], 1).unwrap();
    assert_eq!(begin(&mut centre, 2, &different, None).len(), 3);
}

#[test]
fn reports_are_taken_once_and_in_time() {
    let mut centre = Centre::new(settings(Feedback::Clock, 5));
    begin(&mut centre, 4, &[], None);
    let sum = digest(Slot::of_count(4), Payload::EMPTY);
    let mut notes = Vec::new();
    centre.on_frame(0, &report(4, sum), &mut notes);
    centre.on_frame(0, &report(4, sum), &mut notes);
    centre.on_frame(1, &report(3, sum), &mut notes);
    centre.on_frame(2, &report(4, !sum), &mut notes);
    let mut damaged = report(4, sum);
    damaged[8] ^= 0x80;
    centre.on_frame(3, &damaged, &mut notes);
    centre.on_frame(9, &report(4, sum), &mut notes);
    let slot = Slot::of_count(4);
    let expected = |note: &Note| match note {
        Note::Duplicate { .. } => 0,
        Note::Late { .. } => 1,
        Note::Disagreement { slot: at } if *at == slot => 2,
        Note::Damaged(_) => 3,
        Note::Unexpected { .. } => 9,
        _ => 99,
    };
    for action in &notes {
        let Action::Note { sensor, note } = action else {
            panic!()
        };
        assert_eq!(expected(note), *sensor);
    }
    assert_eq!(notes.len(), 5);
    let [received, nothing, lost] = [Observation::Received(bit()), Observation::Nothing, Observation::Lost];
    // The third answers other feedback: no observation.
    let expected = [Some(received), Some(nothing.clone()), None, Some(lost), Some(nothing)];
    assert_eq!(observed(&mut centre), expected);
    // After the deadline nothing is awaited.
    notes.clear();
    centre.on_frame(1, &report(4, sum), &mut notes);
    assert_eq!(
        notes,
        [Action::Note {
            sensor: 1,
            note: Note::Late { slot }
        }]
    );
}

#[test]
fn a_slot_never_begins_twice() {
    let mut centre = Centre::new(settings(Feedback::Clock, 1));
    begin(&mut centre, 4, &[], None);
    let mut resumed = Centre::new(settings(Feedback::Clock, 1));
    resumed.resume(4);
    let mut actions = Vec::new();
    for centre in [&mut centre, &mut resumed] {
        actions.clear();
        centre.on_timer(4500, CentreTimer::SlotBegins, &mut actions);
        let at = 5000;
        let next = Action::SetTimer {
            at,
            timer: CentreTimer::SlotBegins,
        };
        assert_eq!(actions.last(), Some(&next));
        assert!(!actions.contains(&Action::Predict { slot: 4 }));
    }
}

/// Sensors that were asked too late are not silent: such a slot passes.
#[test]
fn a_slot_does_not_begin_without_time_for_answers() {
    // Half of the time to the deadline of 900, and a tenth of it where sensors report by the clock.
    for (feedback, latest) in [(Feedback::Told, 450), (Feedback::Clock, 90)] {
        for late in [0, 1, latest, latest + 1, 899, 900, 950, 999] {
            let mut centre = Centre::new(settings(feedback, 2));
            let mut actions = Vec::new();
            centre.on_timer(7000 + late, CentreTimer::SlotBegins, &mut actions);
            let begins = actions.contains(&Action::Predict { slot: 7 });
            assert_eq!((begins, centre.slot()), (late <= latest, if late <= latest { 7 } else { 0 }), "{late}");
            let timers = actions.iter().filter_map(|action| match action {
                Action::SetTimer { at, timer } => Some((*at, *timer)),
                _ => None,
            });
            let timers: Vec<_> = timers.collect();
            assert_eq!(timers[0], (8000, CentreTimer::SlotBegins));
            assert_eq!(timers.len(), 1 + usize::from(begins));
            // The next begins.
            actions.clear();
            centre.on_timer(8000, CentreTimer::SlotBegins, &mut actions);
            assert!(actions.contains(&Action::Predict { slot: 8 }));
        }
    }
}

/// Counts its reports: the state is slot and count.
#[derive(Clone, Debug, PartialEq)]
struct Counter {
    slot: u64,
    count: u64,
    refuses_silence: bool,
}

impl Receiver for Counter {
    fn sensors(&self) -> usize {
        2
    }
    fn predict(&mut self, slot: u64) -> Result<(), fewbits_protocol::BoxError> {
        self.slot = slot;
        Ok(())
    }
    fn feedback(&self, _: usize) -> Result<BitString, fewbits_protocol::BoxError> {
        Ok(BitString::default())
    }
    fn update(&mut self, observed: &[(usize, Observation<BitString>)]) -> Result<(), fewbits_protocol::BoxError> {
        let silent = observed.iter().any(|(_, o)| *o == Observation::Nothing);
        if silent && self.refuses_silence {
            return Err("silence is impossible".into());
        }
        self.count += observed
            .iter()
            .filter(|(_, o)| matches!(o, Observation::Received(_)))
            .count() as u64;
        Ok(())
    }
    fn estimate(&self) -> Vec<(f64, f64)> {
        vec![(self.count as f64, 0.0)]
    }
    fn state(&self) -> Result<BitString, fewbits_protocol::BoxError> {
        let bytes = [self.slot.to_be_bytes(), self.count.to_be_bytes()].concat();
        Ok(BitString::from_bytes(bytes, 128)?)
    }
    fn restore(&mut self, state: &BitString) -> Result<(), fewbits_protocol::BoxError> {
        let (slot, count) = state.bytes().split_at_checked(8).ok_or("state")?;
        self.slot = u64::from_be_bytes(slot.try_into()?);
        self.count = u64::from_be_bytes(count.try_into()?);
        Ok(())
    }
}

#[test]
fn impossible_silence_is_not_asked_and_not_lost() {
    let mut counter = Counter {
        slot: 0,
        count: 0,
        refuses_silence: true,
    };
    let heard = [Some(Observation::Received(bit())), Some(Observation::Nothing)];
    assert!(matches!(update_or_drop(&mut counter, &heard), Outcome::SilentDropped(_)));
    assert_eq!(counter.count, 1);
}

/// Ten thousand slots in which frames are lost, doubled and late, and memories are lost: followers that answer share the centre's state.
#[test]
fn followers_never_answer_from_another_state() {
    let mut chance = {
        let mut state = 1_u64;
        move |one_in: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33).is_multiple_of(one_in)
        }
    };
    let start = Counter {
        slot: 0,
        count: 0,
        refuses_silence: false,
    };
    let mut centre = Centre::new(settings(Feedback::Echoed, 2));
    let mut receiver = start.clone();
    let mut sensors = [(); 2].map(|()| (Sensor::new(SensorSettings::new(Feedback::Echoed)), start.clone()));
    let (mut answers, mut late, mut snapshots) = (0, None::<Vec<u8>>, 0);
    for slot in 1..=10_000 {
        if chance(97) {
            centre.on_memory_lost();
            receiver.count /= 2;
        }
        let before = receiver.state().unwrap();
        let actions = begin(&mut centre, slot, &[], Some(&before));
        receiver.predict(slot).unwrap();
        let [
            Action::Send {
                to: Recipient::All,
                frame,
            },
        ] = &actions[..]
        else {
            panic!("{actions:?}")
        };
        snapshots += usize::from(Frame::decode(frame, Check::Whole).unwrap().kind == Kind::Snapshot);
        let mut to_centre = Vec::new();
        for (i, (sensor, replica)) in sensors.iter_mut().enumerate() {
            if chance(89) {
                sensor.on_memory_lost();
                replica.count = 0;
            }
            let arriving = [
                late.clone().filter(|_| chance(3)),
                Some(frame.clone()).filter(|_| !chance(7)),
                Some(frame.clone()).filter(|_| chance(9)),
            ];
            for bytes in arriving.into_iter().flatten() {
                let mut reaction = sensor.on_frame(0, &bytes);
                if let Task::Follow { slot, kind, payload } = reaction.task {
                    let mut next = replica.clone();
                    let told = BitString::from(payload);
                    if kind == Kind::Snapshot {
                        next.restore(&told).unwrap();
                    } else if slot != Slot::of_count(1) {
                        let reports = reports_of(&told, &[ReportLength::Fixed(1); 2]).unwrap();
                        next.predict(u64::from(slot.before())).unwrap();
                        update_or_drop(&mut next, &reports);
                    }
                    let state = digest(slot.before(), Payload::from(&next.state().unwrap()));
                    *replica = next;
                    reaction = sensor.on_followed(Some(state));
                }
                if let Task::Sample { slot: asked, .. } = reaction.task {
                    // Whoever answers the present slot shares the state that the centre had before it predicted.
                    if asked == Slot::of_count(slot) {
                        assert_eq!(replica.state().unwrap(), before);
                    }
                    answers += 1;
                    let reported = bit();
                    reaction = sensor.on_sample(0, Some(Payload::from(&reported)).filter(|_| !chance(4)));
                    if let Task::Send(frame) = reaction.task {
                        to_centre.push((i, frame.encode(Check::Whole, &mut [0; 32]).unwrap().to_vec()));
                    }
                } else if let Task::Send(frame) = reaction.task {
                    to_centre.push((i, frame.encode(Check::Whole, &mut [0; 32]).unwrap().to_vec()));
                }
            }
        }
        late = Some(frame.clone());
        for (i, bytes) in to_centre {
            if !chance(7) {
                centre.on_frame(i, &bytes, &mut Vec::new());
            }
        }
        let observed = observed(&mut centre);
        update_or_drop(&mut receiver, &observed);
    }
    assert!(answers > 12_000 && snapshots > 100, "{answers} answers, {snapshots} snapshots");
}

/// A sensor that was told another scheme: neither its reports nor its silence are observations, until it says what the centre was told, or
/// nothing. Late frames and those of a centre that was told nothing change nothing.
#[test]
fn reports_that_mean_something_else_are_no_observations() {
    let mut settings = settings(Feedback::Told, 1);
    settings.meanings = vec![7];
    let mut centre = Centre::new(settings);
    let sum = |slot: u64| digest(Slot::of_count(slot), Payload::from(&bit()));
    let hello =
        |meaning: u32| Frame::new(Kind::Heartbeat, Slot::of_count(0), meaning, Payload::EMPTY).to_bytes(Check::Whole);
    let received = Some(Observation::Received(bit()));
    // What comes in a slot, what is observed, and what the note has found.
    let mut slots = 0;
    let mut expect = |sent: &dyn Fn(u64) -> Vec<Vec<u8>>, seen: Option<Observation<BitString>>, noted: Option<u32>| {
        slots += 1;
        begin(&mut centre, slots, &[bit()], None);
        let mut actions = Vec::new();
        sent(slots)
            .iter()
            .for_each(|bytes| centre.on_frame(0, bytes, &mut actions));
        let found = actions.iter().find_map(|action| match action {
            Action::Note {
                note: Note::OtherMeaning { found, .. },
                ..
            } => Some(*found),
            _ => None,
        });
        assert_eq!(found, noted, "slot {slots}");
        assert_eq!(observed(&mut centre), [seen], "slot {slots}");
    };
    expect(&|slot| vec![report(slot, sum(slot))], received.clone(), None);
    expect(&|slot| vec![report(slot, sum(slot) ^ 7)], received.clone(), None);
    expect(&|slot| vec![report(slot, sum(slot) ^ 6)], None, Some(6));
    // Its silence says nothing, whatever comes late.
    expect(&|_| vec![], None, None);
    expect(&|slot| vec![report(slot - 1, sum(slot - 1) ^ 7)], None, None);
    expect(&|slot| vec![report(slot, sum(slot) ^ 7)], received.clone(), None);
    expect(&|slot| vec![report(slot - 1, sum(slot - 1) ^ 6)], Some(Observation::Nothing), None);
    expect(&|_| vec![hello(6)], None, Some(6));
    expect(&|_| vec![hello(0)], None, None);
    expect(&|_| vec![hello(7)], None, None);
    expect(&|_| vec![], Some(Observation::Nothing), None);
    assert!(!centre.is_unlike(0));
}
