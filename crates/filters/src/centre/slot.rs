//! Input and output types of a fusion centre.

use crate::contract::Info;
use fewbits_core::{BitString, Observation};

/// The observation of one sensor in one slot, with the feedback that the sensor was told. A sensor that was not asked has no slot.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// Number of the sensor.
    pub sensor: u32,
    /// The bits of the feedback as they were sent.
    pub feedback: BitString,
    /// What the receiver observed.
    pub observation: Observation<BitString>,
}

impl Slot {
    /// A slot of the sensor with number `sensor`.
    pub fn new(sensor: u32, feedback: BitString, observation: Observation<BitString>) -> Self {
        Self {
            sensor,
            feedback,
            observation,
        }
    }
}

/// An event that the centre reports to its caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// The sensor with this number is declared dead because of its silence, which carries no information from now on.
    Dead(u32),
    /// A report came from a sensor that had been declared dead.
    Alive(u32),
    /// The reports of this sensor contradict the others'. They are no longer used, but still tested.
    Excluded(u32),
    /// An excluded sensor has agreed with the others for long enough and is used again.
    Readmitted(u32),
    /// The model does not hold for all sensors together: observations are too unlikely, or residuals repeat. The track is lost, or a stated
    /// noise is too small.
    Lost,
    /// Observations are likelier than predicted, or residuals alternate: a stated noise is too large.
    NoiseOverstated,
    /// The report of this sensor was not used at this instant: it is impossible, or too unlikely given the prediction and the others'
    /// reports.
    Rejected(u32),
    /// This sensor contradicts another, and nothing decides which of them is wrong. The belief covers what either says.
    Disputed(u32),
    /// A second, equal report of this sensor at the same instant was dropped.
    Copied(u32),
    /// Most reports did not agree with the prediction, but with each other, or again and again. The belief was replaced by a wider one.
    Reopened,
    /// The belief was replaced by the prior of [`FusionCentre::reacquire_from`](super::FusionCentre::reacquire_from).
    Reacquired,
}

impl Event {
    /// The name of this kind of event, in lower case.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Dead(_) => "dead",
            Self::Alive(_) => "alive",
            Self::Excluded(_) => "excluded",
            Self::Readmitted(_) => "readmitted",
            Self::Lost => "lost",
            Self::NoiseOverstated => "noise overstated",
            Self::Rejected(_) => "rejected",
            Self::Disputed(_) => "disputed",
            Self::Copied(_) => "copied",
            Self::Reopened => "reopened",
            Self::Reacquired => "reacquired",
        }
    }

    /// The number of the sensor that it is about; `None` if it is about the whole centre.
    pub fn sensor(&self) -> Option<u32> {
        match self {
            Self::Dead(sensor)
            | Self::Alive(sensor)
            | Self::Excluded(sensor)
            | Self::Readmitted(sensor)
            | Self::Rejected(sensor)
            | Self::Disputed(sensor)
            | Self::Copied(sensor) => Some(*sensor),
            Self::Lost | Self::NoiseOverstated | Self::Reopened | Self::Reacquired => None,
        }
    }
}

/// Results of an update other than the belief.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Received {
    /// Results of the filter's update.
    pub info: Info,
    /// Events of this instant.
    pub events: Vec<Event>,
}

/// What a centre knows of one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SensorState {
    /// Probability that it still works.
    pub working: f64,
    /// Whether it has been declared dead because of its silence.
    pub declared_dead: bool,
    /// Whether its reports are at present not used, because they contradict the others'.
    pub excluded: bool,
    /// Whether it contradicts another sensor, and nothing decides which of the two is wrong.
    pub disputed: bool,
    /// Number of its reports that were not used because they were impossible or too unlikely.
    pub rejected: u64,
    /// Number of copies of its reports that were dropped.
    pub copies: u64,
}
