//! The blocks and rows of a recording one after the other, by its index or by a scan.

use crate::block::{self, Block};
use crate::error::{Damage, Error, ensure};
use crate::index::{BlockInfo, Segment};
use crate::playback::{Index, Playback, Row, entries, read_at};
use crate::scan::{Order, Scanner};
use std::io::{Read, Seek, SeekFrom};

impl<R: Read + Seek> Playback<R> {
    /// All blocks in order. Damaged bytes give one error per stretch; the iteration continues after them.
    pub fn blocks(&mut self) -> Blocks<'_, R> {
        self.blocks_between(i64::MIN, i64::MAX)
    }

    /// The blocks that may have rows with ticks in `from..=to`, whole.
    pub fn blocks_between(&mut self, from: i64, to: i64) -> Blocks<'_, R> {
        Blocks::new(self, (from, to))
    }

    /// All rows in order. Damaged bytes give one error per stretch; the iteration continues after them.
    pub fn rows(&mut self) -> Rows<'_, R> {
        self.range(i64::MIN, i64::MAX)
    }

    /// The rows with ticks in `from..=to`.
    pub fn range(&mut self, from: i64, to: i64) -> Rows<'_, R> {
        let chosen = self.chosen.clone();
        Rows::new(self.blocks_between(from, to), chosen, (from, to))
    }
}

/// What comes next.
pub(crate) enum Part {
    /// A block that is not read yet, as the index describes it.
    Known(BlockInfo),
    Found(Block),
}

/// Iterator over [`Block`]s.
pub struct Blocks<'a, R> {
    playback: &'a mut Playback<R>,
    ticks: (i64, i64),
    next_segment: usize,
    /// Entries of the segment that is read at present.
    entries: std::vec::IntoIter<BlockInfo>,
    /// The bytes without index that are scanned at present, and the offset of their end.
    scan: Option<(Scanner, u64)>,
    scanned: bool,
    /// The number of the last indexed block.
    last_number: Option<u64>,
    /// Whether the only block is still to be read.
    single: bool,
}

impl<'a, R> Blocks<'a, R> {
    /// The blocks that may have rows with these ticks.
    pub(crate) fn new(playback: &'a mut Playback<R>, ticks: (i64, i64)) -> Self {
        Self {
            ticks,
            next_segment: 0,
            entries: Vec::new().into_iter(),
            scan: None,
            scanned: false,
            last_number: None,
            single: playback.single.is_some(),
            playback,
        }
    }
}

impl<R: Read + Seek> Blocks<'_, R> {
    fn overlaps(&self, ticks: (i64, i64)) -> bool {
        ticks.0 <= self.ticks.1 && ticks.1 >= self.ticks.0
    }

    /// Reads the entries of a segment. If it is damaged, its blocks are searched.
    fn enter(&mut self, segment: &Segment) -> Result<(), Error> {
        match entries(&mut self.playback.reader, &self.playback.header, segment)? {
            Some(found) => {
                self.entries = found.into_iter();
                Ok(())
            }
            None => {
                let stretch = (segment.start, segment.start.saturating_add(segment.blocks));
                let order = Order::after(self.last_number.filter(|_| self.ticks == (i64::MIN, i64::MAX)));
                self.start_scan(stretch, order)
            }
        }
    }

    /// The block that this entry describes.
    fn indexed(&mut self, entry: &BlockInfo) -> Result<Block, Error> {
        let damaged = |damage| Error::block(entry.offset, entry.bytes, damage);
        let header = &self.playback.header;
        // The length before a block and the checksum after it take at most 14 bytes. Nothing longer is read, whatever the index says.
        let limit = block::max_bytes(header) as u64 + 16;
        ensure!(entry.bytes <= limit && entry.rows > 0, damaged(Damage::NoBlock));
        let bytes = read_at(&mut self.playback.reader, entry.offset, entry.bytes)?.ok_or(damaged(Damage::CutOff))?;
        let length = block::length(header, &bytes, |bytes| header.sum(bytes)).map_err(damaged)?;
        ensure!(length as u64 == entry.bytes, damaged(Damage::NoBlock));
        let chosen = &self.playback.chosen;
        let block = block::decode(header, &bytes, |column| chosen.contains(&column)).map_err(damaged)?;
        // Another block of the recording that was put here is not what the index describes, or has been read before.
        let is_next = block.number.is_none() || block.number > self.last_number;
        ensure!(entry.describes(&block.ticks, header) && is_next, damaged(Damage::Misplaced));
        self.last_number = block.number;
        Ok(block)
    }

    /// The next block of the stretch without index that is scanned; `None` at its end.
    fn scanned(&mut self) -> Result<Option<Block>, Error> {
        let Some((scanner, end)) = self.scan.as_mut() else {
            return Ok(None);
        };
        let Playback {
            reader, header, chosen, ..
        } = &mut *self.playback;
        let mut reader = reader.take(end.saturating_sub(scanner.read_to()));
        let next = scanner.next_block(&mut reader, header, |column| chosen.contains(&column));
        if !matches!(next, Ok(Some(_)) | Err(Error::Block { .. })) {
            self.scan = None;
        }
        next
    }

    /// Begins to scan a stretch. What is said of missing blocks refers to those after the first one found.
    fn start_scan(&mut self, (start, end): (u64, u64), order: Order) -> Result<(), Error> {
        let sought = self.playback.reader.seek(SeekFrom::Start(start));
        sought.map_err(Error::io("read"))?;
        self.scan = Some((Scanner::new(start, order), end));
        Ok(())
    }

    /// What comes next. A block that is [`Part::Known`] may be passed over.
    pub(crate) fn part(&mut self) -> Result<Option<Part>, Error> {
        if std::mem::take(&mut self.single) {
            let block = self.playback.only(|column| self.playback.chosen.contains(&column))?;
            return Ok(block.map(Part::Found));
        }
        loop {
            let end = self.playback.span.1;
            if self.scan.is_some() {
                if let Some(block) = self.scanned()? {
                    return Ok(Some(Part::Found(block)));
                }
                ensure!(self.playback.index != Index::Missing, Error::block(end, 0, Damage::NoEnd));
            } else if let Some(entry) = self.entries.next() {
                // An entry without rows stands for damaged bytes, whose times are unknown: they are reported for every range.
                if entry.rows == 0 || self.overlaps(entry.ticks) {
                    return Ok(Some(Part::Known(entry)));
                }
            } else if let Index::Whole(segments) = &self.playback.index {
                let Some(segment) = segments.get(self.next_segment).copied() else {
                    return Ok(None);
                };
                self.next_segment += 1;
                if segment.rows == 0 || self.overlaps(segment.ticks) {
                    self.enter(&segment)?;
                }
            } else if std::mem::replace(&mut self.scanned, true) {
                return Ok(None);
            } else {
                self.start_scan(self.playback.span, Order::default())?;
                ensure!(self.playback.index != Index::Other, Error::block(end, 0, Damage::Index));
            }
        }
    }

    /// The block of this part.
    pub(crate) fn block(&mut self, part: Part) -> Result<Block, Error> {
        match part {
            Part::Known(entry) => self.indexed(&entry),
            Part::Found(block) => Ok(block),
        }
    }
}

impl<R: Read + Seek> Iterator for Blocks<'_, R> {
    type Item = Result<Block, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        let part = self.part().transpose()?;
        Some(part.and_then(|part| self.block(part)))
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

impl<'a, R> Rows<'a, R> {
    pub(crate) fn new(blocks: Blocks<'a, R>, chosen: Vec<usize>, ticks: (i64, i64)) -> Self {
        Self {
            blocks,
            chosen,
            ticks,
            block: Block::default(),
            row: 0,
        }
    }
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
