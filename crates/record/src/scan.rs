//! Sequential reading of blocks without an index: files that were not finished, pipes, collected frames.

use crate::block::{self, Block};
use crate::error::{Damage, Error, ensure};
use crate::header::{Header, MAX_HEADER};
use crate::header_bytes::Known;
use crate::index::{self, TRAILER_BYTES};
use crate::rolling::Prefixes;
use crate::schema::{MAX_CELLS, Schema};
use crate::wire::checksum;
use std::io::Read;

/// Number of bytes requested at once.
const CHUNK: usize = 1 << 16;
/// Largest length of a recording of a single block: what a block of any schema can take.
const MAX_SINGLE: usize = MAX_HEADER + 32 * MAX_CELLS;

/// Kind of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Block,
    Segment,
    Footer,
}

/// A complete record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Found {
    pub(crate) kind: Kind,
    pub(crate) offset: u64,
    pub(crate) length: usize,
}

impl Found {
    /// Damage of this record.
    pub(crate) fn damaged(&self, damage: Damage) -> Error {
        Error::block(self.offset, self.length as u64, damage)
    }
}

/// Finds complete records and skips damaged bytes. The reader is handed in at each call, always the same one.
#[derive(Debug, Default)]
pub(crate) struct Scanner {
    buffer: Vec<u8>,
    /// Position of the next record in the buffer.
    position: usize,
    /// Offset of the buffer's first byte.
    offset: u64,
    ended: bool,
    /// Position of the last record found.
    current: usize,
    pending: Option<Found>,
    /// The order of blocks.
    order: Order,
    /// Whether the last record found is the end of a recording.
    has_end: bool,
    /// Checksums of the buffer's prefixes, while a record is searched for.
    prefixes: Prefixes,
}

impl Scanner {
    /// A scanner of a reader whose first byte has this offset, where blocks follow in this order.
    pub(crate) fn new(offset: u64, order: Order) -> Self {
        Self {
            offset,
            order,
            ..Self::default()
        }
    }

    /// Reads one more chunk.
    fn fill(&mut self, reader: &mut impl Read) -> Result<(), Error> {
        // Consumed bytes are dropped when they are the larger part, so that each byte is moved once in the mean.
        if 2 * self.position >= self.buffer.len() {
            self.buffer.drain(..self.position);
            self.prefixes.forget(self.position);
            self.offset += self.position as u64;
            self.position = 0;
        }
        let before = self.buffer.len();
        self.buffer.resize(before + CHUNK, 0);
        let outcome = reader.read(&mut self.buffer[before..]);
        let read = match outcome {
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => 0,
            Err(error) => {
                self.buffer.truncate(before);
                return Err(Error::io("read")(error));
            }
            Ok(read) => {
                self.ended = read == 0;
                read
            }
        };
        self.buffer.truncate(before + read);
        Ok(())
    }

    /// The header, and the content of the block if it is the only one.
    pub(crate) fn header(&mut self, reader: &mut impl Read) -> Result<(Header, Option<Vec<u8>>), Error> {
        loop {
            match Header::read(&self.buffer)? {
                Known::Header(header) => {
                    self.position = header.length;
                    return Ok((*header, None));
                }
                Known::Single if self.ended => {
                    let (header, content) = Header::read_single(&self.buffer)?;
                    self.position = self.buffer.len();
                    return Ok((header, Some(content.to_vec())));
                }
                Known::Single if self.buffer.len() > MAX_SINGLE => return Err(Error::Header(Damage::NoBlock)),
                Known::Single => {}
                Known::More if self.ended || self.buffer.len() > MAX_HEADER + CHUNK => {
                    return Err(if self.buffer.is_empty() {
                        Error::NotARecording
                    } else {
                        Error::Header(Damage::CutOff)
                    });
                }
                Known::More => {}
            }
            self.fill(reader)?;
        }
    }

    /// Bytes consumed so far, from the beginning of the recording.
    pub(crate) fn consumed(&self) -> u64 {
        self.offset + self.position as u64
    }

    /// Offset of the first byte that was not requested yet.
    pub(crate) fn read_to(&self) -> u64 {
        self.offset + self.buffer.len() as u64
    }

    /// The bytes of the last record found.
    pub(crate) fn bytes(&self, found: &Found) -> &[u8] {
        &self.buffer[self.current..self.current + found.length]
    }

    /// Kind and length of the record that begins here. Where the prefixes are known, in time that does not depend on its length.
    fn record_at(&self, header: &Header, at: usize) -> Result<(Kind, usize), Damage> {
        let bytes = &self.buffer[at..];
        let sum = |bytes: &[u8]| {
            let before = checksum(&[&header.check.to_le_bytes()]);
            let known = self.prefixes.checksum(before, at, at + bytes.len());
            known.unwrap_or_else(|| header.sum(bytes))
        };
        match bytes.first() {
            None => Err(Damage::CutOff),
            Some(0) => {
                let (kind, _, length) = index::read_special(header, bytes, sum)?;
                match kind {
                    index::SEGMENT => Ok((Kind::Segment, length)),
                    index::FOOTER | index::ONLY if bytes.len() < length + TRAILER_BYTES => Err(Damage::CutOff),
                    index::FOOTER | index::ONLY => Ok((Kind::Footer, length + TRAILER_BYTES)),
                    _ => Err(Damage::NoBlock),
                }
            }
            Some(_) => block::length(header, bytes, sum).map(|length| (Kind::Block, length)),
        }
    }

    fn found(&mut self, kind: Kind, length: usize) -> Found {
        self.current = self.position;
        self.position += length;
        Found {
            kind,
            offset: self.offset + self.current as u64,
            length,
        }
    }

    /// The next complete record; `None` at the end.
    ///
    /// # Errors
    /// If reading fails, or bytes are damaged. After damage the next call continues behind it.
    pub(crate) fn next(&mut self, reader: &mut impl Read, header: &Header) -> Result<Option<Found>, Error> {
        if let Some(found) = self.pending.take() {
            return Ok(Some(found));
        }
        let mut first = None;
        let start = self.consumed();
        self.prefixes.clear();
        loop {
            if first.is_some() {
                self.prefixes.extend(&self.buffer);
            }
            match self.record_at(header, self.position) {
                Ok((kind, length)) => {
                    let found = self.found(kind, length);
                    let Some(damage) = first else { return Ok(Some(found)) };
                    // The damage is reported first, and the record after it by the next call.
                    self.pending = Some(found);
                    return Err(Error::block(start, found.offset - start, damage));
                }
                Err(Damage::CutOff) if !self.ended => self.fill(reader)?,
                Err(_) if self.position == self.buffer.len() => {
                    let Some(damage) = first else { return Ok(None) };
                    return Err(Error::block(start, self.consumed() - start, damage));
                }
                Err(damage) => {
                    // Try the next byte. Bytes that are no record pass for one with probability 2^-32, by the checksum.
                    first.get_or_insert(damage);
                    self.position += 1;
                }
            }
        }
    }

    /// The next block in its place; `None` at the end. Damaged bytes, and blocks that are missing or out of their place, give an error each.
    pub(crate) fn next_block(
        &mut self,
        reader: &mut impl Read,
        header: &Header,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Option<Block>, Error> {
        loop {
            let Some(found) = self.next(reader, header)? else {
                return Ok(None);
            };
            self.has_end = found.kind == Kind::Footer;
            if found.kind != Kind::Block {
                continue;
            }
            let block = self.decoded(header, &found, &wanted)?;
            return match self.order.judge(block.number) {
                Ok(()) => Ok(Some(block)),
                Err(Damage::Missing) => {
                    // This is reported first, and the block by the next call.
                    self.pending = Some(found);
                    Err(Error::block(found.offset, 0, Damage::Missing))
                }
                Err(damage) => Err(found.damaged(damage)),
            };
        }
    }

    /// Decodes the last block found.
    pub(crate) fn decoded(
        &self,
        header: &Header,
        found: &Found,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Block, Error> {
        let block = block::decode(header, self.bytes(found), wanted);
        block.map_err(|damage| found.damaged(damage))
    }
}

/// The order of blocks: which number comes next; `None` before the first block of a stretch whose place is not known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Order(Option<u64>);

impl Default for Order {
    /// The order from the first block of a recording on.
    fn default() -> Self {
        Self(Some(0))
    }
}

impl Order {
    /// The order after the block of this number; any block may come first if none is known.
    pub(crate) fn after(number: Option<u64>) -> Self {
        Self(number.map(|number| number.saturating_add(1)))
    }

    /// Judges the next block: [`Damage::Missing`] once if others should stand before it, [`Damage::Misplaced`] if it must not be read.
    pub(crate) fn judge(&mut self, number: Option<u64>) -> Result<(), Damage> {
        let Some(number) = number else { return Ok(()) };
        let expected = self.0.unwrap_or(number);
        ensure!(number >= expected, Damage::Misplaced);
        self.0 = Some(number.saturating_add(u64::from(number == expected)));
        ensure!(number == expected, Damage::Missing);
        Ok(())
    }
}

/// Iterator over the blocks of a recording from any source of bytes, from front to end.
pub struct BlockReader<R> {
    reader: R,
    scanner: Scanner,
    header: Header,
    single: Option<Vec<u8>>,
    told_end: bool,
}

impl<R: Read> BlockReader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// If reading fails, or the source does not begin with a complete header of a version that is known.
    pub fn new(mut reader: R) -> Result<Self, Error> {
        let mut scanner = Scanner::default();
        let (header, single) = scanner.header(&mut reader)?;
        Ok(Self {
            reader,
            scanner,
            header,
            single,
            told_end: false,
        })
    }

    /// Columns and time of the recording.
    pub fn schema(&self) -> &Schema {
        &self.header.schema
    }

    /// The next block; at the end an error once if there should be one and is none.
    fn block(&mut self) -> Result<Option<Block>, Error> {
        if let Some(content) = self.single.take() {
            return block::only(&self.header, &content, self.scanner.consumed(), |_| true).map(Some);
        }
        let found = self.scanner.next_block(&mut self.reader, &self.header, |_| true)?;
        if found.is_none() && !self.scanner.has_end && self.header.has_end() {
            let is_told = std::mem::replace(&mut self.told_end, true);
            ensure!(is_told, Error::block(self.scanner.consumed(), 0, Damage::NoEnd));
        }
        Ok(found)
    }
}

/// An error about damaged bytes does not end the iteration: the next item is the first complete block after them. The last item of a
/// recording without its end is an error that says so.
impl<R: Read> Iterator for BlockReader<R> {
    type Item = Result<Block, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.block().transpose()
    }
}
