//! Errors of the simulated network.

use crate::note::Note;
use crate::units::{Seconds, SensorId};
use fewbits_core::{ArgumentError, CodecError};

/// An error of another crate or of a user's own estimator.
pub type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A node that does not exist.
    #[error("node {node} does not exist: the network has {nodes} nodes")]
    UnknownNode {
        /// Index of the node.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// A node that sends to itself.
    #[error("node {node} sends to itself: expected another node")]
    SelfLink {
        /// Index of the node.
        node: usize,
    },
    /// Two nodes that are not in range of each other.
    #[error("node {to} is out of range of node {from}")]
    OutOfRange {
        /// Index of the sender.
        from: usize,
        /// Index of the receiver.
        to: usize,
    },
    /// A node takes part although no other node is in range of it.
    #[error("nobody hears node {node}: expected another node within {range} m")]
    Unheard {
        /// Index of the node.
        node: usize,
        /// Range of the radios, metres.
        range: f64,
    },
    /// The protocol needs a connected network, and this one is not.
    #[error("the network is disconnected: {reached} of {nodes} nodes are reached from node {root}")]
    Disconnected {
        /// Node at which the search began.
        root: usize,
        /// Number of nodes that it reached.
        reached: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// The frames of one slot take longer on air than the time from the slot's beginning to its deadline.
    #[error(
        "the slot is too short: {frames} frames take at least {needed} of air, and {available} are there before the deadline"
    )]
    SlotTooShort {
        /// Number of frames of a slot in which every sensor reports.
        frames: usize,
        /// Their time on air if reports have no payload.
        needed: Seconds,
        /// Time from the beginning of a slot to its deadline.
        available: Seconds,
    },
    /// A node failed in more than half of the slots of the run.
    #[error("{node} failed in {failed} of {slots} slots; the last time: {last}")]
    MostSlotsFailed {
        /// The node that failed.
        node: SensorId,
        /// Number of slots in which it failed.
        failed: u32,
        /// Number of slots of the run.
        slots: u32,
        /// The last note of the node.
        last: Note,
    },
    /// A message does not fit its format.
    #[error("message does not fit its format: {0}")]
    Codec(#[from] CodecError),
    /// An estimator or scheme failed for another reason than an impossible observation.
    #[error("{name} failed")]
    Estimator {
        /// Name of the estimator or of its crate.
        name: &'static str,
        /// The estimator's error.
        source: Cause,
    },
    /// A log or snapshot could not be written.
    #[error("the run cannot be written")]
    Unwritable {
        /// The error of the writer.
        source: Cause,
    },
    /// A stored log or snapshot could not be read.
    #[error("the stored run cannot be read")]
    Unreadable {
        /// The error of the reader.
        source: Cause,
    },
    /// A snapshot is of a network with another number of nodes.
    #[error("the snapshot has {found} nodes: expected {expected}, all that it names among them")]
    SnapshotOfOtherNetwork {
        /// Number of nodes of the snapshot.
        found: usize,
        /// Number of nodes of the network.
        expected: usize,
    },
}

impl Error {
    /// Wraps the error of the estimator `name`.
    pub fn estimator(name: &'static str, source: impl Into<Cause>) -> Self {
        Self::Estimator {
            name,
            source: source.into(),
        }
    }
}
