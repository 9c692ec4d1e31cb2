//! Frames for a link that may lose, repeat and reorder them. A frame contains one block, or a piece of the header.
//!
//! [`FrameWriter`] converts rows to frames and [`FrameReader`] frames to rows; neither uses a socket or a clock. The reader
//! needs each piece of the header once, in any order; the writer returns the pieces as often as it is asked to. Frames that arrive before
//! the header is complete are kept, up to a limit.
//!
//! ```text
//! frame    := block | piece
//! piece    := 0, kind `H`, length varint, content, CRC-32 of 0, 0, 0, 0 and all of it
//! content  := header's checksum (4 bytes), number of pieces - 1, number of this piece, bytes
//! ```

use crate::block::{self, Block, Cells};
use crate::error::{Damage, Error};
use crate::header::{Form, Header, MAX_START};
use crate::header_read::Known;
use crate::schema::Schema;
use crate::waiting::Waiting;
use crate::wire::{Bytes, read_checked};
use fewbits_block_codec::ArgumentError;
use fewbits_block_codec::Effort;
use std::collections::VecDeque;

/// Smallest allowed maximal length of a frame: a piece then has 26 bytes of the header.
pub const MIN_FRAME_BYTES: usize = 40;
/// Bytes of a piece in addition to its part of the header.
const PIECE_OVERHEAD: usize = 14;
const PIECE: u8 = b'H';
const MAX_PIECES: usize = 256;
/// Largest number of rows of a frame.
const MAX_ROWS: usize = 512;
/// Largest number of frames that are kept while the header is incomplete.
const MAX_WAITING: usize = 256;
/// Share of a frame that is aimed at when the number of rows for the next trial is estimated.
const FILLED: f64 = 0.97;
/// A frame that is at least this full is returned.
const FULL: f64 = 0.93;

/// Converts rows to frames that are as full as possible.
#[derive(Debug)]
pub struct FrameWriter {
    schema: Schema,
    header: Option<Header>,
    max_bytes: usize,
    /// Rows that are not in a frame yet.
    rows: Waiting,
    /// Number of rows at which it is next tried whether they fill a frame.
    next_trial: usize,
    has_sent: bool,
    /// Number of the next frame.
    next_number: u64,
}

impl FrameWriter {
    /// A writer of frames of at most `max_bytes` bytes, and at most the schema's rows per block or 512, whichever are fewer: rows of a
    /// signal that stands still wait no longer.
    ///
    /// # Errors
    /// If `max_bytes` is below [`MIN_FRAME_BYTES`], or the header needs more than 256 pieces.
    pub fn new(schema: Schema, max_bytes: usize) -> Result<Self, Error> {
        let columns = schema.columns.len();
        // Origin and step of rows take at most 18 bytes more than those of no rows.
        let header = Header::new(schema.clone(), &[], vec![0.0; columns]).to_bytes().len() + 32 + MAX_START * columns;
        let least = (header.div_ceil(MAX_PIECES) + PIECE_OVERHEAD).max(MIN_FRAME_BYTES);
        if max_bytes < least {
            return Err(ArgumentError::new("max_bytes", max_bytes, format!("at least {least} for this header")).into());
        }
        let rows = schema.rows_per_block().min(MAX_ROWS);
        let schema = schema.with_exact_rows(rows)?;
        Ok(Self {
            header: None,
            max_bytes,
            rows: Waiting::new(columns),
            next_trial: 1,
            has_sent: false,
            next_number: 0,
            schema,
        })
    }

    /// Number of rows that are not in a frame yet.
    pub fn waiting(&self) -> usize {
        self.rows.ticks.len()
    }

    /// The header as at the beginning of a recording, for links without losses; `None` before the first frame.
    pub fn header(&self) -> Option<Vec<u8>> {
        self.sent_header().map(Header::to_bytes)
    }

    fn sent_header(&self) -> Option<&Header> {
        self.header.as_ref().filter(|_| self.has_sent)
    }

    /// Frames with the pieces of the header; none before the first frame with rows.
    pub fn header_frames(&self) -> Vec<Vec<u8>> {
        let Some(header) = self.sent_header() else {
            return Vec::new();
        };
        let bytes = header.to_bytes();
        let room = self.max_bytes - PIECE_OVERHEAD;
        let pieces = bytes.chunks(room);
        let last = (pieces.len() - 1) as u8;
        let frame = |(i, piece): (usize, &[u8])| {
            let mut content = header.check.to_le_bytes().to_vec();
            content.extend([last, i as u8]);
            content.extend_from_slice(piece);
            crate::index::special(0, PIECE, &content)
        };
        pieces.enumerate().map(frame).collect()
    }

    /// Adds one row. Returns the frames that became full. A row that does not fit waits for the next frame.
    ///
    /// # Errors
    /// If the number of cells is not that of the columns, or the row does not fit into a frame by itself.
    pub fn push(&mut self, tick: i64, row: &[Option<f64>]) -> Result<Vec<Vec<u8>>, Error> {
        self.rows.push(tick, row)?;
        self.frames(false)
    }

    /// Frames of all waiting rows, even if they are not full.
    ///
    /// # Errors
    /// If a row does not fit into a frame by itself.
    pub fn flush(&mut self) -> Result<Vec<Vec<u8>>, Error> {
        self.frames(true)
    }

    /// The frames that are full, or frames of all rows. Encoding takes the most time, so a frame that is not full is tried again only
    /// when it probably is.
    fn frames(&mut self, all: bool) -> Result<Vec<Vec<u8>>, Error> {
        let (limit, mut frames) = (self.schema.rows_per_block, Vec::new());
        while self.waiting() > 0 && (all || self.waiting() >= self.next_trial.min(limit)) {
            let rows = self.waiting().min(limit);
            let bytes = self.encode(rows)?;
            if bytes.len() > self.max_bytes {
                frames.push(self.largest(rows, bytes.len())?);
            } else if all || rows == limit {
                frames.push(bytes);
                self.forget(rows);
            } else {
                let guess = rows as f64 * FILLED * self.max_bytes as f64 / bytes.len() as f64;
                self.next_trial = (guess as usize).max(rows + 1);
                break;
            }
        }
        Ok(frames)
    }

    /// A nearly full frame of the first rows, fewer than `too_many`, and removes those rows.
    ///
    /// The number of bytes is nearly proportional to that of rows, so the next trial follows from the last one by proportion.
    fn largest(&mut self, too_many: usize, bytes_of_too_many: usize) -> Result<Vec<u8>, Error> {
        let (mut fits, mut too_many, mut best) = (0, too_many, None::<Vec<u8>>);
        let mut proportion = self.max_bytes as f64 / bytes_of_too_many as f64;
        while too_many - fits > 1 {
            let guess = (FILLED * proportion * too_many as f64) as usize;
            let rows = guess.clamp(fits + 1, too_many - 1);
            let bytes = self.encode(rows)?;
            let filled = bytes.len() as f64 / self.max_bytes as f64;
            if filled <= 1.0 {
                (fits, best) = (rows, Some(bytes));
                if filled >= FULL {
                    break;
                }
                // Try half-way to the number of rows that do not fit.
                proportion = 0.5 * (1.0 + rows as f64 / too_many as f64) / FILLED;
            } else {
                too_many = rows;
                proportion = 1.0 / filled;
            }
        }
        let Some(frame) = best else {
            let expected = "enough for one row: allow longer frames, wider bounds or fewer columns";
            return Err(ArgumentError::new("max_bytes", self.max_bytes, expected).into());
        };
        self.forget(fits);
        Ok(frame)
    }

    fn forget(&mut self, rows: usize) {
        self.has_sent = true;
        self.next_number += 1;
        self.rows.remove(rows);
        self.next_trial = rows.max(1);
    }

    fn encode(&mut self, rows: usize) -> Result<Vec<u8>, Error> {
        // The first frame: the header's starts follow from all waiting rows.
        if !self.has_sent {
            self.header = Some(
                self.rows
                    .header(&self.schema)
                    .with_starts(&self.rows.columns)
                    .with_form(Form::Stream),
            );
        }
        let Some(header) = &self.header else {
            return Err(Error::Broken);
        };
        let Waiting { ticks, columns, ranges } = &self.rows;
        let own = ranges.own_bounds(header);
        let cells: Vec<Cells> = columns.iter().map(|cells| cells[..rows].to_vec()).collect();
        Ok(block::encode(header, self.next_number, &ticks[..rows], &cells, &own, Effort::Thorough).0)
    }
}

/// Converts frames to rows. Any bytes give rows, nothing, or an error.
#[derive(Debug, Default)]
pub struct FrameReader {
    header: Option<Header>,
    /// The incomplete header: its checksum and pieces.
    pieces: Option<(u32, Vec<Option<Vec<u8>>>)>,
    waiting: VecDeque<Vec<u8>>,
}

impl FrameReader {
    /// A reader without header.
    pub fn new() -> Self {
        Self::default()
    }

    /// The schema of the sender; `None` until the header is complete.
    pub fn schema(&self) -> Option<&Schema> {
        self.header.as_ref().map(|header| &header.schema)
    }

    /// Processes one received frame. Returns the blocks that became readable: its own, or, with the last piece of the header, those that
    /// arrived before.
    ///
    /// # Errors
    /// If the frame is damaged or belongs to another header. The reader is then unchanged.
    pub fn handle(&mut self, frame: &[u8]) -> Result<Vec<Block>, Error> {
        let damaged = |damage| Error::Block {
            offset: 0,
            bytes: frame.len() as u64,
            damage,
        };
        if frame.first() == Some(&0) {
            return self.piece(frame).map_err(damaged);
        }
        let Some(header) = &self.header else {
            // The oldest is dropped: the memory is bounded, also if the header never comes.
            if self.waiting.len() == MAX_WAITING {
                self.waiting.pop_front();
            }
            self.waiting.push_back(frame.to_vec());
            return Ok(Vec::new());
        };
        Ok(vec![read_block(header, frame).map_err(damaged)?])
    }

    fn piece(&mut self, frame: &[u8]) -> Result<Vec<Block>, Damage> {
        if frame.get(1) != Some(&PIECE) {
            return Err(Damage::NoBlock);
        }
        // The receiver of a piece has no header yet, so the checksum covers zeros in place of the header's.
        let (content, whole) = read_checked(0, frame, 2, 0..=frame.len())?;
        if whole != frame.len() {
            return Err(Damage::Content("length"));
        }
        let mut content = Bytes(content);
        let check = u32::from_le_bytes(content.array()?);
        let [last, number] = content.array()?;
        if number > last {
            return Err(Damage::Content("number of a piece"));
        }
        if self.header.as_ref().is_some_and(|header| header.check == check) {
            return Ok(Vec::new());
        }
        let count = usize::from(last) + 1;
        // Pieces of another header replace those before: its sender has started anew.
        let known = self
            .pieces
            .take()
            .filter(|(known, pieces)| *known == check && pieces.len() == count);
        let (_, mut pieces) = known.unwrap_or_else(|| (check, vec![None; count]));
        pieces[usize::from(number)] = Some(content.0.to_vec());
        if pieces.iter().any(Option::is_none) {
            self.pieces = Some((check, pieces));
            return Ok(Vec::new());
        }
        let bytes: Vec<u8> = pieces.into_iter().flatten().flatten().collect();
        let header = match Header::read(&bytes) {
            Ok(Known::Header(header, length)) if length == bytes.len() && header.check == check => *header,
            _ => return Err(Damage::Content("header")),
        };
        let waiting = std::mem::take(&mut self.waiting);
        let blocks = waiting
            .iter()
            .filter_map(|frame| read_block(&header, frame).ok())
            .collect();
        self.header = Some(header);
        Ok(blocks)
    }
}

fn read_block(header: &Header, frame: &[u8]) -> Result<Block, Damage> {
    if block::length(header, frame)? != frame.len() {
        return Err(Damage::Content("length"));
    }
    block::decode(header, frame, |_| true)
}
