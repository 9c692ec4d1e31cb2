//! Reading of recordings with random access.

use crate::append;
use crate::block::{self, Block};
use crate::error::{Damage, Error};
use crate::header::Header;
use crate::index::{self, END, Entry, Segment, TRAILER_BYTES};
use crate::scan::{Found, Kind, Order, Scanner, damage_of, decoded};
use crate::schema::Schema;
use std::collections::VecDeque;
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
    index: Index,
    /// Content of the only block.
    single: Option<Vec<u8>>,
    /// Indices of the requested columns.
    chosen: Vec<usize>,
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
        let mut playback = Self::new(File::open(path).map_err(Error::io("open"))?)?;
        if !matches!(playback.index, Index::Whole(_) | Index::NotNeeded)
            && let Some((offset, _)) = append::kept(path)
            && (playback.span.0..=playback.span.1).contains(&offset)
        {
            playback.index = Index::NotNeeded;
            playback.span.1 = offset;
        }
        Ok(playback)
    }
}

impl<R: Read + Seek> Playback<R> {
    /// Opens a recording in any source with random access.
    ///
    /// # Errors
    /// If reading fails or the header is incomplete or damaged. Damage after the header is reported later.
    pub fn new(mut reader: R) -> Result<Self, Error> {
        reader.seek(SeekFrom::Start(0)).map_err(Error::io("read"))?;
        let mut scanner = Scanner::new(0);
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
            order: Order::default(),
            last_number: None,
            pending: VecDeque::new(),
            single: self.single.is_some(),
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
        if let Some(content) = &self.single {
            let length = content.len() as u64;
            let block = block::decode_content(&self.header, content, |_| true).map_err(|damage| Error::Block {
                offset: 0,
                bytes: self.span.1,
                damage,
            })?;
            let entry = Entry::of(length, &block.ticks, &block.columns);
            infos.push(BlockInfo {
                // The checksum of the whole recording follows the content.
                offset: self.span.1.saturating_sub(length + 4),
                bytes: length,
                rows: entry.rows,
                ticks: entry.ticks,
                ends: entry.ends,
            });
        }
        let Index::Whole(segments) = self.index.clone() else {
            return Ok(infos);
        };
        for segment in segments {
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
pub(crate) fn read_at(reader: &mut (impl Read + Seek), offset: u64, length: u64) -> Result<Option<Vec<u8>>, Error> {
    reader.seek(SeekFrom::Start(offset)).map_err(Error::io("read"))?;
    let mut bytes = Vec::new();
    match reader.take(length).read_to_end(&mut bytes) {
        Ok(read) => Ok((read as u64 == length).then_some(bytes)),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(None),
        Err(error) => Err(Error::io("read")(error)),
    }
}

/// The index of a recording of several blocks.
pub(crate) fn index_of(reader: &mut (impl Read + Seek), header: &Header) -> Result<Index, Error> {
    let without = if header.has_end() {
        Index::Missing
    } else {
        Index::NotNeeded
    };
    let end = reader.seek(SeekFrom::End(0)).map_err(Error::io("read"))?;
    let Some(trailer) = end.checked_sub(TRAILER_BYTES as u64) else {
        return Ok(without);
    };
    let Some(bytes) = read_at(reader, trailer, TRAILER_BYTES as u64)? else {
        return Ok(without);
    };
    let Some((length, mark)) = bytes.split_first_chunk::<4>() else {
        return Ok(without);
    };
    let length = u64::from(u32::from_le_bytes(*length));
    let Some(start) = trailer.checked_sub(length).filter(|_| mark == END) else {
        return Ok(without);
    };
    let Some(bytes) = read_at(reader, start, length)? else {
        return Ok(without);
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
        _ => return Ok(without),
    };
    // The segments must fill the file up to the footer: offsets of blocks are sums of lengths.
    let ends = |segments: &Vec<Segment>| segments.last().map_or(first, Segment::end) == expected;
    Ok(found.ok().filter(ends).map_or(Index::Other, Index::Whole))
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
    /// The bytes without index that are scanned at present, and the offset of their end.
    scan: Option<(Scanner, u64)>,
    scanned: bool,
    /// The order of scanned blocks, and the number of the last indexed one.
    order: Order,
    last_number: Option<u64>,
    /// What is returned next.
    pending: VecDeque<Result<Block, Error>>,
    /// Whether the only block is still to be read.
    single: bool,
}

fn no_bytes(offset: u64, damage: Damage) -> Error {
    Error::Block {
        offset,
        bytes: 0,
        damage,
    }
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
        let block = block::decode(header, &bytes, |column| chosen.contains(&column)).map_err(damaged)?;
        // Another block of the recording that was put here is not what the index describes, or has been read before.
        let tolerance = header.schema.time.tolerance();
        let ends = block
            .ticks
            .iter()
            .fold((i64::MAX, i64::MIN), |(l, h), tick| (l.min(*tick), h.max(*tick)));
        let is_described = block.rows() as u64 == entry.rows
            && ends.0.abs_diff(entry.ticks.0) <= tolerance
            && ends.1.abs_diff(entry.ticks.1) <= tolerance;
        if !is_described || (block.number.is_some() && block.number <= self.last_number) {
            return Err(damaged(Damage::Misplaced));
        }
        self.last_number = block.number;
        Ok(block)
    }

    /// The next block of the stretch without index that is scanned; `None` at its end.
    fn scanned(&mut self) -> Option<Result<Block, Error>> {
        let (scanner, end) = self.scan.as_mut()?;
        let (end, header) = (*end, &self.playback.header);
        loop {
            let mut reader = (&mut self.playback.reader).take(end.saturating_sub(scanner.read_to()));
            let found: Found = match scanner.next(&mut reader, header) {
                Ok(Some(found)) => found,
                Ok(None) => {
                    self.scan = None;
                    return None;
                }
                Err(error) => {
                    if !matches!(error, Error::Block { .. }) {
                        self.scan = None;
                    }
                    return Some(Err(error));
                }
            };
            if found.kind != Kind::Block {
                continue;
            }
            let chosen = &self.playback.chosen;
            let block = decoded(header, scanner, &found, |column| chosen.contains(&column));
            let damage = block.as_ref().ok().and_then(|block| self.order.judge(block.number));
            let Some(damage) = damage else { return Some(block) };
            if damage == Damage::Missing {
                self.pending.push_back(block);
            }
            return Some(Err(damage_of(&found, damage)));
        }
    }

    /// Begins to scan a stretch. What is said of missing blocks refers to those after the first one found.
    fn start_scan(&mut self, (start, end): (u64, u64), order: Order) -> Result<(), Error> {
        let sought = self.playback.reader.seek(SeekFrom::Start(start));
        sought.map_err(Error::io("read"))?;
        self.scan = Some((Scanner::new(start), end));
        self.order = order;
        Ok(())
    }

    /// The only block of a recording.
    fn only(&self) -> Result<Block, Error> {
        let chosen = &self.playback.chosen;
        let content = self.playback.single.as_deref().unwrap_or_default();
        let block = block::decode_content(&self.playback.header, content, |column| chosen.contains(&column));
        block.map_err(|damage| Error::Block {
            offset: 0,
            bytes: self.playback.span.1,
            damage,
        })
    }
}

impl<R: Read + Seek> Iterator for Blocks<'_, R> {
    type Item = Result<Block, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if std::mem::take(&mut self.single) {
            return Some(self.only());
        }
        loop {
            if let Some(next) = self.pending.pop_front() {
                return Some(next);
            }
            if self.scan.is_some() {
                match self.scanned() {
                    Some(block) => return Some(block),
                    None if self.playback.index == Index::Missing => {
                        return Some(Err(no_bytes(self.playback.span.1, Damage::NoEnd)));
                    }
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
            let Index::Whole(segments) = &self.playback.index else {
                if self.scanned {
                    return None;
                }
                self.scanned = true;
                if let Err(error) = self.start_scan(self.playback.span, Order::default()) {
                    return Some(Err(error));
                }
                if self.playback.index == Index::Other {
                    return Some(Err(no_bytes(self.playback.span.1, Damage::Index)));
                }
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
                Ok(None) => {
                    let stretch = (segment.start, segment.start.saturating_add(segment.blocks));
                    let order = Order::after(self.last_number.filter(|_| self.ticks == (i64::MIN, i64::MAX)));
                    if let Err(error) = self.start_scan(stretch, order) {
                        return Some(Err(error));
                    }
                }
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
