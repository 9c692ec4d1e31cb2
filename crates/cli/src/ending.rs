//! How a task ends.

use crate::say::say;

/// The end of a task that was not refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    Good,
    /// An error bound is violated, or a part could not be read.
    Failed,
    /// Some of several files were refused, and each was named.
    Refused,
}

impl Ending {
    /// The end of a task that received no complete frame.
    pub(crate) fn no_frame(name: &str) -> Self {
        say!("error: {name}: no whole frame came: use the sender's link, options and baud rate, and wait longer");
        Self::Failed
    }

    /// The end of a task that received no reading in messages of other programs.
    pub(crate) fn no_reading(name: &str, device: Option<&str>) -> Self {
        let of = device.map_or_else(String::new, |device| format!(" of device `{device}`"));
        say!("error: {name}: no reading came: no message{of} had one in a form of `--format`");
        Self::Failed
    }
}
