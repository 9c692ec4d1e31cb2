//! Notes of nodes in the log: damaged frames, disagreements, failed steps and the like.

use crate::units::SensorId;
use fewbits_protocol::BoxError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// An event at a node that the log records.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Note {
    /// The node's state machine noticed something about a frame.
    Frame {
        /// Sender of the frame.
        with: SensorId,
        /// What was noticed.
        note: fewbits_protocol::Note,
    },
    /// The update failed with the observations as they arrived. It succeeded without the sensors from which nothing arrived.
    SilenceIgnored {
        /// The slot.
        slot: u32,
        /// Error of the first update.
        reason: String,
    },
    /// A step of the estimator or of a sensor failed. The slot continued without it.
    Failed {
        /// The step that failed.
        stage: Stage,
        /// The slot.
        slot: u32,
        /// Its error.
        reason: String,
    },
    /// A sensor had no measurement in a slot and was silent.
    NotMeasured {
        /// The slot.
        slot: u32,
    },
    /// The node lost its memory and started again.
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

/// The message of an error, followed by those of its sources.
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
    /// Prediction of the estimator.
    Prediction,
    /// A sensor's report.
    Report,
    /// Update of the estimator with the observations.
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
