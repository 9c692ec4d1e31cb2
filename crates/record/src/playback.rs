//! Reading of recordings with random access.

use crate::append;
use crate::block::{self, Block};
use crate::error::{Damage, Error};
use crate::header::Header;
use crate::index::{self, BlockInfo, END, Segment, TRAILER_BYTES};
use crate::scan::Scanner;
use crate::schema::Schema;
use crate::wire::read;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

/// One row: its tick, and one cell per requested column.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Row {
    /// Time of the row in ticks.
    pub tick: i64,
    /// One cell per requested column, in the order of the request; `None` is a gap.
    pub values: Vec<Option<f64>>,
}

/// Reads a recording by its index, or from front to end if it has none.
#[derive(Debug)]
pub struct Playback<R> {
    pub(crate) reader: R,
    pub(crate) header: Header,
    /// Offsets of the first byte after the header, and of the end.
    pub(crate) span: (u64, u64),
    pub(crate) index: Index,
    /// Content of the only block.
    pub(crate) single: Option<Vec<u8>>,
    /// Indices of the requested columns.
    pub(crate) chosen: Vec<usize>,
}

/// What is known of the index of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Index {
    /// The index is whole, and its lengths are those of the recording.
    Whole(Vec<Segment>),
    /// The index is whole and describes other bytes.
    Other,
    /// There is no end, or it is damaged.
    Missing,
    /// None is needed: blocks of a stream, or what was there before an append that did not end.
    NotNeeded,
}

impl Playback<File> {
    /// Opens a file. If an append to it did not end, it is read as it was before.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::opened(File::open(path).map_err(Error::io("open"))?, path)
    }
}

impl<R: Read + Seek> Playback<R> {
    /// Opens a source of the bytes of this file, such as a buffer before it. If an append to the file did not end, it is read as it was before.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn opened(source: R, path: impl AsRef<Path>) -> Result<Self, Error> {
        let mut playback = Self::new(source)?;
        if !matches!(playback.index, Index::Whole(_) | Index::NotNeeded)
            && let Some((offset, _)) = append::kept(path.as_ref())
            && (playback.span.0..=playback.span.1).contains(&offset)
        {
            playback.index = Index::NotNeeded;
            playback.span.1 = offset;
        }
        Ok(playback)
    }

    /// Opens a recording in any source with random access.
    ///
    /// # Errors
    /// If reading fails or the header is incomplete or damaged. Damage after the header is reported later.
    pub fn new(mut reader: R) -> Result<Self, Error> {
        reader.seek(SeekFrom::Start(0)).map_err(Error::io("read"))?;
        let mut scanner = Scanner::default();
        let (header, single) = scanner.header(&mut reader)?;
        let start = scanner.consumed();
        let index = match single {
            Some(_) => Index::Whole(Vec::new()),
            None => index_of(&mut reader, &header)?,
        };
        let end = reader.seek(SeekFrom::End(0)).map_err(Error::io("read"))?;
        Ok(Self {
            reader,
            chosen: (0..header.schema.columns.len()).collect(),
            header,
            span: (start, end),
            index,
            single,
        })
    }

    /// Columns and time of the recording.
    pub fn schema(&self) -> &Schema {
        &self.header.schema
    }

    /// Whether the recording was finished and its index is undamaged. A recording of a single block needs none.
    pub fn has_index(&self) -> bool {
        matches!(self.index, Index::Whole(_))
    }

    /// Whether the recording has its end, or needs none. Reading one without its end gives an error that says so.
    pub fn is_finished(&self) -> bool {
        self.index != Index::Missing
    }

    /// Smallest and largest tick, without decoding values; `None` without an index or without rows.
    ///
    /// # Errors
    /// If the only block is damaged.
    pub fn ticks(&self) -> Result<Option<(i64, i64)>, Error> {
        if let Some(block) = self.only(|_| false)? {
            return Ok(index::ends_of(&block.ticks));
        }
        let Index::Whole(segments) = &self.index else {
            return Ok(None);
        };
        let filled = segments.iter().filter(|segment| segment.rows > 0);
        Ok(index::ends(filled.map(|segment| segment.ticks)))
    }

    /// The only block, if there is one.
    pub(crate) fn only(&self, wanted: impl Fn(usize) -> bool) -> Result<Option<Block>, Error> {
        let only = |content: &Vec<u8>| block::only(&self.header, content, self.span.1, wanted);
        self.single.as_ref().map(only).transpose()
    }

    /// Length of the whole recording in bytes.
    pub fn bytes(&self) -> u64 {
        self.span.1
    }

    /// Requests only these columns, in this order, for all later reading.
    ///
    /// # Errors
    /// If there is no such column. The request before then stays in effect.
    pub fn columns(&mut self, names: &[&str]) -> Result<&mut Self, Error> {
        let places = names.iter().map(|name| self.header.schema.position(name));
        self.chosen = places.collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// The index, one entry per block; empty if the recording has none.
    ///
    /// # Errors
    /// If reading fails or a part of the index is damaged.
    pub fn index(&mut self) -> Result<Vec<BlockInfo>, Error> {
        let mut infos = Vec::new();
        if let Some(block) = self.only(|_| true)? {
            let length = self.single.as_ref().map_or(0, Vec::len) as u64;
            // The checksum of the whole recording follows the content.
            let offset = self.span.1.saturating_sub(length + 4);
            infos.push(BlockInfo::of(offset, length, &block.ticks, &block.columns));
        }
        let Index::Whole(segments) = &self.index else {
            return Ok(infos);
        };
        for segment in segments {
            let found = entries(&mut self.reader, &self.header, segment)?;
            let damaged = || Error::block(segment.start + segment.blocks, segment.length, Damage::Checksum);
            infos.extend(found.ok_or_else(damaged)?);
        }
        Ok(infos)
    }
}

/// Reads `length` bytes at an offset; `None` if the file ends earlier.
pub(crate) fn read_at(reader: &mut (impl Read + Seek), offset: u64, length: u64) -> Result<Option<Vec<u8>>, Error> {
    reader.seek(SeekFrom::Start(offset)).map_err(Error::io("read"))?;
    let mut bytes = Vec::new();
    match reader.take(length).read_to_end(&mut bytes) {
        Ok(read) => Ok((read as u64 == length).then_some(bytes)),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(None),
        Err(error) => Err(Error::io("read")(error)),
    }
}

/// The index of a recording of several blocks, in front of its last bytes.
pub(crate) fn index_of(reader: &mut (impl Read + Seek), header: &Header) -> Result<Index, Error> {
    let none = if header.has_end() {
        Index::Missing
    } else {
        Index::NotNeeded
    };
    let end = reader.seek(SeekFrom::End(0)).map_err(Error::io("read"))?;
    let trailer = end.saturating_sub(TRAILER_BYTES as u64);
    let bytes = read_at(reader, trailer, TRAILER_BYTES as u64)?.unwrap_or_default();
    let length = match bytes.split_first_chunk() {
        Some((length, end)) if *end == END => u64::from(u32::from_le_bytes(*length)),
        _ => return Ok(none),
    };
    // No index begins at the beginning of a recording.
    let start = trailer.saturating_sub(length);
    let bytes = read_at(reader, start, length)?.unwrap_or_default();
    let first = header.length as u64;
    let (found, expected) = match index::read_special(header, &bytes, |bytes| header.sum(bytes)) {
        Ok((index::FOOTER, content, whole)) if whole as u64 == length => {
            (read(content, |fields| index::footer(fields, header, &[])).ok(), start)
        }
        Ok((index::ONLY, _, whole)) if whole as u64 == length => {
            let listed = index::listed(header, &bytes, first);
            (listed.map(|(entries, length)| vec![Segment::new(length, &entries)]), trailer)
        }
        _ => return Ok(none),
    };
    // The segments must fill the file up to the footer: offsets of blocks are sums of lengths.
    let ends = |segments: &Vec<Segment>| segments.last().map_or(first, Segment::end) == expected;
    Ok(found.filter(ends).map_or(Index::Other, Index::Whole))
}

/// The entries of a segment; `None` if it is damaged.
pub(crate) fn entries(
    reader: &mut (impl Read + Seek),
    header: &Header,
    segment: &Segment,
) -> Result<Option<Vec<BlockInfo>>, Error> {
    let offset = segment.start.saturating_add(segment.blocks);
    let Some(bytes) = read_at(reader, offset, segment.length)? else {
        return Ok(None);
    };
    let total = |(entries, _): &(Vec<BlockInfo>, u64)| {
        let mut lengths = entries.iter().map(|entry| entry.bytes);
        lengths.try_fold(0_u64, |sum, length| sum.checked_add(length)) == Some(segment.blocks)
    };
    let found = index::listed(header, &bytes, segment.start).filter(total);
    Ok(found.map(|(entries, _)| entries))
}
