//! Finding the place where an existing recording is continued.

use crate::append::{self, Append, State};
use crate::block;
use crate::error::{Damage, Error, ensure};
use crate::header::{Header, VERSION_5};
use crate::index::{self, BLOCKS_PER_SEGMENT, BlockInfo, Segment};
use crate::playback::{self, Index};
use crate::scan::{Kind, Scanner};
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::Path;

/// State of a recording that is to be continued.
pub(crate) struct Resumed {
    pub(crate) header: Header,
    pub(crate) offset: u64,
    pub(crate) segments: Vec<Segment>,
    pub(crate) entries: Vec<BlockInfo>,
    pub(crate) next_number: u64,
}

/// A recording that was opened and locked.
pub(crate) enum Opened {
    /// The file where blocks are to be written stands at their place; nothing is overwritten yet.
    InPlace(File, Append, Box<Resumed>),
    /// It has another form than one that goes on: its header, and the content of its only block or its blocks behind the scanner.
    Other(File, Box<Header>, Option<Vec<u8>>, Scanner),
}

/// Opens a recording and locks it.
pub(crate) fn open(path: &Path) -> Result<Opened, Error> {
    let mut file = File::options()
        .read(true)
        .write(true)
        .open(path)
        .map_err(Error::io("open"))?;
    append::lock(&file)?;
    ensure!(is_still_there(&file, path), Error::Locked);
    let mut scanner = Scanner::default();
    let (header, single) = scanner.header(&mut file)?;
    if single.is_some() || header.version == VERSION_5 {
        return Ok(Opened::Other(file, Box::new(header), single, scanner));
    }
    let mut index = playback::index_of(&mut file, &header)?;
    if let Some((offset, tail)) = append::kept(path) {
        // An append did not end. If its index is whole, only the kept bytes were not removed yet.
        if !matches!(index, Index::Whole(_)) {
            append::roll_back(&mut file, path, offset, &tail)?;
            index = playback::index_of(&mut file, &header)?;
        }
    }
    let mut resumed = None;
    if let Index::Whole(segments) = index {
        resumed = from_index(&mut file, &header, segments)?;
    }
    let resumed = match resumed {
        Some(resumed) => resumed,
        None => from_blocks(&mut file, header)?,
    };
    let are_numbers_left = resumed.next_number < block::NUMBERS;
    ensure!(are_numbers_left, Error::Header(Damage::Content("number of a block")));
    file.seek(SeekFrom::Start(resumed.offset)).map_err(Error::io("read"))?;
    let handle = file.try_clone().map_err(Error::io("open"))?;
    let append = Append::new(handle, path, State::Planned(resumed.offset));
    Ok(Opened::InPlace(file, append, Box::new(resumed)))
}

/// Whether the file has still this name: another writer may have put a new one into its place before the lock.
fn is_still_there(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let (Ok(own), Ok(named)) = (file.metadata(), std::fs::metadata(path)) else {
            return false;
        };
        (own.dev(), own.ino()) == (named.dev(), named.ino())
    }
    #[cfg(not(unix))]
    {
        let _ = (file, path);
        true
    }
}

/// An empty, locked file beside a recording, which takes its place when the append is complete.
pub(crate) fn copy(locked: File, path: &Path) -> Result<(File, Append), Error> {
    let mut options = File::options();
    options.read(true).write(true).create(true).truncate(true);
    let file = options.open(append::beside(path)).map_err(Error::io("copy"))?;
    append::lock(&file)?;
    let append = Append::new(file.try_clone().map_err(Error::io("copy"))?, path, State::Copy(locked));
    Ok((file, append))
}

/// The tick behind all rows.
pub(crate) fn next_tick(segments: &[Segment], entries: &[BlockInfo]) -> i64 {
    let of_entries = entries.iter().filter(|entry| entry.rows > 0).map(|entry| entry.ticks);
    let filled = segments.iter().filter(|segment| segment.rows > 0);
    let ends = index::ends(filled.map(|segment| segment.ticks).chain(of_entries));
    ends.map_or(0, |(_, last)| last.wrapping_add(1))
}

/// The state from footer and last segment; `None` if the last segment or block is damaged.
fn from_index(file: &mut File, header: &Header, mut segments: Vec<Segment>) -> Result<Option<Resumed>, Error> {
    let start = header.length as u64;
    let (mut entries, mut offset) = (Vec::new(), segments.last().map_or(start, Segment::end));
    let mut next_number = 0;
    if let Some(last) = segments.last().copied() {
        let Some(found) = playback::entries(file, header, &last)? else {
            return Ok(None);
        };
        let Some(number) = last_number(file, header, &found)? else {
            return Ok(None);
        };
        next_number = number + 1;
        // The last segment is not full: it is overwritten, and its entries go into the next one.
        if found.len() < BLOCKS_PER_SEGMENT {
            offset = last.start + last.blocks;
            entries = found;
            segments.pop();
        }
    }
    Ok(Some(Resumed {
        header: header.clone(),
        offset,
        next_number,
        segments,
        entries,
    }))
}

/// The number of the last block of a segment; 0 in version 5. `None` if it cannot be read.
fn last_number(file: &mut File, header: &Header, entries: &[BlockInfo]) -> Result<Option<u64>, Error> {
    let Some(last) = entries.iter().rfind(|entry| entry.rows > 0) else {
        return Ok(None);
    };
    let Some(bytes) = playback::read_at(file, last.offset, last.bytes)? else {
        return Ok(None);
    };
    let block =
        block::length(header, &bytes, |bytes| header.sum(bytes)).and_then(|_| block::decode(header, &bytes, |_| false));
    // If another block was put there, the last number is not known.
    let block = block.ok().filter(|block| last.describes(&block.ticks, header));
    Ok(block.map(|block| block.number.unwrap_or(0)))
}

/// The state from the blocks themselves, which are decoded once for their ranges.
fn from_blocks(file: &mut File, header: Header) -> Result<Resumed, Error> {
    file.seek(SeekFrom::Start(0)).map_err(Error::io("read"))?;
    let mut scanner = Scanner::default();
    scanner.header(file)?;
    let columns = header.schema.columns.len();
    let mut offset = scanner.consumed();
    let (mut entries, mut segments): (Vec<BlockInfo>, Vec<Segment>) = (Vec::new(), Vec::new());
    let mut next_number = 0;
    loop {
        let found = match scanner.next(file, &header) {
            Ok(Some(found)) => found,
            Ok(None) => break,
            Err(Error::Block { .. }) => continue,
            Err(error) => return Err(error),
        };
        // Skipped bytes stay in the file, so they need an entry: offsets of blocks are sums of lengths.
        if found.offset > offset {
            entries.push(BlockInfo::damaged(offset, found.offset - offset, columns));
        }
        let damaged = || BlockInfo::damaged(found.offset, found.length as u64, columns);
        offset = found.offset + found.length as u64;
        match found.kind {
            Kind::Block => entries.push(match scanner.decoded(&header, &found, |_| true) {
                // A block out of its place is not read.
                Ok(block) if block.number.is_none_or(|number| number >= next_number) => {
                    next_number = block.number.map_or(0, |number| number + 1);
                    BlockInfo::of(found.offset, found.length as u64, &block.ticks, &block.columns)
                }
                _ => damaged(),
            }),
            // A footer, or a segment of other bytes: it stays and is skipped.
            kind => match listed(&header, scanner.bytes(&found), &entries).filter(|_| kind == Kind::Segment) {
                Some(segment) => {
                    segments.push(segment);
                    entries.clear();
                }
                None => entries.push(damaged()),
            },
        }
    }
    Ok(Resumed {
        next_number,
        header,
        offset,
        segments,
        entries,
    })
}

/// The segment of these bytes, if it describes as many bytes as these entries. Blocks that were damaged later are refused when they are read.
fn listed(header: &Header, bytes: &[u8], entries: &[BlockInfo]) -> Option<Segment> {
    let (own, whole) = index::listed(header, bytes, entries.first()?.offset)?;
    let segment = Segment::new(whole, &own);
    (segment.blocks == Segment::new(0, entries).blocks).then_some(segment)
}
