//! What a sensor is told.

use crate::frame::Check;
use crate::slot::Schedule;

/// How a sensor learns what it must know before it measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Feedback {
    /// The centre sends the feedback in full.
    Told,
    /// No feedback is needed: the sensor reports at fixed times. Every frame of the centre sets its clock.
    Clock,
    /// The sensor runs a copy of the centre's filter and is sent what the centre received. If the two differ, it asks for the whole state.
    Echoed,
}

/// Settings of a sensor. Both ends must have the same `check` and feedback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct SensorSettings {
    /// How the sensor learns what it must know before it measures.
    pub feedback: Feedback,
    /// What the check of a frame covers.
    pub check: Check,
    /// When slots begin. Required for [`Feedback::Clock`]; other sensors with a schedule refuse frames of other slots.
    pub schedule: Option<Schedule>,
    /// For sensors that report by the clock: nanoseconds from the beginning of a slot to the measurement. The clock may be ahead by at most
    /// this. Different offsets keep sensors from sending at once.
    pub offset: u64,
    /// After this many silent slots in a row a heartbeat is sent; 0: never.
    pub heartbeat_after: u32,
    /// How often a report without acknowledgement is repeated; 0: no acknowledgement is expected.
    pub repeats: u8,
    /// Nanoseconds that the sensor waits for an acknowledgement before it repeats a report.
    pub patience: u64,
    /// What the bits of its reports mean: a number that both ends make of what they were told, such as the scheme; 0: not said. It is part
    /// of the digest of every answer, so a centre that was told otherwise does not use the reports, and both ends note it.
    #[cfg_attr(feature = "std", serde(default))]
    pub meaning: u32,
}

impl SensorSettings {
    /// Settings with a check of the whole frame and without schedule, offset, heartbeats and repetitions.
    pub fn new(feedback: Feedback) -> Self {
        Self {
            feedback,
            check: Check::Whole,
            schedule: None,
            offset: 0,
            heartbeat_after: 0,
            repeats: 0,
            patience: 0,
            meaning: 0,
        }
    }
}
