//! Notes of nodes in the log: damaged frames, disagreements, failed steps and the like.

use crate::error::in_full;
use crate::units::SensorId;
use fewbits_protocol as machines;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Something that a node noticed or that happened to it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Note {
    /// A frame failed its check.
    Damaged,
    /// A frame's payload is no message of its format.
    Malformed,
    /// A frame came a second time.
    Duplicate,
    /// A frame belongs to a slot that is over.
    Late,
    /// The sender's state is not the receiver's.
    Disagreement {
        /// Sender of the frame that showed it.
        with: SensorId,
        /// The slot of the frame.
        slot: u32,
    },
    /// A replica took the state that was sent to it.
    Resynchronised {
        /// From which slot on.
        slot: u32,
    },
    /// The update failed with the observations as they arrived, and succeeded without the sensors of which nothing arrived.
    SilenceIgnored {
        /// The slot.
        slot: u32,
        /// Why the update failed the first time.
        reason: String,
    },
    /// A step of the estimator or of a sensor failed. The slot passed without it.
    Failed {
        /// Which step.
        stage: Stage,
        /// The slot.
        slot: u32,
        /// Why.
        reason: String,
    },
    /// A sensor had no measurement in a slot and was silent.
    NotMeasured {
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

impl Note {
    pub(crate) fn failed(stage: Stage, slot: u32, error: &machines::BoxError) -> Self {
        let reason = in_full(&**error);
        Self::Failed { stage, slot, reason }
    }

    /// A machine's note of a frame of `with`, in the log's words.
    pub(crate) fn noticed(with: SensorId, note: machines::Note) -> Self {
        use machines::Note as Noticed;
        match note {
            Noticed::Damaged(_) | Noticed::FutureVersion { .. } => Self::Damaged,
            Noticed::Duplicate { .. } => Self::Duplicate,
            Noticed::Late { .. } => Self::Late,
            Noticed::Disagreement { slot } => Self::Disagreement {
                with,
                slot: slot.number(),
            },
            Noticed::Retained { slot } => Self::Retained { slot: slot.number() },
            Noticed::Resynchronised { slot } => Self::Resynchronised { slot: slot.number() },
            _ => Self::Malformed,
        }
    }
}

/// A step of a slot that can fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Stage {
    /// Time update.
    Prediction,
    /// A sensor's report.
    Report,
    /// Measurement update.
    Update,
    /// A leader's step.
    Lead,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Prediction => "prediction",
            Self::Report => "report",
            Self::Update => "update",
            Self::Lead => "leader's step",
        })
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damaged => f.write_str("damaged frame"),
            Self::Malformed => f.write_str("malformed frame"),
            Self::Duplicate => f.write_str("frame came a second time"),
            Self::Late => f.write_str("late frame"),
            Self::Disagreement { with, slot } => write!(f, "disagreement with {with}, slot {slot}"),
            Self::Resynchronised { slot } => write!(f, "resynchronised, slot {slot}"),
            Self::SilenceIgnored { slot, reason } => {
                write!(f, "missing reports ignored, slot {slot}: {reason}")
            }
            Self::Failed { stage, slot, reason } => write!(f, "{stage} failed, slot {slot}: {reason}"),
            Self::NotMeasured { slot } => write!(f, "no measurement, slot {slot}"),
            Self::Retained { slot } => write!(f, "handover not acknowledged, slot {slot}"),
            Self::Restarted => f.write_str("restarted"),
            Self::Died => f.write_str("died"),
        }
    }
}
