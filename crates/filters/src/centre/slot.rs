//! What goes into a centre and what comes out.

use crate::contract::Info;
use fewbits_core::{BitString, Observation};

/// One sensor in one slot: what it was told, and what was observed of it. A sensor that was not asked has no slot.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// Number of the sensor.
    pub sensor: u32,
    /// The feedback as it travelled.
    pub feedback: BitString,
    /// What was observed.
    pub observation: Observation<BitString>,
}

impl Slot {
    /// A slot of sensor `sensor`.
    pub fn new(sensor: u32, feedback: BitString, observation: Observation<BitString>) -> Self {
        Self {
            sensor,
            feedback,
            observation,
        }
    }
}

/// Something that the centre noticed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// A sensor has been silent for so long that it is taken for dead. Its silence no longer says anything.
    Dead(u32),
    /// A report came from a sensor that had been taken for dead.
    Alive(u32),
    /// A sensor's reports contradict the others': they are no longer used, but still watched.
    Excluded(u32),
    /// An excluded sensor has agreed with the others for long and is used again.
    Readmitted(u32),
    /// The model does not hold for the sensors together: observations are too unlikely, or residuals repeat. The track is lost, or a noise
    /// is understated.
    Lost,
    /// Observations are likelier than they should be, or residuals alternate: a noise is overstated.
    NoiseOverstated,
    /// The belief was replaced by the prior of [`FusionCentre::reacquire_from`](super::FusionCentre::reacquire_from).
    Reacquired,
}

/// What an update reveals.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Received {
    /// What the filter says.
    pub info: Info,
    /// What the centre noticed.
    pub events: Vec<Event>,
}
