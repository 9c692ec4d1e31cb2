//! Errors of this crate.

use crate::note::Note;
use crate::units::{Seconds, SensorId};
use fewbits_core::{ArgumentError, CodecError};

/// An error of another crate or of a user's own estimator.
pub type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Errors of the simulated network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
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
        /// The sender.
        from: usize,
        /// The receiver.
        to: usize,
    },
    /// A node that takes part although no other node is in range of it.
    #[error("nobody hears node {node}: expected another node within {range} m")]
    Unheard {
        /// Index of the node.
        node: usize,
        /// Range of the radios, metres.
        range: f64,
    },
    /// A network that a protocol needs in one piece.
    #[error("the network is disconnected: {reached} of {nodes} nodes are reached from node {root}")]
    Disconnected {
        /// Where the search began.
        root: usize,
        /// Nodes that it reached.
        reached: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// The frames of one slot take longer than the slot has time for reports.
    #[error(
        "the slot is too short: {frames} frames take at least {needed} of air, and {available} are there before the deadline"
    )]
    SlotTooShort {
        /// Frames of a slot in which every sensor reports.
        frames: usize,
        /// Their time on air without payload of reports.
        needed: Seconds,
        /// From the beginning of a slot to its deadline.
        available: Seconds,
    },
    /// A node failed in more than half of the slots of the run.
    #[error("{node} failed in {failed} of {slots} slots; the last time: {last}")]
    MostSlotsFailed {
        /// The node.
        node: SensorId,
        /// Slots in which it failed.
        failed: u32,
        /// Slots of the run.
        slots: u32,
        /// Its last note.
        last: Note,
    },
    /// A message that does not fit its format.
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
    /// A log or snapshot that cannot be written.
    #[error("the run cannot be written")]
    Unwritable {
        /// Why.
        source: Cause,
    },
    /// A stored log or snapshot that cannot be read.
    #[error("the stored run cannot be read")]
    Unreadable {
        /// Why.
        source: Cause,
    },
    /// A snapshot that names nodes which the network does not have.
    #[error("the snapshot has {found} nodes: expected {expected}, all that it names among them")]
    SnapshotOfOtherNetwork {
        /// Nodes of the snapshot.
        found: usize,
        /// Nodes of the network.
        expected: usize,
    },
}

impl Error {
    /// The error of an estimator, under the estimator's name.
    pub fn estimator(name: &'static str, source: impl Into<Cause>) -> Self {
        Self::Estimator {
            name,
            source: source.into(),
        }
    }
}
