//! Sequential reading of blocks without an index: files that were not finished, pipes, collected frames.

use crate::block::{self, Block};
use crate::error::{Damage, Error};
use crate::header::{Header, MAX_HEADER};
use crate::index::{self, TRAILER_BYTES};
use crate::schema::Schema;
use std::io::Read;

/// Number of bytes requested at once.
const CHUNK: usize = 1 << 16;

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

/// Finds complete records and skips damaged bytes.
pub(crate) struct Scanner<R> {
    reader: R,
    buffer: Vec<u8>,
    /// Position of the next record in the buffer.
    position: usize,
    /// Offset of the buffer's first byte.
    offset: u64,
    ended: bool,
    /// Position of the last record found.
    current: usize,
    pending: Option<Found>,
}

impl<R: Read> Scanner<R> {
    pub(crate) fn new(reader: R, offset: u64) -> Self {
        Self {
            reader,
            buffer: Vec::new(),
            position: 0,
            offset,
            ended: false,
            current: 0,
            pending: None,
        }
    }

    /// Reads one more chunk and drops consumed bytes.
    fn fill(&mut self) -> Result<(), Error> {
        self.buffer.drain(..self.position);
        self.offset += self.position as u64;
        self.position = 0;
        let before = self.buffer.len();
        self.buffer.resize(before + CHUNK, 0);
        let outcome = self.reader.read(&mut self.buffer[before..]);
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

    pub(crate) fn header(&mut self) -> Result<Header, Error> {
        loop {
            if let Some((header, length)) = Header::read(&self.buffer)? {
                self.position = length;
                return Ok(header);
            }
            if self.ended || self.buffer.len() > MAX_HEADER + CHUNK {
                return Err(if self.buffer.is_empty() {
                    Error::NotARecording
                } else {
                    Error::Header(Damage::CutOff)
                });
            }
            self.fill()?;
        }
    }

    /// Bytes consumed so far, from the beginning of the recording.
    pub(crate) fn consumed(&self) -> u64 {
        self.offset + self.position as u64
    }

    /// The bytes of the last record found.
    pub(crate) fn bytes(&self, found: &Found) -> &[u8] {
        &self.buffer[self.current..self.current + found.length]
    }

    fn record_at(&self, header: &Header, at: usize) -> Result<(Kind, usize), Damage> {
        let bytes = &self.buffer[at..];
        match bytes.first() {
            None => Err(Damage::CutOff),
            Some(0) => {
                let (kind, _, length) = index::read_special(header, bytes)?;
                match kind {
                    index::SEGMENT => Ok((Kind::Segment, length)),
                    index::FOOTER | index::ONLY if bytes.len() < length + TRAILER_BYTES => Err(Damage::CutOff),
                    index::FOOTER | index::ONLY => Ok((Kind::Footer, length + TRAILER_BYTES)),
                    _ => Err(Damage::NoBlock),
                }
            }
            Some(_) => block::length(header, bytes).map(|length| (Kind::Block, length)),
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
    pub(crate) fn next(&mut self, header: &Header) -> Result<Option<Found>, Error> {
        if let Some(found) = self.pending.take() {
            return Ok(Some(found));
        }
        let mut first = None;
        let start = self.consumed();
        loop {
            match self.record_at(header, self.position) {
                Ok((kind, length)) => {
                    let found = self.found(kind, length);
                    let Some(damage) = first else { return Ok(Some(found)) };
                    // The damage is reported first, and the record after it by the next call.
                    self.pending = Some(found);
                    return Err(Error::Block {
                        offset: start,
                        bytes: found.offset - start,
                        damage,
                    });
                }
                Err(Damage::CutOff) if !self.ended => self.fill()?,
                Err(_) if self.position == self.buffer.len() => {
                    let Some(damage) = first else { return Ok(None) };
                    return Err(Error::Block {
                        offset: start,
                        bytes: self.consumed() - start,
                        damage,
                    });
                }
                Err(damage) => {
                    // Try the next byte. Bytes that are no record pass for one with probability 2^-32, by the checksum.
                    first.get_or_insert(damage);
                    self.position += 1;
                }
            }
        }
    }
}

/// Iterator over the blocks of a recording from any source of bytes, from front to end.
pub struct BlockReader<R> {
    scanner: Scanner<R>,
    header: Header,
}

impl<R: Read> BlockReader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// If reading fails, or the source does not begin with a complete header of this version.
    pub fn new(reader: R) -> Result<Self, Error> {
        let mut scanner = Scanner::new(reader, 0);
        let header = scanner.header()?;
        Ok(Self { scanner, header })
    }

    /// Columns and time of the recording.
    pub fn schema(&self) -> &Schema {
        &self.header.schema
    }
}

/// An error about damaged bytes does not end the iteration: the next item is the first complete block after them.
impl<R: Read> Iterator for BlockReader<R> {
    type Item = Result<Block, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let found = match self.scanner.next(&self.header) {
                Ok(found) => found?,
                Err(error) => return Some(Err(error)),
            };
            if found.kind == Kind::Block {
                return Some(decoded(&self.header, &self.scanner, &found, |_| true));
            }
        }
    }
}

/// Decodes a block that the scanner found.
pub(crate) fn decoded<R: Read>(
    header: &Header,
    scanner: &Scanner<R>,
    found: &Found,
    wanted: impl Fn(usize) -> bool,
) -> Result<Block, Error> {
    block::decode(header, scanner.bytes(found), wanted).map_err(|damage| Error::Block {
        offset: found.offset,
        bytes: found.length as u64,
        damage,
    })
}
