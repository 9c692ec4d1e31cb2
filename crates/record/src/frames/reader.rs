//! From frames to rows.

use super::max_rows;
use super::piece::Piece;
use crate::block::{self, Block};
use crate::error::{Damage, Error, ensure};
use crate::header::{Header, MAX_HEADER};
use crate::header_bytes::Known;
use crate::schema::Schema;
use std::collections::{HashSet, VecDeque};
use std::hash::{BuildHasher, RandomState};

/// Largest number of bytes of frames that are kept while the header is incomplete, and bytes that a kept frame counts in addition.
const MAX_WAITING: usize = 1 << 22;
const WAITING_OVERHEAD: usize = 64;
/// Largest number of headers of which pieces are collected at once.
const MAX_INCOMPLETE: usize = 8;
/// Number of frames of which it is known that they arrived before.
const REMEMBERED: usize = 1 << 16;

/// Pieces of a header that is not complete.
#[derive(Debug)]
struct Incomplete {
    check: u32,
    pieces: Vec<Option<Vec<u8>>>,
    frames: u64,
}

/// Hashes of the last frames. Who does not know the key of the hash can make no frame that looks like another one.
#[derive(Debug, Default)]
struct Seen {
    key: RandomState,
    hashes: HashSet<u64>,
    order: VecDeque<u64>,
}

impl Seen {
    /// Whether this is the first time.
    fn is_new(&mut self, frame: &[u8]) -> bool {
        let hash = self.key.hash_one(frame);
        if !self.hashes.insert(hash) {
            return false;
        }
        self.order.push_back(hash);
        if self.order.len() > REMEMBERED
            && let Some(oldest) = self.order.pop_front()
        {
            self.hashes.remove(&oldest);
        }
        true
    }
}

/// Converts the frames of one table to rows. Any bytes give rows, nothing, or an error.
///
/// The first header that becomes complete is that of the table. Frames with another one, of a sender that started anew or of another
/// sender, are refused.
#[derive(Debug, Default)]
pub struct FrameReader {
    header: Option<Header>,
    incomplete: Vec<Incomplete>,
    waiting: VecDeque<Vec<u8>>,
    waiting_bytes: usize,
    seen: Seen,
    /// Number of different frames with rows.
    received: u64,
    repeated: u64,
    /// Largest number of frames that a piece has stated.
    sent: u64,
    /// Number of different frames with rows since that piece.
    behind: u64,
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

    /// Number of different frames whose rows were returned.
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Number of frames that arrived again. At most the last 65,536 frames are recognised.
    pub fn repeated(&self) -> u64 {
        self.repeated
    }

    /// Number of frames that were sent but have not arrived, as of the last piece of the header.
    pub fn missing(&self) -> u64 {
        self.sent.saturating_sub(self.received)
    }

    /// Number of frames that arrived behind the last piece of the header that stated a larger number of them. What is missing among these is not
    /// counted; a sender that ends states their number at last.
    pub fn uncounted(&self) -> u64 {
        self.behind
    }

    /// Number of frames that wait for the header.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Number of pieces that have arrived, and of all, of the header of which most have arrived; `None` if there is none.
    pub fn pieces(&self) -> Option<(usize, usize)> {
        let count = |i: &Incomplete| (i.pieces.iter().flatten().count(), i.pieces.len());
        self.incomplete.iter().map(count).max()
    }

    /// Processes one received frame. Returns the blocks that became readable: its own, or, with the last piece of the header, those that
    /// arrived before. A frame that was processed before gives nothing.
    ///
    /// # Errors
    /// [`Error::OtherTable`] if the frame is a piece of another header; if it is damaged, or, which looks the same, a block of another
    /// header. The reader is then unchanged.
    pub fn handle(&mut self, frame: &[u8]) -> Result<Vec<Block>, Error> {
        let damaged = |damage| Error::block(0, frame.len() as u64, damage);
        if Piece::is_one(frame) {
            let piece = Piece::of_frame(frame).map_err(damaged)?;
            return match &self.header {
                Some(header) if header.check != piece.check => Err(Error::OtherTable),
                Some(_) => {
                    if piece.frames >= self.sent {
                        (self.sent, self.behind) = (piece.frames, 0);
                    }
                    Ok(Vec::new())
                }
                None => self.piece(piece).map_err(damaged),
            };
        }
        let Some(header) = &self.header else {
            self.keep(frame);
            return Ok(Vec::new());
        };
        let block = read_block(header, frame).map_err(damaged)?;
        Ok(self.first_time(frame).then_some(block).into_iter().collect())
    }

    /// Counts a frame that belongs to the table. Returns whether it is new.
    fn first_time(&mut self, frame: &[u8]) -> bool {
        let is_new = self.seen.is_new(frame);
        *if is_new { &mut self.received } else { &mut self.repeated } += 1;
        self.behind += u64::from(is_new);
        is_new
    }

    /// Keeps a frame until the header is complete. The oldest are dropped: the memory is bounded, also if the header never comes.
    fn keep(&mut self, frame: &[u8]) {
        self.waiting_bytes += frame.len() + WAITING_OVERHEAD;
        self.waiting.push_back(frame.to_vec());
        while self.waiting_bytes > MAX_WAITING {
            let Some(oldest) = self.waiting.pop_front() else { break };
            self.waiting_bytes -= oldest.len() + WAITING_OVERHEAD;
        }
    }

    fn piece(&mut self, piece: Piece<'_>) -> Result<Vec<Block>, Damage> {
        let count = usize::from(piece.last) + 1;
        let is_known = |i: &Incomplete| i.check == piece.check && i.pieces.len() == count;
        let known = self.incomplete.iter().position(is_known);
        let new = || Incomplete {
            check: piece.check,
            pieces: vec![None; count],
            frames: 0,
        };
        let mut incomplete = known.map_or_else(new, |at| self.incomplete.remove(at));
        incomplete.frames = incomplete.frames.max(piece.frames);
        incomplete.pieces[usize::from(piece.number)] = Some(piece.bytes.to_vec());
        let bytes: usize = incomplete.pieces.iter().flatten().map(Vec::len).sum();
        ensure!(bytes <= MAX_HEADER, Damage::Content("length of the header"));
        if incomplete.pieces.iter().any(Option::is_none) {
            if self.incomplete.len() == MAX_INCOMPLETE {
                self.incomplete.remove(0);
            }
            self.incomplete.push(incomplete);
            return Ok(Vec::new());
        }
        let bytes: Vec<u8> = incomplete.pieces.into_iter().flatten().flatten().collect();
        let header = match Header::read(&bytes) {
            Ok(Known::Header(header)) if header.length == bytes.len() && header.check == piece.check => *header,
            _ => return Err(Damage::Content("header")),
        };
        let most = max_rows(header.schema.columns.len());
        ensure!(header.schema.rows_per_block <= most, Damage::Content("rows per frame"));
        self.sent = incomplete.frames;
        self.incomplete.clear();
        self.waiting_bytes = 0;
        let mut blocks = Vec::new();
        for frame in std::mem::take(&mut self.waiting) {
            if let Ok(block) = read_block(&header, &frame)
                && self.first_time(&frame)
            {
                blocks.push(block);
            }
        }
        self.behind = 0;
        self.header = Some(header);
        Ok(blocks)
    }
}

fn read_block(header: &Header, frame: &[u8]) -> Result<Block, Damage> {
    ensure!(block::length(header, frame, |bytes| header.sum(bytes))? == frame.len(), Damage::Content("length"));
    block::decode(header, frame, |_| true)
}
