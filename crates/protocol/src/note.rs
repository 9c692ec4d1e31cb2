//! Notes: what a node of the protocol reports to its driver besides actions.

use crate::frame::{DecodeError, Kind, VERSION};
use crate::slot::Slot;
use core::fmt;

/// An event worth recording. None of them stops a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Note {
    /// Received bytes are not a frame.
    Damaged(DecodeError),
    /// A frame has a newer version of the format than this program. It is ignored.
    FutureVersion {
        /// The version.
        found: u8,
    },
    /// A frame of a kind that this node does not accept, or not before it is configured for it.
    Unexpected {
        /// Kind of the frame.
        kind: Kind,
    },
    /// The payload of a frame does not decode to a message of its format.
    Malformed {
        /// Slot of the frame.
        slot: Slot,
    },
    /// A frame arrived a second time.
    Duplicate {
        /// Slot of the frame.
        slot: Slot,
    },
    /// A frame belongs to a slot that is over or has not begun.
    Late {
        /// Slot of the frame.
        slot: Slot,
    },
    /// Sender and receiver of a frame have different states.
    Disagreement {
        /// Slot of the frame.
        slot: Slot,
    },
    /// The other end was told that reports mean something else: see [`SensorSettings::meaning`](crate::SensorSettings::meaning). At a centre
    /// it may also be an answer to other feedback.
    OtherMeaning {
        /// Slot of the frame.
        slot: Slot,
        /// What the other end was told.
        found: u32,
    },
    /// A follower replaced its state by the one that was sent to it.
    Resynchronised {
        /// First slot with the new state.
        slot: Slot,
    },
    /// A report was repeated as often as allowed, and no acknowledgement came. It may have arrived nevertheless.
    Unacknowledged {
        /// Slot of the report.
        slot: Slot,
    },
    /// A handover was given up: its sender continues to lead.
    Retained {
        /// The slot in which its receiver was to lead.
        slot: Slot,
    },
    /// A sensor that was silent for a while reports that it works.
    Heartbeat {
        /// Slot of the heartbeat.
        slot: Slot,
    },
    /// The driver passed something unexpected: a sample outside a slot, or a report that is too long.
    Misuse,
}

impl From<DecodeError> for Note {
    fn from(error: DecodeError) -> Self {
        match error {
            DecodeError::Version { found } if found > VERSION => Self::FutureVersion { found },
            error => Self::Damaged(error),
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damaged(error) => write!(f, "damaged frame: {error}"),
            Self::FutureVersion { found } => {
                write!(f, "frame of version {found} of the format: this program understands {VERSION}")
            }
            Self::Unexpected { kind } => write!(f, "unexpected frame: {kind:?}"),
            Self::Malformed { slot } => write!(f, "malformed payload, slot {}", slot.number()),
            Self::Duplicate { slot } => write!(f, "frame came a second time, slot {}", slot.number()),
            Self::Late { slot } => write!(f, "late frame, slot {}", slot.number()),
            Self::Disagreement { slot } => write!(f, "disagreement, slot {}", slot.number()),
            Self::OtherMeaning { slot, .. } => {
                write!(f, "reports mean something else at the other end, slot {}", slot.number())
            }
            Self::Resynchronised { slot } => write!(f, "resynchronised, slot {}", slot.number()),
            Self::Unacknowledged { slot } => write!(f, "report not acknowledged, slot {}", slot.number()),
            Self::Retained { slot } => write!(f, "handover given up, slot {}", slot.number()),
            Self::Heartbeat { slot } => write!(f, "heartbeat, slot {}", slot.number()),
            Self::Misuse => f.write_str("input that was not asked for"),
        }
    }
}
