//! Appending as a transaction: until it is complete, the recording can be put back as it was, also after a crash.
//!
//! Blocks are appended in place of the old index. Before that, the bytes that are overwritten are kept in a file beside, whose name is that
//! of the recording with `.append` added:
//!
//! ```text
//! kept := 66 65 77 55, offset (8 bytes), bytes from there to the old end, CRC-32 of all before it
//! ```
//!
//! A recording of a single block has another header than one that goes on, so it is copied beside and takes the recording's place at the end.

use crate::error::Error;
use crate::wire::{CHECK_BYTES, checksum, with_checksum};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const MAGIC: [u8; 4] = *b"fewU";

/// Where bytes are kept, or a copy grows.
pub(crate) fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".append");
    PathBuf::from(name)
}

/// Locks a file against other writers; the lock ends with the last handle.
pub(crate) fn lock(file: &File) -> Result<(), Error> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(std::fs::TryLockError::WouldBlock) => Err(Error::Locked),
        // Some file systems have no locks.
        Err(std::fs::TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => Ok(()),
        Err(std::fs::TryLockError::Error(error)) => Err(Error::io("lock")(error)),
    }
}

/// What an append that did not end has kept: the offset, and the bytes from there on.
pub(crate) fn kept(path: &Path) -> Option<(u64, Vec<u8>)> {
    let bytes = std::fs::read(beside(path)).ok()?;
    let (content, check) = bytes.split_last_chunk::<CHECK_BYTES>()?;
    let (offset, tail) = content.strip_prefix(&MAGIC)?.split_first_chunk::<8>()?;
    (u32::from_le_bytes(*check) == checksum(&[content])).then(|| (u64::from_le_bytes(*offset), tail.to_vec()))
}

/// Puts a recording back to what it was before the append that kept these bytes.
pub(crate) fn roll_back(file: &mut File, path: &Path, offset: u64, tail: &[u8]) -> Result<(), Error> {
    let mut restore = || -> std::io::Result<()> {
        file.set_len(offset)?;
        file.seek(SeekFrom::Start(offset))?;
        file.write_all(tail)?;
        file.sync_data()?;
        std::fs::remove_file(beside(path))
    };
    restore().map_err(Error::io("restore"))
}

/// An append that may be undone. Dropped before [`commit`](Self::commit), it puts the recording back. The default has nothing to undo.
#[derive(Debug, Default)]
pub(crate) struct Append(Option<Open>);

/// An append to a file, and the path of the recording.
#[derive(Debug)]
struct Open {
    file: File,
    path: PathBuf,
    state: State,
}

#[derive(Debug)]
pub(crate) enum State {
    /// Nothing is overwritten yet; blocks are to be written from this offset on.
    Planned(u64),
    /// The bytes from this offset on, which are these, are overwritten.
    InPlace(u64, Vec<u8>),
    /// A copy grows beside. The lock is that of the recording.
    Copy(#[expect(dead_code, reason = "held, not read")] File),
}

impl Append {
    /// An append to this file, which is the recording or a copy beside it.
    pub(crate) fn new(file: File, path: &Path, state: State) -> Self {
        let path = path.to_owned();
        Self(Some(Open { file, path, state }))
    }

    /// Must be called before the first byte is written.
    pub(crate) fn begin(&mut self) -> Result<(), Error> {
        let Some(Open { file, path, state }) = &mut self.0 else {
            return Ok(());
        };
        let State::Planned(offset) = *state else {
            return Ok(());
        };
        let mut keep = || -> std::io::Result<Vec<u8>> {
            let mut tail = Vec::new();
            file.seek(SeekFrom::Start(offset))?;
            file.read_to_end(&mut tail)?;
            let bytes = with_checksum([&MAGIC[..], &offset.to_le_bytes(), &tail].concat());
            let mut kept = File::create(beside(path))?;
            kept.write_all(&bytes)?;
            kept.sync_all()?;
            sync_folder(path);
            file.set_len(offset)?;
            file.seek(SeekFrom::Start(offset))?;
            Ok(tail)
        };
        *state = State::InPlace(offset, keep().map_err(Error::io("keep the end of"))?);
        Ok(())
    }

    /// What was written so far stays.
    pub(crate) fn commit(&mut self) -> Result<(), Error> {
        let Some(Open { file, path, state }) = &self.0 else {
            return Ok(());
        };
        let done = match state {
            State::Planned(_) => return Ok(()),
            State::InPlace(..) => file.sync_data().and_then(|()| std::fs::remove_file(beside(path))),
            State::Copy(_) => file.sync_data().and_then(|()| {
                std::fs::rename(beside(path), path)?;
                sync_folder(path);
                Ok(())
            }),
        };
        done.map_err(Error::io("complete"))?;
        self.0 = None;
        Ok(())
    }
}

impl Drop for Append {
    fn drop(&mut self) {
        let Some(Open { file, path, state }) = &mut self.0 else {
            return;
        };
        // Nobody can be told of a failure here: the bytes that were kept are still there, and the next append puts them back.
        let _ = match state {
            State::Planned(_) => Ok(()),
            State::InPlace(offset, tail) => roll_back(file, path, *offset, tail),
            State::Copy(_) => std::fs::remove_file(beside(path)).map_err(Error::io("remove a copy of")),
        };
    }
}

/// Makes the names in a file's folder durable, where the system can.
fn sync_folder(path: &Path) {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
}
