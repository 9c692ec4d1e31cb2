//! From rows to frames.

use super::piece::{PIECE_OVERHEAD, Piece};
use super::{MAX_PIECES, max_rows};
use crate::error::Error;
use crate::header::{Form, Header, MAX_START};
use crate::schema::Schema;
use crate::waiting::Waiting;
use fewbits_block_codec::{ArgumentError, Effort, ensure};

/// Smallest allowed maximal length of a frame: a piece then has 20 bytes of the header.
pub const MIN_FRAME_BYTES: usize = 40;
/// Share of a frame that is aimed at when the number of rows for the next trial is estimated.
const FILLED: f64 = 0.97;
/// Largest number of rows of a frame.
const MAX_ROWS: usize = 512;
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
    /// Number of frames so far, which is that of the next one.
    frames: u64,
}

fn of_no_rows(schema: &Schema) -> Header {
    Header::new(schema.clone(), &[], vec![0.0; schema.columns.len()])
}

impl FrameWriter {
    /// A writer of frames of at most `max_bytes` bytes, and at most the schema's rows per block, 512 rows or 2^17 cells: rows of a signal
    /// that stands still wait no longer.
    ///
    /// # Errors
    /// If `max_bytes` is below [`MIN_FRAME_BYTES`], or the header needs more than 256 pieces.
    pub fn new(mut schema: Schema, max_bytes: usize) -> Result<Self, Error> {
        let columns = schema.columns.len();
        schema.rows_per_block = schema.rows_per_block.min(max_rows(columns)).min(MAX_ROWS);
        // Receivers that print name the times as they like.
        schema.time_name.clear();
        // Origin and step of rows take at most 18 bytes more than those of no rows.
        let header = of_no_rows(&schema).to_bytes().len() + 32 + MAX_START * columns;
        let least = (header.div_ceil(MAX_PIECES) + PIECE_OVERHEAD).max(MIN_FRAME_BYTES);
        ensure!(max_bytes >= least, "max_bytes", max_bytes, format!("at least {least} for this header"));
        Ok(Self {
            header: None,
            max_bytes,
            rows: Waiting::new(columns),
            next_trial: 1,
            frames: 0,
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

    /// The header as at the beginning of a recording, also before the first frame: a stream of no rows is this header.
    pub fn header_at_once(&self) -> Vec<u8> {
        let of_no_rows = || of_no_rows(&self.schema).with_form(Form::Stream).to_bytes();
        self.header().unwrap_or_else(of_no_rows)
    }

    fn sent_header(&self) -> Option<&Header> {
        self.header.as_ref().filter(|_| self.frames > 0)
    }

    /// Frames with the pieces of the header; none before the first frame with rows. They state that all frames so far were sent.
    pub fn header_frames(&self) -> Vec<Vec<u8>> {
        self.header_frames_after(self.frames)
    }

    /// The same, stating that `frames` frames were sent before: a reader then knows how many did not arrive.
    pub fn header_frames_after(&self, frames: u64) -> Vec<Vec<u8>> {
        let Some(header) = self.sent_header() else {
            return Vec::new();
        };
        let bytes = header.to_bytes();
        let pieces = bytes.chunks(self.max_bytes - PIECE_OVERHEAD);
        let last = (pieces.len() - 1) as u8;
        let piece = |(number, bytes)| Piece {
            check: header.check,
            last,
            number,
            frames,
            bytes,
        };
        (0..).zip(pieces).map(piece).map(Piece::to_frame).collect()
    }

    /// Adds one row. Returns the frames that became full. A row that does not fit waits for the next frame.
    ///
    /// # Errors
    /// If the number of cells is not that of the columns, or the row does not fit into a frame by itself.
    pub fn push(&mut self, tick: i64, row: &[Option<f64>]) -> Result<Vec<Vec<u8>>, Error> {
        self.rows.check("row", row.iter().map(|_| 1), 1)?;
        self.rows.extend(&[tick], row.iter().map(std::slice::from_ref));
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
        self.frames += 1;
        self.rows.remove(rows);
        self.next_trial = rows.max(1);
    }

    fn encode(&mut self, rows: usize) -> Result<Vec<u8>, Error> {
        // The first frame: the header's starts follow from all waiting rows.
        if self.frames == 0 {
            let header = self.rows.header(&self.schema).with_starts(&self.rows.columns);
            self.header = Some(header.with_form(Form::Stream));
        }
        let header = self.header.as_ref().ok_or(Error::Broken)?;
        let rows = self.rows.first(rows, header, self.frames, Effort::Thorough);
        Ok(rows.block().0)
    }
}
