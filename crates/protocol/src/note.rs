//! What a node of the protocol can notice.

use crate::frame::{DecodeError, Kind, VERSION};
use crate::slot::Slot;
use core::fmt;

/// Something worth writing down. None of it stops a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Note {
    /// Bytes that are no frame.
    Damaged(DecodeError),
    /// A frame of a version of the format that is newer than this program. The frame is left alone, and so is all that it stands for.
    FutureVersion {
        /// The version.
        found: u8,
    },
    /// A frame that this node does not take: of a kind for others, or before it was configured for it.
    Unexpected {
        /// The kind.
        kind: Kind,
    },
    /// A payload that is no message of its format.
    Malformed {
        /// The slot.
        slot: Slot,
    },
    /// A frame came a second time.
    Duplicate {
        /// The slot.
        slot: Slot,
    },
    /// A frame belongs to a slot that is over, or that has not begun.
    Late {
        /// The slot.
        slot: Slot,
    },
    /// The sender does not share what its frame rests on.
    Disagreement {
        /// The slot.
        slot: Slot,
    },
    /// A follower took the state that was sent to it.
    Resynchronised {
        /// From which slot on.
        slot: Slot,
    },
    /// A report was repeated as often as allowed, and no acknowledgement came. It may have arrived all the same.
    Unacknowledged {
        /// The slot.
        slot: Slot,
    },
    /// A handover was given up: whoever sent it leads on.
    Retained {
        /// The slot in which its receiver was to lead.
        slot: Slot,
    },
    /// A sensor was silent for a while and says that it works.
    Heartbeat {
        /// The slot.
        slot: Slot,
    },
    /// The driver handed in what the machine did not wait for: a sample without a slot, a report that is too long.
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
            Self::Resynchronised { slot } => write!(f, "resynchronised, slot {}", slot.number()),
            Self::Unacknowledged { slot } => write!(f, "report not acknowledged, slot {}", slot.number()),
            Self::Retained { slot } => write!(f, "handover given up, slot {}", slot.number()),
            Self::Heartbeat { slot } => write!(f, "heartbeat, slot {}", slot.number()),
            Self::Misuse => f.write_str("input that was not asked for"),
        }
    }
}
