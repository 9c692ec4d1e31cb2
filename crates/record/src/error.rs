//! Errors of recordings.

use fewbits_block_codec::ArgumentError;
use fewbits_block_codec::bytes::Unread;
pub(crate) use fewbits_block_codec::ensure;
use std::io;

/// Errors of this crate. After a refused row the recorder is unchanged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Reading or writing failed.
    #[error("cannot {action} the recording")]
    Io {
        /// What was tried: `open`, `read`, `write` or `truncate`.
        action: &'static str,
        /// The system's error.
        #[source]
        source: io::Error,
    },
    /// An earlier write failed in the middle. Everything before it can be read; `resume` removes the rest.
    #[error("an earlier write failed: resume the recording to go on")]
    Broken,
    /// The bytes do not begin like a recording.
    #[error("not a recording: it is empty, or the first bytes are not those of one")]
    NotARecording,
    /// Another program writes to the file.
    #[error("the recording is being written by another program: wait until it ends")]
    Locked,
    /// The recording is of another version of the format.
    #[error("format version {found}: this program reads versions 5 to {supported}")]
    Version {
        /// Version of the recording.
        found: u8,
        /// Newest version that this program reads.
        supported: u8,
    },
    /// The header is incomplete or does not match its checksum. Then nothing can be decoded.
    #[error("{}", header_described(*.0))]
    Header(Damage),
    /// The recording is one block, and its bytes do not match their checksum: the end is missing, or bytes have changed. Then nothing can be decoded.
    #[error(
        "the recording is cut off, or bytes of it have changed: it is one block, of which then nothing can be read"
    )]
    Single,
    /// A block, or bytes between blocks, cannot be read. All other blocks can.
    #[error("{}", described(*.offset, *.bytes, *.damage))]
    Block {
        /// Offset of the first unreadable byte.
        offset: u64,
        /// Number of bytes skipped.
        bytes: u64,
        /// Kind of the damage.
        damage: Damage,
    },
    /// A frame belongs to another table: its sender has started anew, or another sender uses the link too.
    #[error("a frame of another table")]
    OtherTable,
    /// The recording has no such column.
    #[error("no column `{}`: the recording has {existing}", shortened(.name))]
    UnknownColumn {
        /// The requested name.
        name: String,
        /// The existing names, separated by commas; of more than 20 the first ones, and the number of others.
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
    /// The bytes end before the stated length.
    #[error("cut off")]
    CutOff,
    /// The checksum does not match.
    #[error("the checksum differs")]
    Checksum,
    /// The checksum matches, but no recorder writes this content.
    #[error("`{0}` is not what a recorder writes")]
    Content(&'static str),
    /// The bytes are a block of another recording, or not a block.
    #[error("no block begins here")]
    NoBlock,
    /// Blocks that the recorder wrote are not there.
    #[error("blocks are missing")]
    Missing,
    /// A whole block stands where another one belongs: a copy, or one that was moved. Its rows are not read.
    #[error("a block out of its place")]
    Misplaced,
    /// The index is whole but describes other bytes: some were removed or inserted.
    #[error("the index describes other bytes")]
    Index,
    /// The recording has no end: it was not finished, or its last bytes are missing.
    #[error("not finished, or cut off")]
    NoEnd,
}

fn header_described(damage: Damage) -> String {
    match damage {
        Damage::CutOff => "the recording is cut off within its header, so nothing of it can be read".into(),
        damage => format!("the header is damaged ({damage})"),
    }
}

/// Damage in words. Some kinds have no bytes of their own.
fn described(offset: u64, bytes: u64, damage: Damage) -> String {
    match damage {
        Damage::Missing => format!("blocks are missing at offset {offset}"),
        Damage::Index => "the index describes other bytes than the recording has: some were removed or inserted".into(),
        Damage::NoEnd => {
            format!("the recording has no end at offset {offset}: it was not finished, or its end is missing")
        }
        _ => format!("{bytes} bytes at offset {offset} are damaged ({damage})"),
    }
}

impl From<Unread> for Damage {
    fn from(unread: Unread) -> Self {
        match unread {
            Unread::CutOff => Self::CutOff,
            Unread::Content(what) => Self::Content(what),
            _ => Self::NoBlock,
        }
    }
}

impl Error {
    /// The refused argument, if that is the error.
    pub fn argument(&self) -> Option<&ArgumentError> {
        match self {
            Self::Argument(argument) => Some(argument),
            _ => None,
        }
    }

    /// Damage of so many bytes.
    pub(crate) fn block(offset: u64, bytes: u64, damage: Damage) -> Self {
        Self::Block { offset, bytes, damage }
    }

    pub(crate) fn io(action: &'static str) -> impl Fn(io::Error) -> Self {
        move |source| Self::Io { action, source }
    }
}

/// A name for a message: at most 80 characters of it.
fn shortened(name: &str) -> String {
    let end = name.char_indices().nth(80);
    end.map_or_else(|| name.to_owned(), |(end, _)| format!("{}…", &name[..end]))
}

/// Names with commas between them; of more than 20 the first ones, and the number of others.
pub(crate) fn listed<'a>(mut names: impl Iterator<Item = &'a str>) -> String {
    let text = names.by_ref().take(20).map(shortened).collect::<Vec<_>>().join(", ");
    let more = names.count();
    if more > 0 {
        format!("{text} and {more} more")
    } else {
        text
    }
}
