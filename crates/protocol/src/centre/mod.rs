//! The fusion centre's state machine.

mod parts;

pub use parts::{Action, CentreSettings, CentreTimer, Member, Recipient};

use crate::echo::echo;
use crate::frame::{DecodeError, Frame, Kind, digest};
use crate::note::Note;
use crate::payload::Payload;
use crate::sensor::Feedback;
use crate::slot::Slot;
use fewbits_core::{BitString, Observation};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// State machine of the centre of a star network. It takes events and returns [`Action`]s.
///
/// ```text
/// on_timer(slot begins) -> SetTimer (deadline, next slot), Predict
/// on_predicted(feedback of each sensor, state) -> Send (feedback, echo or snapshot, each with a digest)
/// on_frame(report of this slot and digest) -> kept, perhaps Send (acknowledgement)
/// on_timer(deadline) -> Update
/// ```
/// A report of another slot is late. A report with another digest answers other feedback than was sent and is no observation. A second
/// report is a duplicate. If the driver missed slots, or is too late for one, they are skipped: their sensors were not asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Centre {
    settings: CentreSettings,
    /// The last slot that began; 0 before the first.
    slot: u64,
    /// Whether reports of the slot are still accepted.
    open: bool,
    /// Per sensor the digest of what it was sent.
    digests: Vec<u32>,
    observed: Vec<Observation<BitString>>,
    /// Per sensor whether its answer in this slot belongs to other feedback than it was sent.
    unusable: Vec<bool>,
    /// The slot of `observed`, once its update is done and it can be echoed.
    echoed: Option<u64>,
    /// Whether a sensor asked for the whole state.
    asked: bool,
    /// Per sensor the last slot in which it sent a frame to this centre.
    heard: Vec<Option<Slot>>,
    /// The sensors that said last that their reports mean something else than this centre was told.
    #[serde(default)]
    unlike: BTreeSet<usize>,
}

impl Centre {
    /// A centre before its first slot. Start it by [`on_timer`](Self::on_timer) with [`CentreTimer::SlotBegins`].
    pub fn new(settings: CentreSettings) -> Self {
        let sensors = settings.members.len();
        Self {
            settings,
            slot: 0,
            open: false,
            digests: vec![0; sensors],
            observed: vec![Observation::Nothing; sensors],
            unusable: vec![false; sensors],
            echoed: Some(0),
            asked: false,
            heard: vec![None; sensors],
            unlike: BTreeSet::new(),
        }
    }

    /// The settings.
    pub fn settings(&self) -> &CentreSettings {
        &self.settings
    }

    /// The last slot that began; 0 before the first.
    pub fn slot(&self) -> u64 {
        self.slot
    }

    /// Whether a frame answers what this sensor was sent in the slot that is open: a report, or a heartbeat in place of one.
    pub fn is_answer(&self, sensor: usize, frame: &Frame<'_>) -> bool {
        self.open
            && matches!(frame.kind, Kind::Report | Kind::Heartbeat)
            && frame.slot == Slot::of_count(self.slot)
            && self.is_digest(sensor, frame.digest)
    }

    /// Whether the sensor says that its reports mean something else than this centre was told.
    pub fn is_unlike(&self, sensor: usize) -> bool {
        self.unlike.contains(&sensor)
    }

    /// Whether a digest is that of what the sensor was sent, with its meaning or without one.
    fn is_digest(&self, sensor: usize, found: u32) -> bool {
        let told = self.digests.get(sensor).map(|sent| sent ^ found);
        told.is_some_and(|meaning| meaning == 0 || meaning == self.settings.meaning(sensor))
    }

    /// Tells the machine that the estimator has lost its state. It sends the whole state to followers next.
    pub fn on_memory_lost(&mut self) {
        self.open = false;
        self.asked = true;
        self.echoed = None;
    }

    /// Continues after the program was stopped in a slot. `slot` is the last that may have begun; its reports are lost, and it does not
    /// begin again.
    pub fn resume(&mut self, slot: u64) {
        self.slot = self.slot.max(slot);
        self.on_memory_lost();
    }

    /// A timer has fired; `now` in nanoseconds. Actions are appended to `actions`.
    pub fn on_timer(&mut self, now: u64, timer: CentreTimer, actions: &mut Vec<Action>) {
        match timer {
            CentreTimer::SlotBegins => self.on_slot_begins(now, actions),
            CentreTimer::Deadline => self.on_deadline(actions),
        }
    }

    fn on_slot_begins(&mut self, now: u64, actions: &mut Vec<Action>) {
        // A deadline that fires late must not close the next slot.
        self.on_deadline(actions);
        let schedule = &self.settings.schedule;
        let count = schedule.count(now);
        let next = schedule.start(count.max(self.slot).saturating_add(1));
        actions.push(Action::SetTimer {
            at: next,
            timer: CentreTimer::SlotBegins,
        });
        // The clock was set back, or the slot is the one in which the program was stopped: no slot begins twice.
        if count <= self.slot {
            return;
        }
        // Too late for answers: the program was started within the slot, or was held up.
        if now.saturating_sub(schedule.start(count)) > self.settings.latest_start {
            return;
        }
        self.slot = count;
        actions.push(Action::SetTimer {
            at: schedule.start(count).saturating_add(self.settings.deadline),
            timer: CentreTimer::Deadline,
        });
        actions.push(Action::Predict { slot: count });
    }

    /// The driver has predicted. `feedback` has what each sensor is sent, empty if nothing; `state` is the
    /// receiver's state before the prediction, needed if a sensor follows by echo.
    pub fn on_predicted(&mut self, feedback: &[BitString], state: Option<&BitString>, actions: &mut Vec<Action>) {
        let slot = Slot::of_count(self.slot);
        let empty = BitString::default();
        let told = |i: usize| feedback.get(i).unwrap_or(&empty);
        let members = &self.settings.members;
        let encode = |frame: Frame<'_>| frame.to_bytes(self.settings.check);

        // If all sensors are sent the same, one frame goes to all.
        let mut spoken = false;
        let all_alike = members.iter().all(|member| member.feedback == Feedback::Told)
            && (1..members.len()).all(|i| told(i) == told(0));
        for (i, member) in members.iter().enumerate() {
            let payload = match member.feedback {
                Feedback::Told => Payload::from(told(i)),
                _ => Payload::EMPTY,
            };
            let sum = digest(slot, payload);
            self.digests[i] = sum;
            if member.feedback != Feedback::Told || all_alike && i > 0 {
                continue;
            }
            let to = if all_alike {
                Recipient::All
            } else {
                Recipient::Sensor(i)
            };
            spoken |= all_alike;
            let frame = encode(Frame::new(Kind::Feedback, slot, sum, payload));
            actions.push(Action::Send { to, frame });
        }

        // Followers are sent what was observed in the slot before, or the whole state.
        let follows = |member: &Member| member.feedback == Feedback::Echoed;
        if let Some(state) = state.filter(|_| members.iter().any(follows)) {
            // A follower compares with its copy at the end of the slot before, so the digest is of the state before the prediction.
            let sum = digest(slot.before(), Payload::from(state));
            for (sum_of_member, _) in self.digests.iter_mut().zip(members).filter(|(_, m)| follows(m)) {
                *sum_of_member = sum;
            }
            let lengths: Vec<_> = members.iter().map(|member| member.report).collect();
            let connected = self.echoed.is_some_and(|of| of.checked_add(1) == Some(self.slot)) && !self.asked;
            let told = match echo(&self.usable(), &lengths) {
                Ok(echo) if connected => (Kind::Echo, echo),
                _ => (Kind::Snapshot, state.clone()),
            };
            self.asked = false;
            spoken = true;
            let frame = encode(Frame::new(told.0, slot, sum, Payload::from(&told.1)));
            let to = Recipient::All;
            actions.push(Action::Send { to, frame });
        }

        let every = u64::from(self.settings.announce_every);
        if !spoken && every > 0 && self.slot.is_multiple_of(every) {
            let frame = encode(Frame::new(Kind::Heartbeat, slot, 0, Payload::EMPTY));
            let to = Recipient::All;
            actions.push(Action::Send { to, frame });
        }
        // Only now: the echo above is made of the observations of the slot before.
        self.observed.fill(Observation::Nothing);
        for (sensor, unusable) in self.unusable.iter_mut().enumerate() {
            *unusable = self.unlike.contains(&sensor);
        }
        self.echoed = None;
        self.open = true;
    }

    fn on_deadline(&mut self, actions: &mut Vec<Action>) {
        if !std::mem::take(&mut self.open) {
            return;
        }
        self.echoed = Some(self.slot);
        actions.push(Action::Update {
            slot: self.slot,
            observed: self.usable(),
        });
    }

    fn usable(&self) -> Vec<Option<Observation<BitString>>> {
        let all = self.observed.iter().zip(&self.unusable);
        all.map(|(observed, unusable)| (!unusable).then(|| observed.clone()))
            .collect()
    }

    /// Bytes have arrived. The link guarantees that they are from this sensor.
    pub fn on_frame(&mut self, sensor: usize, bytes: &[u8], actions: &mut Vec<Action>) {
        match Frame::decode(bytes, self.settings.check) {
            Ok(frame) => self.on_decoded(sensor, &frame, actions),
            Err(error) => {
                if !matches!(error, DecodeError::Version { .. }) {
                    self.on_damaged(sensor);
                }
                let note = error.into();
                actions.push(Action::Note { sensor, note });
            }
        }
    }

    /// A damaged frame has arrived from a sensor: its report of this slot was sent and is lost.
    pub fn on_damaged(&mut self, sensor: usize) {
        if let Some(observed) = self.observed.get_mut(sensor)
            && self.open
            && *observed == Observation::Nothing
        {
            *observed = Observation::Lost;
        }
    }

    /// A decoded frame has arrived from a sensor.
    pub fn on_decoded(&mut self, sensor: usize, frame: &Frame<'_>, actions: &mut Vec<Action>) {
        let (kind, slot) = (frame.kind, frame.slot);
        let mut note = |note| actions.push(Action::Note { sensor, note });
        let (is_digest, own) = (self.is_digest(sensor, frame.digest), self.settings.meaning(sensor));
        let (Some(member), Some(sent)) = (self.settings.members.get(sensor), self.digests.get(sensor)) else {
            return note(Note::Unexpected { kind });
        };
        let observed = &mut self.observed[sensor];
        let is_now = self.open && slot == Slot::of_count(self.slot);
        // Only what is of this slot, or of none, tells what the sensor was told.
        let found = match kind {
            Kind::Heartbeat if slot == Slot::default() => frame.digest,
            Kind::Heartbeat | Kind::Report if is_now => frame.digest ^ sent,
            _ => 0,
        };
        let is_unlike = found != 0 && own != 0 && found != own;
        if is_unlike {
            self.unlike.insert(sensor);
            self.unusable[sensor] = true;
        } else if found != 0 || is_now {
            // What answers this slot's question is an observation.
            self.unusable[sensor] &= !(self.unlike.remove(&sensor) && is_now);
        }
        match kind {
            Kind::Request => {
                self.asked = true;
                note(Note::Disagreement { slot });
            }
            Kind::Heartbeat if is_unlike => note(Note::OtherMeaning { slot, found }),
            Kind::Heartbeat => note(Note::Heartbeat { slot }),
            // The order of these arms is the order of the checks: slot, repetition, digest, length.
            Kind::Report if !is_now => return note(Note::Late { slot }),
            Kind::Report if *observed != Observation::Nothing => note(Note::Duplicate { slot }),
            Kind::Report if !is_digest => {
                // The sensor answered other feedback than it was sent, or was told another scheme: the meaning of its report is unknown.
                (*observed, self.unusable[sensor]) = (Observation::Lost, true);
                note(match is_unlike {
                    true => Note::OtherMeaning { slot, found },
                    false => Note::Disagreement { slot },
                });
            }
            Kind::Report if !member.report.allows(frame.payload.bits()) => {
                *observed = Observation::Lost;
                note(Note::Malformed { slot });
            }
            Kind::Report => *observed = Observation::Received(frame.payload.into()),
            kind => return note(Note::Unexpected { kind }),
        }
        self.heard[sensor] = Some(slot);
        if kind == Kind::Report && self.settings.acknowledges {
            let ack = Frame::new(Kind::Acknowledgement, slot, frame.digest, Payload::EMPTY);
            let (to, frame) = (Recipient::Sensor(sensor), ack.to_bytes(self.settings.check));
            actions.push(Action::Send { to, frame });
        }
    }
}
