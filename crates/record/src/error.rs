//! What this crate refuses.

use fewbits_numerics::ArgumentError;
use std::io;

/// Errors of this crate. A refused row leaves the recorder as it was.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Reading or writing failed.
    #[error("cannot {action} the recording")]
    Io {
        /// `open`, `read`, `write`, `truncate`.
        action: &'static str,
        /// The system's error.
        #[source]
        source: io::Error,
    },
    /// An earlier write failed half-way. What was written before it can be read; `resume` cuts off the rest.
    #[error("an earlier write failed: resume the recording to go on")]
    Broken,
    /// The bytes do not begin as a recording does.
    #[error("not a recording: the first bytes are not those of one")]
    NotARecording,
    /// A recording of another version of the format.
    #[error("format version {found}: this program reads version {supported}")]
    Version {
        /// The recording's version.
        found: u8,
        /// The version of this program.
        supported: u8,
    },
    /// The header is cut off or does not match its checksum. Without it nothing can be decoded.
    #[error("the header is damaged ({0})")]
    Header(Damage),
    /// A block, or bytes between blocks, that cannot be read. All other blocks can.
    #[error("{bytes} bytes at offset {offset} are damaged ({damage})")]
    Block {
        /// First byte.
        offset: u64,
        /// Number of bytes that are skipped.
        bytes: u64,
        /// What is wrong.
        damage: Damage,
    },
    /// A column that the recording does not have.
    #[error("no column `{name}`: the recording has {existing}")]
    UnknownColumn {
        /// The name that was asked for.
        name: String,
        /// The names that exist, with commas between them.
        existing: String,
    },
    /// Arrow refused a batch.
    #[cfg(feature = "arrow")]
    #[error("no record batch")]
    Batch(#[from] arrow_schema::ArrowError),
}

/// Why bytes cannot be decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Damage {
    /// The end comes before the end of what was announced.
    #[error("cut off")]
    CutOff,
    /// The checksum differs.
    #[error("the checksum differs")]
    Checksum,
    /// The checksum agrees, but no recorder writes this.
    #[error("`{0}` is not what a recorder writes")]
    Content(&'static str),
    /// Some other recording's block, or not a block at all.
    #[error("no block begins here")]
    NoBlock,
}

impl Error {
    pub(crate) fn io(action: &'static str) -> impl Fn(io::Error) -> Self {
        move |source| Self::Io { action, source }
    }
}
