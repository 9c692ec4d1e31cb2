//! The sensor's state machine.

mod settings;

pub use settings::{Feedback, SensorSettings};

use crate::frame::{Frame, Kind, digest};
use crate::note::Note;
use crate::payload::Payload;
use crate::slot::Slot;

/// Timers of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum SensorTimer {
    /// A slot begins for a sensor that reports by the clock.
    SlotBegins,
    /// No acknowledgement has come in time.
    Unacknowledged {
        /// The report's slot.
        slot: Slot,
    },
}

/// What the driver must do next. A driver must handle every variant, so the enum is exhaustive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Task<'a> {
    /// Nothing.
    Wait,
    /// Before the next event: measure, encode the report with this feedback, and call [`Sensor::on_sample`].
    Sample {
        /// The slot.
        slot: Slot,
        /// The feedback as it was sent. Empty with [`Feedback::Clock`]; with [`Feedback::Echoed`] the driver's copy of the filter has it.
        feedback: Payload<'a>,
    },
    /// Bring the copy of the filter to the end of the slot before `slot` by this payload, and call [`Sensor::on_followed`].
    Follow {
        /// The slot that begins.
        slot: Slot,
        /// [`Kind::Echo`]: what the centre received in the slot before. [`Kind::Snapshot`]: the state itself.
        kind: Kind,
        /// The echo or the state.
        payload: Payload<'a>,
    },
    /// Send this frame to the centre.
    Send(Frame<'a>),
    /// Send the bytes of the last report again.
    SendAgain,
}

/// What follows from an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reaction<'a> {
    /// What to do next.
    pub task: Task<'a>,
    /// A timer to set: time in nanoseconds, and what to pass to [`Sensor::on_timer`]. Several may run at once, and fire late but not early.
    pub timer: Option<(u64, SensorTimer)>,
    /// A note to record.
    pub note: Option<Note>,
}

impl Reaction<'static> {
    const NOTHING: Self = Self {
        task: Task::Wait,
        timer: None,
        note: None,
    };
}

fn noted(note: Note) -> Reaction<'static> {
    Reaction {
        note: Some(note),
        ..Reaction::NOTHING
    }
}

/// Stage of a sensor within a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
enum Stage {
    /// It waits for a frame or a timer.
    Idle,
    /// The driver updates the copy of the filter, whose state should then have this digest.
    Following { slot: Slot, digest: u32, kind: Kind },
    /// The driver measures.
    Sampling { slot: Slot, digest: u32 },
    /// A report was sent and may be repeated this often.
    Awaiting { slot: Slot, repeats: u8 },
}

/// State machine of a sensor of a star network. It takes events and returns [`Reaction`]s. It has no clock, no socket and no estimator.
/// Times are nanoseconds of any clock that does not go back.
///
/// ```text
/// told:     on_frame(feedback) -> Sample;  on_sample(report or silence) -> Send
/// clock:    on_timer(slot begins) -> Sample, next timer;  on_sample -> Send
/// echoed:   on_frame(echo or snapshot) -> Follow;  on_followed(digest of the replica) -> Sample, or Send(request);  on_sample -> Send
/// repeats:  on_sample -> Send, timer;  on_ack ends it;  on_timer -> SendAgain
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub struct Sensor {
    settings: SensorSettings,
    stage: Stage,
    /// The last slot in which it answered or began to.
    answered: Option<Slot>,
    /// The last slot to whose beginning the copy of the filter was updated.
    followed: Option<Slot>,
    silent: u32,
    /// Beginning of the next slot for a sensor that reports by the clock. Timers that were set before the clock was corrected fire earlier
    /// and are ignored.
    begins_at: u64,
}

impl Sensor {
    /// A sensor before its first slot. If it reports by the clock, start it by [`on_timer`](Self::on_timer) with
    /// [`SensorTimer::SlotBegins`].
    pub fn new(settings: SensorSettings) -> Self {
        Self {
            settings,
            stage: Stage::Idle,
            answered: None,
            followed: None,
            silent: 0,
            begins_at: 0,
        }
    }

    /// The settings. The schedule includes the corrections by the centre's frames.
    pub fn settings(&self) -> &SensorSettings {
        &self.settings
    }

    /// The last slot in which it answered; `None` before the first.
    pub fn answered(&self) -> Option<Slot> {
        self.answered
    }

    /// Tells the machine that the driver's copy of the filter is lost: an echo no longer suffices, a snapshot does. It does not answer a
    /// slot twice.
    pub fn on_memory_lost(&mut self) {
        self.followed = None;
        self.stage = Stage::Idle;
    }

    /// Bytes have arrived.
    pub fn on_frame<'a>(&mut self, now: u64, bytes: &'a [u8]) -> Reaction<'a> {
        match Frame::decode(bytes, self.settings.check) {
            Ok(frame) => self.on_decoded(now, frame),
            Err(error) => noted(error.into()),
        }
    }

    /// A decoded frame has arrived.
    pub fn on_decoded<'a>(&mut self, now: u64, frame: Frame<'a>) -> Reaction<'a> {
        let slot = frame.slot;
        let is_broadcast = match (self.settings.feedback, frame.kind) {
            (_, Kind::Acknowledgement) => return self.on_ack(slot),
            (Feedback::Told, Kind::Feedback) | (Feedback::Echoed, Kind::Echo | Kind::Snapshot) => true,
            (Feedback::Clock, Kind::Feedback | Kind::Echo | Kind::Snapshot | Kind::Heartbeat) => false,
            (_, Kind::Heartbeat) => return self.on_meaning(slot, frame.digest),
            (_, kind) => return noted(Note::Unexpected { kind }),
        };
        if !is_broadcast {
            return self.on_slot_announced(now, slot);
        }
        match self.answered {
            Some(answered) if answered == slot => return noted(Note::Duplicate { slot }),
            Some(answered) if !slot.is_after(answered) => return noted(Note::Late { slot }),
            _ => {}
        }
        if let Some(schedule) = &self.settings.schedule
            && slot != Slot::of_count(schedule.count(now))
        {
            return noted(Note::Late { slot });
        }
        if frame.kind != Kind::Feedback {
            return self.follow(frame);
        }
        // The digest of feedback is computed from the feedback: with a check of the header only, a mismatch shows inverted bits.
        if digest(slot, frame.payload) != frame.digest {
            return noted(Note::Disagreement { slot });
        }
        self.sample(slot, frame.digest, frame.payload)
    }

    /// The centre says what it takes reports for.
    fn on_meaning(&self, slot: Slot, found: u32) -> Reaction<'static> {
        let own = self.settings.meaning;
        match found {
            found if found == 0 || own == 0 || found == own => Reaction::NOTHING,
            found => noted(Note::OtherMeaning { slot, found }),
        }
    }

    /// The frame by which a sensor that was not asked says that it is there, and what its reports mean.
    pub fn hello(&self) -> Frame<'static> {
        let slot = match self.settings.meaning {
            0 => self.answered.unwrap_or_default(),
            // By slot 0 it differs from a late answer.
            _ => Slot::default(),
        };
        Frame::new(Kind::Heartbeat, slot, self.settings.meaning, Payload::EMPTY)
    }

    fn sample<'a>(&mut self, slot: Slot, digest: u32, feedback: Payload<'a>) -> Reaction<'a> {
        self.answered = Some(slot);
        self.stage = Stage::Sampling { slot, digest };
        Reaction {
            task: Task::Sample { slot, feedback },
            ..Reaction::NOTHING
        }
    }

    fn follow<'a>(&mut self, frame: Frame<'a>) -> Reaction<'a> {
        let Frame { kind, slot, digest, .. } = frame;
        // An echo is of one slot: it suits a copy at the beginning of that slot, and the first echo suits a new copy.
        let connects = kind == Kind::Snapshot || self.followed == Some(slot.before()) || self.is_first(slot);
        if !connects {
            return self.disagree(slot);
        }
        self.stage = Stage::Following { slot, digest, kind };
        let payload = frame.payload;
        Reaction {
            task: Task::Follow { slot, kind, payload },
            ..Reaction::NOTHING
        }
    }

    /// Whether this is slot 1, which begins with the state that both ends were configured with.
    fn is_first(&self, slot: Slot) -> bool {
        slot == Slot::of_count(1) && self.answered.is_none()
    }

    /// The states differ: asks for the whole state.
    fn disagree(&mut self, slot: Slot) -> Reaction<'static> {
        self.followed = None;
        self.stage = Stage::Idle;
        Reaction {
            task: Task::Send(Frame::new(Kind::Request, slot, 0, Payload::EMPTY)),
            note: Some(Note::Disagreement { slot }),
            timer: None,
        }
    }

    /// The driver has updated its copy of the filter. `state` is the [`digest`] of its bits after the slot before; `None` if the update
    /// failed.
    pub fn on_followed(&mut self, state: Option<u32>) -> Reaction<'static> {
        let Stage::Following { slot, digest, kind } = self.stage else {
            return noted(Note::Misuse);
        };
        if state != Some(digest) {
            return self.disagree(slot);
        }
        let resynchronised = kind == Kind::Snapshot && self.followed != Some(slot.before());
        self.followed = Some(slot);
        Reaction {
            note: resynchronised.then_some(Note::Resynchronised { slot }),
            ..self.sample(slot, digest, Payload::EMPTY)
        }
    }

    /// The driver has measured. `report` is `None` for silence, also without a measurement.
    pub fn on_sample<'a>(&mut self, now: u64, report: Option<Payload<'a>>) -> Reaction<'a> {
        let Stage::Sampling { slot, digest } = self.stage else {
            return noted(Note::Misuse);
        };
        let digest = digest ^ self.settings.meaning;
        self.stage = Stage::Idle;
        // After many silent slots send a heartbeat: it tells the centre that the sensor works.
        let Some(report) = report else {
            self.silent = self.silent.saturating_add(1);
            if self.settings.heartbeat_after == 0 || self.silent < self.settings.heartbeat_after {
                return Reaction::NOTHING;
            }
            self.silent = 0;
            return Reaction {
                task: Task::Send(Frame::new(Kind::Heartbeat, slot, digest, Payload::EMPTY)),
                ..Reaction::NOTHING
            };
        };
        self.silent = 0;
        let mut timer = None;
        if self.settings.repeats > 0 {
            let repeats = self.settings.repeats;
            self.stage = Stage::Awaiting { slot, repeats };
            timer = Some(self.unacknowledged_at(now, slot));
        }
        Reaction {
            task: Task::Send(Frame::new(Kind::Report, slot, digest, report)),
            timer,
            note: None,
        }
    }

    fn unacknowledged_at(&self, now: u64, slot: Slot) -> (u64, SensorTimer) {
        (now.saturating_add(self.settings.patience), SensorTimer::Unacknowledged { slot })
    }

    /// The centre has acknowledged the report of a slot.
    pub fn on_ack(&mut self, acknowledged: Slot) -> Reaction<'static> {
        if matches!(self.stage, Stage::Awaiting { slot, .. } if slot == acknowledged) {
            self.stage = Stage::Idle;
        }
        Reaction::NOTHING
    }

    /// A timer has fired.
    pub fn on_timer(&mut self, now: u64, timer: SensorTimer) -> Reaction<'static> {
        match timer {
            SensorTimer::SlotBegins => self.on_slot_begins(now),
            SensorTimer::Unacknowledged { slot } => match self.stage {
                Stage::Awaiting { slot: own, repeats: 0 } if own == slot => {
                    self.stage = Stage::Idle;
                    noted(Note::Unacknowledged { slot })
                }
                Stage::Awaiting { slot: own, repeats } if own == slot => {
                    let repeats = repeats - 1;
                    self.stage = Stage::Awaiting { slot, repeats };
                    Reaction {
                        task: Task::SendAgain,
                        timer: Some(self.unacknowledged_at(now, slot)),
                        note: None,
                    }
                }
                _ => Reaction::NOTHING,
            },
        }
    }

    fn on_slot_begins(&mut self, now: u64) -> Reaction<'static> {
        let (Feedback::Clock, Some(schedule)) = (self.settings.feedback, self.settings.schedule) else {
            return noted(Note::Misuse);
        };
        if now < self.begins_at {
            return Reaction::NOTHING;
        }
        let offset = self.settings.offset;
        let count = schedule.count(now.saturating_sub(offset));
        self.begins_at = schedule.start(count.saturating_add(1)).saturating_add(offset);
        let timer = Some((self.begins_at, SensorTimer::SlotBegins));
        let slot = Slot::of_count(count);
        // After a clock was set back a slot may begin twice: do not answer it again.
        if self.answered.is_some_and(|answered| !slot.is_after(answered)) {
            return Reaction {
                timer,
                ..Reaction::NOTHING
            };
        }
        Reaction {
            timer,
            ..self.sample(slot, digest(slot, Payload::EMPTY), Payload::EMPTY)
        }
    }

    /// The centre has begun a slot: a sensor that reports by the clock sets its clock by it.
    fn on_slot_announced(&mut self, now: u64, slot: Slot) -> Reaction<'static> {
        let Some(schedule) = &mut self.settings.schedule else {
            return Reaction::NOTHING;
        };
        schedule.synchronise(slot, now);
        // The announced slot is reported in too, unless that was done before the clock was set back.
        let offset = self.settings.offset;
        let next = schedule.count(now.saturating_sub(offset)).saturating_add(1);
        self.begins_at = schedule.start(next).saturating_add(offset);
        Reaction {
            timer: Some((self.begins_at, SensorTimer::SlotBegins)),
            ..Reaction::NOTHING
        }
    }
}
