//! A sensor with protocol and key, without socket and clock.

use crate::envelope::{Direction, Key, Refusal, ReplayWindow, sensor_of};
use crate::error::Error;
use crate::station::Counts;
use crate::store::Store;
use fewbits_core::BitString;
use fewbits_numerics::error::refuse;
use fewbits_protocol::{
    DecodeError, Feedback, Frame, Kind, Note, Payload, Reaction, Sensor, SensorSettings, SensorTimer, Slot, Task,
};
use serde::{Deserialize, Serialize};

/// Number of counters that are reserved by one write to the store.
const RESERVED: u64 = 4096;

/// The stored state of a sensor.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    /// Fingerprint of the key.
    key: String,
    /// Counters up to this one may have been used.
    reserved: u64,
    /// Counters of the centre that were accepted.
    window: ReplayWindow,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum AnyStored {
    Whole(Stored),
    /// As versions before 0.2 stored it.
    Reserved(u64),
}

/// What a sensor's program must do.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Request {
    /// Send these bytes to the centre.
    Datagram(Vec<u8>),
    /// Measure, and call [`SensorLink::on_sample`].
    Sample {
        /// The slot.
        slot: Slot,
        /// The feedback as it was sent.
        feedback: BitString,
    },
    /// Record a note.
    Note(Note),
}

/// A sensor with its key. Its inputs are datagrams, time and samples, its outputs [`Request`]s. It is for sensors that are sent their
/// feedback or report by the clock.
///
/// With a store, an envelope of the centre is accepted once, also across restarts: that it was accepted is stored before anything follows
/// from it. Without one, a sensor that starts again accepts old envelopes, and its centre refuses the sensor's own.
#[derive(Debug)]
pub struct SensorLink {
    sensor: Sensor,
    number: u32,
    key: Key,
    window: ReplayWindow,
    counter: u64,
    reserved: u64,
    store: Option<Store>,
    timer: Option<(u64, SensorTimer)>,
    /// Bytes of the last report's frame.
    last: Vec<u8>,
    counts: Counts,
    /// Whether the centre has said what it takes reports for.
    is_told: bool,
}

impl SensorLink {
    /// A sensor with this number. Its counter continues as stored, so that no value is used twice.
    ///
    /// # Errors
    /// If the sensor follows by echo, or the store cannot be read or is in use.
    pub fn new(settings: SensorSettings, number: u32, key: Key, store: Option<Store>) -> Result<Self, Error> {
        if settings.feedback == Feedback::Echoed {
            return refuse("feedback", "echoed", "told or clock: a follower needs the centre's estimator");
        }
        let store = store.map(Store::locked).transpose()?;
        let stored = store.as_ref().map(Store::load::<AnyStored>).transpose()?.flatten();
        let (counter, window) = match stored {
            None => (0, ReplayWindow::default()),
            Some(AnyStored::Reserved(reserved)) => (reserved, ReplayWindow::default()),
            // Counters never fall, under a new key neither. What was accepted counts for its key only.
            Some(AnyStored::Whole(stored)) if stored.key != key.fingerprint() => {
                (stored.reserved, ReplayWindow::default())
            }
            Some(AnyStored::Whole(stored)) => (stored.reserved, stored.window),
        };
        Ok(Self {
            sensor: Sensor::new(settings),
            number,
            key,
            window,
            counter,
            reserved: counter,
            store,
            timer: (settings.feedback == Feedback::Clock).then_some((0, SensorTimer::SlotBegins)),
            last: Vec::new(),
            counts: Counts::default(),
            is_told: settings.meaning == 0,
        })
    }

    /// Time at which [`on_time`](Self::on_time) must be called next, in nanoseconds; `None` if no timer runs.
    pub fn next_timer(&self) -> Option<u64> {
        self.timer.map(|(at, _)| at)
    }

    /// Number of refused datagrams: forged, replayed, or for another sensor.
    pub fn refused(&self) -> u64 {
        self.counts.refused()
    }

    /// Numbers of accepted datagrams, and of refused ones by reason.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether the centre asks this sensor. One that reports by the clock may never hear anything.
    pub(crate) fn is_asked(&self) -> bool {
        self.sensor.settings().feedback == Feedback::Told
    }

    /// Whether the centre has said what it takes this sensor's reports for, or the sensor does not ask. A centre that began anew says it
    /// again.
    pub(crate) fn is_told(&self) -> bool {
        self.is_told
    }

    /// A heartbeat that tells the centre the sensor's address. Send it repeatedly until a frame of the centre has come. A centre whose slot
    /// has begun answers it at once.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn hello(&mut self) -> Result<Request, Error> {
        self.seal(self.sensor.hello())
    }

    /// The time is `now`, in nanoseconds. Timers that are due fire.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn on_time(&mut self, now: u64, requests: &mut Vec<Request>) -> Result<(), Error> {
        while let Some((_, timer)) = self.timer.take_if(|(at, _)| *at <= now) {
            let reaction = self.sensor.on_timer(now, timer);
            self.carry_out(reaction, requests)?;
        }
        Ok(())
    }

    /// A datagram has arrived. Carry out its requests before the next datagram: a sample counts for the last question.
    ///
    /// # Errors
    /// If the store cannot be written. Nothing follows from the datagram then, and it is not accepted again.
    pub fn on_datagram(&mut self, now: u64, bytes: &[u8], requests: &mut Vec<Request>) -> Result<(), Error> {
        let before = self.window.highest();
        let opened = match sensor_of(bytes) {
            Some(number) if number == self.number => self.key.open(Direction::ToSensor, bytes),
            Some(_) => Err(Refusal::Unknown),
            None => Err(Refusal::TooShort),
        };
        let taken = opened.and_then(|(counter, frame)| self.window.take(counter).map(|()| (counter, frame)));
        let (counter, frame) = match taken {
            Ok(taken) => taken,
            Err(refusal) => {
                self.counts.add(refusal);
                return Ok(());
            }
        };
        self.counts.taken += 1;
        self.save(self.reserved)?;
        // Counters of a centre rise from slot to slot. A question with a higher counter and an earlier slot is of a centre that began anew.
        if counter > before && self.is_before_answered(frame) {
            self.sensor = Sensor::new(*self.sensor.settings());
            self.is_told = self.sensor.settings().meaning == 0;
        }
        self.is_told |= matches!(self.decoded(frame), Ok(frame) if frame.kind == Kind::Heartbeat);
        let reaction = self.sensor.on_frame(now, frame);
        self.carry_out(reaction, requests)
    }

    /// The program has measured. `report` is `None` for silence.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn on_sample(
        &mut self,
        now: u64,
        report: Option<&BitString>,
        requests: &mut Vec<Request>,
    ) -> Result<(), Error> {
        let reaction = self.sensor.on_sample(now, report.map(Payload::from));
        self.carry_out(reaction, requests)
    }

    fn decoded<'a>(&self, frame: &'a [u8]) -> Result<Frame<'a>, DecodeError> {
        Frame::decode(frame, self.sensor.settings().check)
    }

    fn is_before_answered(&self, frame: &[u8]) -> bool {
        let asks = |kind| matches!(kind, Kind::Feedback | Kind::Echo | Kind::Snapshot);
        match (self.sensor.answered(), self.decoded(frame)) {
            (Some(answered), Ok(frame)) if asks(frame.kind) => frame.slot != answered && !frame.slot.is_after(answered),
            _ => false,
        }
    }

    fn save(&self, reserved: u64) -> Result<(), Error> {
        let Some(store) = &self.store else { return Ok(()) };
        store.save(&Stored {
            key: self.key.fingerprint(),
            reserved,
            window: self.window,
        })
    }

    fn carry_out(&mut self, reaction: Reaction<'_>, requests: &mut Vec<Request>) -> Result<(), Error> {
        if reaction.timer.is_some() {
            self.timer = reaction.timer;
        }
        requests.extend(reaction.note.map(Request::Note));
        match reaction.task {
            Task::Sample { slot, feedback } => {
                let feedback = feedback.into();
                requests.push(Request::Sample { slot, feedback });
            }
            Task::Send(frame) => {
                let request = self.seal(frame)?;
                requests.push(request);
            }
            Task::SendAgain => {
                // A repeated report gets a new counter: it is no replay.
                let frame = std::mem::take(&mut self.last);
                let request = self.envelope(&frame)?;
                self.last = frame;
                requests.push(request);
            }
            // Only followers are asked to follow, and `new` refuses them.
            Task::Wait | Task::Follow { .. } => {}
        }
        Ok(())
    }

    fn seal(&mut self, frame: Frame<'_>) -> Result<Request, Error> {
        let bytes = frame.to_bytes(self.sensor.settings().check);
        let request = self.envelope(&bytes)?;
        if frame.kind == Kind::Report {
            self.last = bytes;
        }
        Ok(request)
    }

    fn envelope(&mut self, frame: &[u8]) -> Result<Request, Error> {
        if self.counter == self.reserved {
            // Stored before the first of them is used: a restarted sensor goes on behind all that were reserved.
            let reserved = self.reserved.saturating_add(RESERVED);
            self.save(reserved)?;
            self.reserved = reserved;
        }
        self.counter += 1;
        let envelope = self.key.seal(Direction::ToCentre, self.number, self.counter, frame);
        Ok(Request::Datagram(envelope))
    }
}
