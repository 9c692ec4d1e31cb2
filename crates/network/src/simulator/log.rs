//! The message log: what was sent, what arrived of it, and what the nodes noticed. It can be written, read and replayed.

use crate::channel::Copy;
use crate::error::Error;
use crate::frame::stored;
use crate::units::{Instant, Joules, SensorId};
use fewbits_core::BitString;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// How much is logged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// Nothing: counters only.
    Nothing,
    /// What the nodes noticed.
    #[default]
    Notes,
    /// Every transmission too, so that the run can be replayed.
    Everything,
}

/// Something that a node noticed or that happened to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Note {
    /// A frame that no check accepted.
    Damaged,
    /// A frame whose payload is no message of its format.
    Malformed,
    /// A frame that was here before.
    Duplicate,
    /// A frame of a slot that is over.
    Late,
    /// The sender's state is not the receiver's.
    Disagreement {
        /// Whose frame showed it.
        with: SensorId,
        /// The slot of the frame.
        slot: u32,
    },
    /// A replica took the state that was sent to it.
    Resynchronised {
        /// From which slot on.
        slot: u32,
    },
    /// What was observed was impossible under the belief; the reports that did not come were taken as lost.
    Impossible {
        /// The slot.
        slot: u32,
    },
    /// An estimator or sensor refused what it got; the slot passed without it.
    Refused {
        /// The slot.
        slot: u32,
    },
    /// A handover was not acknowledged: the leader stays.
    Retained {
        /// The slot.
        slot: u32,
    },
    /// The node began anew without its memory.
    Restarted,
    /// The node died.
    Died,
}

/// What arrived of a frame at one receiver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reception {
    /// Who.
    pub to: SensorId,
    /// The copies, each with the bits of the batch that were inverted.
    pub copies: Vec<Copy>,
}

/// One transmission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transmission {
    /// When.
    pub at: Instant,
    /// Who.
    pub from: SensorId,
    /// To whom; nobody in particular for a broadcast.
    pub to: Option<SensorId>,
    /// Its bits: the frames of a batch, each as a string.
    pub frames: Vec<Stored>,
    /// Payload bits among them.
    pub payload: u64,
    /// Bits on air with everything, repetitions and acknowledgements included.
    pub air: u64,
    /// How often it was sent.
    pub attempts: u32,
    /// Acknowledgements that were sent.
    pub answers: u32,
    /// Whether the sender knows that it arrived.
    pub acknowledged: bool,
    /// What arrived where.
    pub receptions: Vec<Reception>,
    /// Energy of the sender.
    pub sending: Joules,
    /// Energy of the receivers.
    pub receiving: Joules,
}

/// Bits as they are stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Stored(#[serde(with = "stored")] pub BitString);

/// One line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Entry {
    /// A transmission.
    Sent(Transmission),
    /// Something noticed.
    Noted {
        /// When.
        at: Instant,
        /// By whom, or what it happened to.
        node: SensorId,
        /// What.
        note: Note,
    },
}

/// All entries, in the order of the events.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Log {
    /// The entries.
    pub entries: Vec<Entry>,
}

impl Log {
    /// Everything noticed, with when and by whom.
    pub fn notes(&self) -> impl Iterator<Item = (Instant, SensorId, Note)> + '_ {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Noted { at, node, note } => Some((*at, *node, *note)),
            Entry::Sent(_) => None,
        })
    }

    /// Every transmission.
    pub fn transmissions(&self) -> impl Iterator<Item = &Transmission> + '_ {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Sent(transmission) => Some(transmission),
            Entry::Noted { .. } => None,
        })
    }

    /// Writes the log as CBOR.
    ///
    /// # Errors
    /// [`Error::Stored`] if it cannot be written.
    pub fn write(&self, to: impl Write) -> Result<(), Error> {
        ciborium::into_writer(self, to).map_err(|error| Error::Stored(error.to_string()))
    }

    /// Reads a log.
    ///
    /// # Errors
    /// [`Error::Stored`] if it is none.
    pub fn read(from: impl Read) -> Result<Self, Error> {
        ciborium::from_reader(from).map_err(|error| Error::Stored(error.to_string()))
    }
}
