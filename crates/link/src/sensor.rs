//! A sensor with protocol and key, without socket and clock.

use crate::envelope::{Direction, Key, ReplayWindow, sensor_of};
use crate::error::Error;
use crate::store::Store;
use fewbits_core::BitString;
use fewbits_numerics::error::refuse;
use fewbits_protocol::{
    Feedback, Frame, Kind, Note, Payload, Reaction, Sensor, SensorSettings, SensorTimer, Slot, Task,
};

/// Number of counters that are reserved by one write to the store.
const RESERVED: u64 = 4096;

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
    refused: u64,
}

impl SensorLink {
    /// A sensor with this number. Its counter continues as stored, so that no value is used twice.
    ///
    /// # Errors
    /// If the sensor follows by echo, or the store cannot be read.
    pub fn new(settings: SensorSettings, number: u32, key: Key, store: Option<Store>) -> Result<Self, Error> {
        if settings.feedback == Feedback::Echoed {
            return refuse("feedback", "echoed", "told or clock: a follower needs the centre's estimator");
        }
        let counter = match &store {
            Some(store) => store.load::<u64>()?.unwrap_or(0),
            None => 0,
        };
        Ok(Self {
            sensor: Sensor::new(settings),
            number,
            key,
            window: ReplayWindow::default(),
            counter,
            reserved: counter,
            store,
            timer: (settings.feedback == Feedback::Clock).then_some((0, SensorTimer::SlotBegins)),
            last: Vec::new(),
            refused: 0,
        })
    }

    /// Time at which [`on_time`](Self::on_time) must be called next, in nanoseconds; `None` if no timer runs.
    pub fn next_timer(&self) -> Option<u64> {
        self.timer.map(|(at, _)| at)
    }

    /// Number of refused datagrams: forged, replayed, or for another sensor.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// A heartbeat that tells the centre the sensor's address. Send it repeatedly until a frame of the centre has come.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn hello(&mut self) -> Result<Request, Error> {
        let slot = self.sensor.answered().unwrap_or_default();
        self.seal(Frame::new(Kind::Heartbeat, slot, 0, Payload::EMPTY))
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
    /// If the store cannot be written.
    pub fn on_datagram(&mut self, now: u64, bytes: &[u8], requests: &mut Vec<Request>) -> Result<(), Error> {
        let opened = match sensor_of(bytes) {
            Some(number) if number == self.number => self.key.open(Direction::ToSensor, bytes).ok(),
            _ => None,
        };
        let taken = opened.filter(|(counter, _)| self.window.take(*counter).is_ok());
        let Some((_, frame)) = taken else {
            self.refused += 1;
            return Ok(());
        };
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
            self.reserved += RESERVED;
            if let Some(store) = &self.store {
                store.save(&self.reserved)?;
            }
        }
        self.counter += 1;
        let envelope = self.key.seal(Direction::ToCentre, self.number, self.counter, frame);
        Ok(Request::Datagram(envelope))
    }
}
