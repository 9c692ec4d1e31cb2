//! The fusion centre's state machine.

use crate::echo::{ReportLength, echo};
use crate::frame::{Check, DecodeError, Frame, Kind, digest};
use crate::note::Note;
use crate::payload::Payload;
use crate::sensor::Feedback;
use crate::slot::{Schedule, Slot};
use fewbits_core::{BitString, Observation};
use serde::{Deserialize, Serialize};

/// Settings of one sensor at its centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Member {
    /// How the sensor learns what it must know before it measures.
    pub feedback: Feedback,
    /// Length of its reports in bits.
    pub report: ReportLength,
}

/// Settings of a centre.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CentreSettings {
    /// One entry per sensor, in the order of their numbers from 0.
    pub members: Vec<Member>,
    /// When slots begin. Slots are counted from 1 on.
    pub schedule: Schedule,
    /// Nanoseconds from the beginning of a slot to its deadline. Reports that arrive later are not used.
    pub deadline: u64,
    /// A slot whose timer fires more nanoseconds after its beginning does not begin: its sensors would have no time to answer, and their
    /// silence would be taken for an observation. [`CentreSettings::new`] says half the time to the deadline, and a tenth of it if a sensor
    /// reports by the clock.
    #[serde(default = "any_time")]
    pub latest_start: u64,
    /// What the check of a frame covers.
    pub check: Check,
    /// Whether the centre acknowledges reports by frames. Not needed on a link that acknowledges by itself.
    pub acknowledges: bool,
    /// If so many slots pass in which nothing else is sent to all sensors, a heartbeat is sent, by which sensors set their clocks. 0:
    /// never.
    pub announce_every: u32,
}

impl CentreSettings {
    /// Settings with the deadline at nine tenths of a slot, a check of the whole frame, no acknowledgements and no heartbeats.
    pub fn new(members: Vec<Member>, schedule: Schedule) -> Self {
        let deadline = schedule.period() / 10 * 9;
        let by_clock = members.iter().any(|member| member.feedback == Feedback::Clock);
        Self {
            members,
            schedule,
            deadline,
            latest_start: deadline / if by_clock { 10 } else { 2 },
            check: Check::Whole,
            acknowledges: false,
            announce_every: 0,
        }
    }
}

/// As in settings that were stored without a latest start.
fn any_time() -> u64 {
    u64::MAX
}

/// Timers of a centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum CentreTimer {
    /// A slot begins.
    SlotBegins,
    /// The deadline of the slot: later reports are not used.
    Deadline,
}

/// The receiver of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recipient {
    /// To all sensors.
    All,
    /// The sensor of this number, counted from 0.
    Sensor(usize),
}

/// What the driver must do, in this order. A driver must handle every variant, so the enum is exhaustive.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Predict into this slot and call [`Centre::on_predicted`]. If the prediction fails, do nothing: the slot passes without update.
    Predict {
        /// The slot, counted from 1.
        slot: u64,
    },
    /// Update with these observations, one per sensor: see [`update_or_drop`](crate::update_or_drop).
    Update {
        /// The slot.
        slot: u64,
        /// The observations; `None` for a sensor that answered other feedback than it was sent.
        observed: Vec<Option<Observation<BitString>>>,
    },
    /// Send the bytes of a frame.
    Send {
        /// The receiver.
        to: Recipient,
        /// The frame's bytes.
        frame: Vec<u8>,
    },
    /// Set a timer. It may fire late but not early.
    SetTimer {
        /// Time at which it fires, in nanoseconds.
        at: u64,
        /// The timer to pass to [`Centre::on_timer`].
        timer: CentreTimer,
    },
    /// Record a note about a sensor.
    Note {
        /// The sensor's number.
        sensor: usize,
        /// The note.
        note: Note,
    },
}

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
            && self.digests.get(sensor) == Some(&frame.digest)
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
        self.unusable.fill(false);
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
        let Some(member) = self.settings.members.get(sensor) else {
            return note(Note::Unexpected { kind });
        };
        let observed = &mut self.observed[sensor];
        match kind {
            Kind::Request => {
                self.asked = true;
                note(Note::Disagreement { slot });
            }
            Kind::Heartbeat => note(Note::Heartbeat { slot }),
            // The order of these arms is the order of the checks: slot, repetition, digest, length.
            Kind::Report if slot != Slot::of_count(self.slot) || !self.open => return note(Note::Late { slot }),
            Kind::Report if *observed != Observation::Nothing => note(Note::Duplicate { slot }),
            Kind::Report if frame.digest != self.digests[sensor] => {
                // The sensor answered other feedback than it was sent: the meaning of its report is unknown.
                (*observed, self.unusable[sensor]) = (Observation::Lost, true);
                note(Note::Disagreement { slot });
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
