//! The message log: what was sent, what of it arrived, and what the nodes noted. It can be written to a file and read back.

use crate::error::Error;
use crate::medium::ReceivedCopy;
use crate::note::Note;
use crate::units::{Instant, Joules, SensorId};
use fewbits_core::BitString;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// How much is logged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// Only counters.
    Nothing,
    /// Counters and notes of the nodes.
    #[default]
    Notes,
    /// Counters, notes and every transmission.
    Everything,
}

/// The copies of a transmission that arrived at one receiver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reception {
    /// The receiver.
    pub to: SensorId,
    /// The copies that arrived, each with the bits of the batch that were inverted.
    pub copies: Vec<ReceivedCopy>,
}

/// One transmission: a frame or a batch, sent once. A repetition is a transmission of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transmission {
    /// When it began.
    pub at: Instant,
    /// The sender.
    pub from: SensorId,
    /// The receiver; `None` for a broadcast.
    pub to: Option<SensorId>,
    /// The bits of each frame of the batch.
    pub frames: Vec<BitString>,
    /// Number of the attempt to send these frames, from 0.
    pub attempt: u32,
    /// Number of payload bits among its bits.
    pub payload: u64,
    /// Bits on air, with preambles and headers.
    pub air: u64,
    /// Arrivals at each receiver.
    pub receptions: Vec<Reception>,
    /// Energy of sending. Listening for an acknowledgement is counted in `receiving`.
    pub sending: Joules,
    /// Energy of receiving, summed over nodes.
    pub receiving: Joules,
}

/// One acknowledgement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Acknowledgement {
    /// When the frame that it acknowledges had arrived.
    pub at: Instant,
    /// The node that acknowledges.
    pub from: SensorId,
    /// Sender of the acknowledged frame.
    pub to: SensorId,
    /// Bits on air.
    pub air: u64,
    /// The copies that arrived.
    pub copies: Vec<ReceivedCopy>,
    /// Energy of sending it. The energy of receiving it is part of each [`Transmission`].
    pub sending: Joules,
}

/// One entry of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Entry {
    /// A transmission.
    Sent(Transmission),
    /// An acknowledgement.
    Answered(Acknowledgement),
    /// A note of a node.
    Noted {
        /// Time of the note.
        at: Instant,
        /// The node.
        node: SensorId,
        /// The note.
        note: Note,
    },
}

/// All entries, in the order of the events.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Log {
    /// The entries, in the order of the events.
    pub entries: Vec<Entry>,
}

impl Log {
    /// All notes, each with its time and node.
    pub fn notes(&self) -> impl Iterator<Item = (Instant, SensorId, &Note)> + '_ {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Noted { at, node, note } => Some((*at, *node, note)),
            Entry::Sent(_) | Entry::Answered(_) => None,
        })
    }

    /// All transmissions.
    pub fn transmissions(&self) -> impl Iterator<Item = &Transmission> + '_ {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Sent(transmission) => Some(transmission),
            Entry::Answered(_) | Entry::Noted { .. } => None,
        })
    }

    /// All acknowledgements.
    pub fn acknowledgements(&self) -> impl Iterator<Item = &Acknowledgement> + '_ {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Answered(acknowledgement) => Some(acknowledgement),
            Entry::Sent(_) | Entry::Noted { .. } => None,
        })
    }

    /// Writes the log as CBOR.
    ///
    /// # Errors
    /// [`Error::Unwritable`] if writing fails.
    pub fn write(&self, to: impl Write) -> Result<(), Error> {
        ciborium::into_writer(self, to).map_err(unwritable)
    }

    /// Reads a log.
    ///
    /// # Errors
    /// [`Error::Unreadable`] if the bytes are not a log.
    pub fn read(from: impl Read) -> Result<Self, Error> {
        ciborium::from_reader(from).map_err(unreadable)
    }
}

pub(super) fn unwritable(error: ciborium::ser::Error<std::io::Error>) -> Error {
    Error::Unwritable { source: error.into() }
}

pub(super) fn unreadable(error: ciborium::de::Error<std::io::Error>) -> Error {
    Error::Unreadable { source: error.into() }
}
