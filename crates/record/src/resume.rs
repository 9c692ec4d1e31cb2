//! Finding the place where an existing recording is continued.

use crate::error::Error;
use crate::header::Header;
use crate::index::{self, BLOCKS_PER_SEGMENT, Entry, Segment};
use crate::playback;
use crate::recorder::Resumed;
use crate::scan::{Kind, Scanner, decoded};
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::Path;

/// Opens a recording, truncates it after its last complete block, and moves there.
pub(crate) fn open(path: &Path) -> Result<(File, Resumed), Error> {
    let mut file = File::options()
        .read(true)
        .write(true)
        .open(path)
        .map_err(Error::io("open"))?;
    let header = Scanner::new(&mut file, 0).header()?;
    let resumed = match from_index(&mut file, &header)? {
        Some(resumed) => resumed,
        None => from_blocks(&mut file, header)?,
    };
    // If the program stops after this line, the file is a recording that was not finished, which can be read and resumed.
    file.set_len(resumed.offset).map_err(Error::io("truncate"))?;
    file.seek(SeekFrom::Start(resumed.offset)).map_err(Error::io("read"))?;
    Ok((file, resumed))
}

fn next_tick(segments: &[Segment], entries: &[Entry]) -> i64 {
    let of_entries = entries.iter().filter(|entry| entry.rows > 0).map(|entry| entry.ticks.1);
    let of_segments = segments
        .iter()
        .filter(|segment| segment.rows > 0)
        .map(|segment| segment.ticks.1);
    of_segments
        .chain(of_entries)
        .max()
        .map_or(0, |tick| tick.wrapping_add(1))
}

/// The state from footer and last segment; `None` if they are missing or damaged.
fn from_index(file: &mut File, header: &Header) -> Result<Option<Resumed>, Error> {
    let Some(mut segments) = playback::segments(file, header)? else {
        return Ok(None);
    };
    let start = header.to_bytes().len() as u64;
    let (mut entries, mut offset) = (Vec::new(), segments.last().map_or(start, Segment::end));
    if let Some(last) = segments.last().copied() {
        let Some(found) = playback::entries(file, header, &last)? else {
            return Ok(None);
        };
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
        next_tick: next_tick(&segments, &entries),
        segments,
        entries,
    }))
}

/// The state from the blocks themselves, which are decoded once for their ranges.
fn from_blocks(file: &mut File, header: Header) -> Result<Resumed, Error> {
    file.seek(SeekFrom::Start(0)).map_err(Error::io("read"))?;
    let mut scanner = Scanner::new(file, 0);
    scanner.header()?;
    let columns = header.schema.columns.len();
    let (mut offset, mut segment_start) = (scanner.consumed(), scanner.consumed());
    let (mut entries, mut segments): (Vec<Entry>, Vec<Segment>) = (Vec::new(), Vec::new());
    loop {
        let found = match scanner.next(&header) {
            Ok(Some(found)) => found,
            Ok(None) => break,
            Err(Error::Block { .. }) => continue,
            Err(error) => return Err(error),
        };
        // Skipped bytes stay in the file, so they need an entry: offsets of blocks are sums of lengths.
        if found.offset > offset {
            entries.push(Entry::damaged(found.offset - offset, columns));
        }
        offset = found.offset + found.length as u64;
        match found.kind {
            Kind::Block => entries.push(match decoded(&header, &scanner, &found, |_| true) {
                Ok(block) => Entry::of(found.length as u64, &block.ticks, &block.columns),
                Err(_) => Entry::damaged(found.length as u64, columns),
            }),
            Kind::Segment if index_agrees(&header, scanner.bytes(&found), &entries) => {
                let segment = Segment::new(segment_start, found.length as u64, &entries);
                segment_start = segment.end();
                segments.push(segment);
                entries.clear();
            }
            // A footer, or a segment some of whose blocks were damaged later: its bytes stay and are skipped.
            Kind::Segment | Kind::Footer => entries.push(Entry::damaged(found.length as u64, columns)),
        }
    }
    Ok(Resumed {
        next_tick: next_tick(&segments, &entries),
        header,
        offset,
        segments,
        entries,
    })
}

fn index_agrees(header: &Header, bytes: &[u8], entries: &[Entry]) -> bool {
    let read = index::read_special(header, bytes).and_then(|(_, content, _)| index::read_segment(header, content));
    read.is_ok_and(|read| {
        read.len() == entries.len()
            && read
                .iter()
                .zip(entries)
                .all(|(a, b)| (a.length, a.rows) == (b.length, b.rows))
    })
}
