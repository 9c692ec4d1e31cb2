//! Reading of recordings with random access.

use crate::block::{self, Block};
use crate::error::{Damage, Error};
use crate::header::Header;
use crate::index::{self, END, Entry, Segment, TRAILER_BYTES};
use crate::scan::{Kind, Scanner, decoded};
use crate::schema::Schema;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom, Take};
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

/// What the index says of one block.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BlockInfo {
    /// Offset of the first byte.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u64,
    /// Number of rows.
    pub rows: u64,
    /// Smallest and largest tick.
    pub ticks: (i64, i64),
    /// Lower and upper bound of each column's values (they exceed them by at most a 15th of the column's range in 1024 blocks); `None`
    /// without values.
    pub ends: Vec<Option<(f64, f64)>>,
}

/// Reads a recording by its index, or from front to end if it has none.
#[derive(Debug)]
pub struct Playback<R> {
    reader: R,
    header: Header,
    /// Offsets of the first byte after the header, and of the end.
    span: (u64, u64),
    segments: Option<Vec<Segment>>,
    /// Indices of the requested columns.
    chosen: Vec<usize>,
}

impl Playback<File> {
    /// Opens a file.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::new(File::open(path).map_err(Error::io("open"))?)
    }
}

impl<R: Read + Seek> Playback<R> {
    /// Opens a recording in any source with random access.
    ///
    /// # Errors
    /// If reading fails or the header is incomplete or damaged. Damage after the header is reported later.
    pub fn new(mut reader: R) -> Result<Self, Error> {
        reader.seek(SeekFrom::Start(0)).map_err(Error::io("read"))?;
        let mut scanner = Scanner::new(&mut reader, 0);
        let header = scanner.header()?;
        let start = scanner.consumed();
        let segments = segments(&mut reader, &header)?;
        let end = reader.seek(SeekFrom::End(0)).map_err(Error::io("read"))?;
        Ok(Self {
            reader,
            chosen: (0..header.schema.columns.len()).collect(),
            header,
            span: (start, end),
            segments,
        })
    }

    /// Columns and time of the recording.
    pub fn schema(&self) -> &Schema {
        &self.header.schema
    }

    /// Whether the recording was finished and its index is undamaged.
    pub fn has_index(&self) -> bool {
        self.segments.is_some()
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
        self.chosen = names
            .iter()
            .map(|name| self.header.schema.position(name))
            .collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// All blocks in order. Damaged bytes give one error per stretch; the iteration continues after them.
    pub fn blocks(&mut self) -> Blocks<'_, R> {
        self.blocks_between(i64::MIN, i64::MAX)
    }

    /// The blocks that may have rows with ticks in `from..=to`, whole.
    pub fn blocks_between(&mut self, from: i64, to: i64) -> Blocks<'_, R> {
        Blocks {
            ticks: (from, to),
            next_segment: 0,
            entries: VecDeque::new(),
            scan: None,
            scanned: false,
            playback: self,
        }
    }

    /// All rows in order. Damaged bytes give one error per stretch; the iteration continues after them.
    pub fn rows(&mut self) -> Rows<'_, R> {
        self.range(i64::MIN, i64::MAX)
    }

    /// The rows with ticks in `from..=to`.
    pub fn range(&mut self, from: i64, to: i64) -> Rows<'_, R> {
        Rows {
            chosen: self.chosen.clone(),
            blocks: self.blocks_between(from, to),
            ticks: (from, to),
            block: Block::default(),
            row: 0,
        }
    }

    /// The index, one entry per block; empty if the recording has none.
    ///
    /// # Errors
    /// If reading fails or a part of the index is damaged.
    pub fn index(&mut self) -> Result<Vec<BlockInfo>, Error> {
        let mut infos = Vec::new();
        for segment in self.segments.clone().unwrap_or_default() {
            let Some(found) = entries(&mut self.reader, &self.header, &segment)? else {
                return Err(Error::Block {
                    offset: segment.start + segment.blocks,
                    bytes: segment.length,
                    damage: Damage::Checksum,
                });
            };
            let mut offset = segment.start;
            for entry in found {
                infos.push(BlockInfo {
                    offset,
                    bytes: entry.length,
                    rows: entry.rows,
                    ticks: entry.ticks,
                    ends: entry.ends,
                });
                offset = offset.saturating_add(infos.last().map_or(0, |info| info.bytes));
            }
        }
        Ok(infos)
    }
}

/// Reads `length` bytes at an offset; `None` if the file ends earlier.
fn read_at(reader: &mut (impl Read + Seek), offset: u64, length: u64) -> Result<Option<Vec<u8>>, Error> {
    reader.seek(SeekFrom::Start(offset)).map_err(Error::io("read"))?;
    let mut bytes = Vec::new();
    match reader.take(length).read_to_end(&mut bytes) {
        Ok(read) => Ok((read as u64 == length).then_some(bytes)),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(None),
        Err(error) => Err(Error::io("read")(error)),
    }
}

/// The segments of a finished recording; `None` without an undamaged footer.
pub(crate) fn segments(reader: &mut (impl Read + Seek), header: &Header) -> Result<Option<Vec<Segment>>, Error> {
    let end = reader.seek(SeekFrom::End(0)).map_err(Error::io("read"))?;
    let Some(trailer) = end.checked_sub(TRAILER_BYTES as u64) else {
        return Ok(None);
    };
    let Some(bytes) = read_at(reader, trailer, TRAILER_BYTES as u64)? else {
        return Ok(None);
    };
    let Some((length, mark)) = bytes.split_first_chunk::<4>() else {
        return Ok(None);
    };
    let length = u64::from(u32::from_le_bytes(*length));
    let Some(start) = trailer.checked_sub(length).filter(|_| mark == END) else {
        return Ok(None);
    };
    let Some(bytes) = read_at(reader, start, length)? else {
        return Ok(None);
    };
    let first = header.to_bytes().len() as u64;
    let (found, expected) = match index::read_special(header, &bytes) {
        Ok((index::FOOTER, content, whole)) if whole as u64 == length => {
            (index::read_footer(header, content, first), start)
        }
        Ok((index::ONLY, content, whole)) if whole as u64 == length => {
            let entries = index::read_segment(header, content);
            (entries.map(|entries| vec![Segment::new(first, length, &entries)]), trailer)
        }
        _ => return Ok(None),
    };
    // The segments must fill the file up to the footer: offsets of blocks are sums of lengths.
    let ends = |segments: &Vec<Segment>| segments.last().map_or(first, Segment::end) == expected;
    Ok(found.ok().filter(ends))
}

/// The entries of a segment; `None` if it is damaged.
pub(crate) fn entries(
    reader: &mut (impl Read + Seek),
    header: &Header,
    segment: &Segment,
) -> Result<Option<Vec<Entry>>, Error> {
    let offset = segment.start.saturating_add(segment.blocks);
    let Some(bytes) = read_at(reader, offset, segment.length)? else {
        return Ok(None);
    };
    let found = match index::read_special(header, &bytes) {
        Ok((index::SEGMENT | index::ONLY, content, _)) => index::read_segment(header, content).ok(),
        _ => None,
    };
    let total = |entries: &Vec<Entry>| {
        entries
            .iter()
            .try_fold(0_u64, |sum, entry| sum.checked_add(entry.length))
    };
    Ok(found.filter(|entries| total(entries) == Some(segment.blocks)))
}

/// Iterator over [`Block`]s.
pub struct Blocks<'a, R> {
    playback: &'a mut Playback<R>,
    ticks: (i64, i64),
    next_segment: usize,
    /// Offsets and entries of the segment that is read at present.
    entries: VecDeque<(u64, Entry)>,
    /// Start and end of the bytes without index that are scanned at present.
    scan: Option<(u64, u64)>,
    scanned: bool,
}

impl<R: Read + Seek> Blocks<'_, R> {
    fn overlaps(&self, ticks: (i64, i64)) -> bool {
        ticks.0 <= self.ticks.1 && ticks.1 >= self.ticks.0
    }

    /// The next block of an indexed segment.
    fn indexed(&mut self, offset: u64, entry: &Entry) -> Result<Block, Error> {
        let damaged = |damage| Error::Block {
            offset,
            bytes: entry.length,
            damage,
        };
        let header = &self.playback.header;
        // The length before a block and the checksum after it take at most 14 bytes. Nothing longer is read, whatever the index says.
        let limit = block::max_bytes(header) as u64 + 16;
        if entry.length > limit || entry.rows == 0 {
            return Err(damaged(Damage::NoBlock));
        }
        let bytes = read_at(&mut self.playback.reader, offset, entry.length)?.ok_or(damaged(Damage::CutOff))?;
        if block::length(header, &bytes).map_err(damaged)? as u64 != entry.length {
            return Err(damaged(Damage::NoBlock));
        }
        let chosen = &self.playback.chosen;
        block::decode(header, &bytes, |column| chosen.contains(&column)).map_err(damaged)
    }

    /// The next block of a stretch without index.
    fn scanned(&mut self, (start, end): (u64, u64)) -> Option<Result<Block, Error>> {
        let reader = &mut self.playback.reader;
        if let Err(error) = reader.seek(SeekFrom::Start(start)) {
            self.scan = None;
            return Some(Err(Error::io("read")(error)));
        }
        // Each block has a new scanner, because a scanner borrows the reader. The stretch then begins after that block.
        let header = &self.playback.header;
        let mut scanner: Scanner<Take<&mut R>> = Scanner::new(reader.take(end - start), start);
        loop {
            let found = match scanner.next(header) {
                Ok(Some(found)) => found,
                Ok(None) => {
                    self.scan = None;
                    return None;
                }
                Err(error) => {
                    self.scan = match &error {
                        Error::Block { offset, bytes, .. } => Some((offset + bytes, end)),
                        _ => None,
                    };
                    return Some(Err(error));
                }
            };
            if found.kind != Kind::Block {
                continue;
            }
            let chosen = &self.playback.chosen;
            let block = decoded(header, &scanner, &found, |column| chosen.contains(&column));
            self.scan = Some((found.offset + found.length as u64, end));
            return Some(block);
        }
    }
}

impl<R: Read + Seek> Iterator for Blocks<'_, R> {
    type Item = Result<Block, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(stretch) = self.scan {
                match self.scanned(stretch) {
                    Some(block) => return Some(block),
                    None => continue,
                }
            }
            if let Some((offset, entry)) = self.entries.pop_front() {
                // An entry without rows stands for damaged bytes, whose times are unknown: they are reported for every range.
                if entry.rows > 0 && !self.overlaps(entry.ticks) {
                    continue;
                }
                return Some(self.indexed(offset, &entry));
            }
            let Some(segments) = &self.playback.segments else {
                if self.scanned {
                    return None;
                }
                self.scanned = true;
                self.scan = Some(self.playback.span);
                continue;
            };
            let segment = *segments.get(self.next_segment)?;
            self.next_segment += 1;
            if segment.rows > 0 && !self.overlaps(segment.ticks) {
                continue;
            }
            match entries(&mut self.playback.reader, &self.playback.header, &segment) {
                Ok(Some(found)) => {
                    let mut offset = segment.start;
                    for entry in found {
                        let next = offset.saturating_add(entry.length);
                        self.entries.push_back((offset, entry));
                        offset = next;
                    }
                }
                // Only the segment itself is damaged: scan for its blocks.
                Ok(None) => self.scan = Some((segment.start, segment.start.saturating_add(segment.blocks))),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

/// Iterator over [`Row`]s.
pub struct Rows<'a, R> {
    blocks: Blocks<'a, R>,
    chosen: Vec<usize>,
    ticks: (i64, i64),
    block: Block,
    row: usize,
}

impl<R: Read + Seek> Iterator for Rows<'_, R> {
    type Item = Result<Row, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            while let Some(tick) = self.block.ticks.get(self.row).copied() {
                let row = self.row;
                self.row += 1;
                if tick < self.ticks.0 || tick > self.ticks.1 {
                    continue;
                }
                let values = self
                    .chosen
                    .iter()
                    .map(|column| self.block.columns[*column][row])
                    .collect();
                return Some(Ok(Row { tick, values }));
            }
            match self.blocks.next()? {
                Ok(block) => (self.block, self.row) = (block, 0),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
