//! What a centre is told, and what it tells its driver to do.

use crate::echo::ReportLength;
use crate::frame::Check;
use crate::note::Note;
use crate::sensor::Feedback;
use crate::slot::Schedule;
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
    /// What the bits of the reports of each sensor mean, as in [`SensorSettings::meaning`](crate::SensorSettings::meaning); 0, or no entry:
    /// not said. Answers of a sensor that says otherwise are no observations, and its silence is none either. Where nothing is said here, what
    /// a sensor says makes its answers those to other feedback.
    #[serde(default)]
    pub meanings: Vec<u32>,
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
            meanings: Vec::new(),
        }
    }

    /// What the reports of this sensor mean; 0: not said.
    pub fn meaning(&self, sensor: usize) -> u32 {
        self.meanings.get(sensor).copied().unwrap_or(0)
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
    /// Predict into this slot and call [`Centre::on_predicted`](super::Centre::on_predicted). If the prediction fails, do nothing: the slot passes without update.
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
        /// The timer to pass to [`Centre::on_timer`](super::Centre::on_timer).
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
