//! Input and output types of a fusion centre.

use crate::contract::Info;
use fewbits_core::{BitString, Event, Observation};

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

    /// A number that tells two slots of a sensor apart (FNV-1a of 64 bits).
    pub(super) fn digest(&self) -> u64 {
        let report = self.observation.received();
        let both = [Some(&self.feedback), report].into_iter().flatten();
        let bytes = both.flat_map(|bits| bits.bytes().iter().copied().chain((bits.bits() as u64).to_le_bytes()));
        bytes.fold(0xcbf2_9ce4_8422_2325, |digest, byte| (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
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
    /// Number of its reports that are no report of its scheme, of another length for example. They show that it works, and update nothing.
    pub unreadable: u64,
    /// Number of copies of its reports that were dropped.
    pub copies: u64,
    /// Of a sensor that sends one bit: by how many standard deviations unlikely bits came more often than predicted. Above about 4 its noise or
    /// the process noise is larger than stated, below -4 smaller. `None` if too few bits had unequal probabilities: those whose threshold is the
    /// prediction never have.
    pub surprise: Option<f64>,
}
