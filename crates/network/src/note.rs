//! Notes of nodes in the log: damaged frames, disagreements, failed steps and the like.

use crate::units::SensorId;
use fewbits_protocol::BoxError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Something that a node noticed or that happened to it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Note {
    /// What the node's machine noticed of a frame.
    Frame {
        /// Sender of the frame.
        with: SensorId,
        /// What was noticed.
        note: fewbits_protocol::Note,
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
    /// The node began anew without its memory.
    Restarted,
    /// The node died.
    Died,
}

impl Note {
    pub(crate) fn failed(stage: Stage, slot: u32, error: &BoxError) -> Self {
        let reason = in_full(&**error);
        Self::Failed { stage, slot, reason }
    }
}

/// The message of an error with those of all sources.
fn in_full(error: &(dyn std::error::Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text.push_str(": ");
        text.push_str(&error.to_string());
        source = error.source();
    }
    text
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
            Self::Frame { with, note } => write!(f, "{note}, {with}"),
            Self::SilenceIgnored { slot, reason } => {
                write!(f, "missing reports ignored, slot {slot}: {reason}")
            }
            Self::Failed { stage, slot, reason } => write!(f, "{stage} failed, slot {slot}: {reason}"),
            Self::NotMeasured { slot } => write!(f, "no measurement, slot {slot}"),
            Self::Restarted => f.write_str("restarted"),
            Self::Died => f.write_str("died"),
        }
    }
}
