//! Writing recordings.

use crate::block::{self, Cells};
use crate::bound::Bound;
use crate::error::Error;
use crate::header::{Header, rounded_down};
use crate::index::{self, BLOCKS_PER_SEGMENT, Entry, Segment};
use crate::resume;
use crate::schema::{Schema, TimeBase};
use fewbits_adaptive::Effort;
use fewbits_numerics::ArgumentError;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// A share's bound in a block is written when it is larger than the header's by this factor.
const WIDER: f64 = 1.25;

/// A bound not above `share * range`; 0 where the range is none or overflows.
pub(crate) fn share_of(share: f64, range: f64) -> f64 {
    // The product may be rounded up; a bound must not be.
    let bound = (share * range).next_down().max(0.0);
    if (2.0 * bound).is_finite() { bound } else { 0.0 }
}

/// The bound that a block states itself, if the header's is much smaller.
pub(crate) fn own_bound(bound: f64, of_header: f64) -> Option<f64> {
    let bound = rounded_down(bound);
    (bound > WIDER * of_header).then_some(bound)
}

/// Whether a new header says what the blocks begin with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Starts {
    None,
    Learned,
}

/// Writes rows in blocks.
///
/// The header is written with the first block, since the first rows tell the spacing of time and the range that shares refer to.
/// Each block is written whole, by one call, and never touched again: after a crash at any byte all blocks before it are read.
/// Memory: the rows of one block, 1024 entries of the index, and 40 bytes for every 1024 blocks.
#[derive(Debug)]
pub struct Recorder<W> {
    writer: W,
    schema: Schema,
    header: Option<Header>,
    ticks: Vec<i64>,
    columns: Vec<Cells>,
    /// Ends of each column's finite values so far.
    ends: Vec<Option<(f64, f64)>>,
    next_tick: i64,
    /// Bytes written.
    offset: u64,
    /// Where the blocks of the segment begin that is being filled.
    segment_start: u64,
    entries: Vec<Entry>,
    segments: Vec<Segment>,
    effort: Effort,
    broken: bool,
}

/// The state of a recording that is to be continued.
pub(crate) struct Resumed {
    pub(crate) header: Header,
    pub(crate) offset: u64,
    pub(crate) segments: Vec<Segment>,
    pub(crate) entries: Vec<Entry>,
    pub(crate) next_tick: i64,
}

impl Recorder<File> {
    /// A new file; one that exists is replaced.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: impl AsRef<Path>, schema: Schema) -> Result<Self, Error> {
        let file = File::create(path).map_err(Error::io("create"))?;
        Ok(Self::new(file, schema))
    }

    /// Goes on with a recording, finished or not: cuts off the index, or what a crash left behind the last whole block.
    ///
    /// # Errors
    /// If the file cannot be opened, read or cut, or its header is not whole.
    pub fn resume(path: impl AsRef<Path>) -> Result<Self, Error> {
        let (file, resumed) = resume::open(path.as_ref())?;
        let mut recorder = Self::new(file, resumed.header.schema.clone());
        recorder.header = Some(resumed.header);
        recorder.next_tick = resumed.next_tick;
        recorder.offset = resumed.offset;
        recorder.segment_start = resumed.segments.last().map_or_else(
            || {
                recorder
                    .header
                    .as_ref()
                    .map_or(0, |header| header.to_bytes().len() as u64)
            },
            Segment::end,
        );
        recorder.segments = resumed.segments;
        recorder.entries = resumed.entries;
        Ok(recorder)
    }

    /// Writes the rows so far as a block, however few, and waits until the device has them.
    ///
    /// # Errors
    /// If writing fails.
    pub fn sync(&mut self) -> Result<(), Error> {
        self.flush()?;
        self.writer.sync_data().map_err(Error::io("write"))
    }
}

impl<W: Write> Recorder<W> {
    /// A recording into any sink. Blocks are written by one call each, so no buffer is needed.
    pub fn new(writer: W, schema: Schema) -> Self {
        let columns = schema.columns.len();
        Self {
            writer,
            schema,
            header: None,
            ticks: Vec::new(),
            columns: vec![Vec::new(); columns],
            ends: vec![None; columns],
            next_tick: 0,
            offset: 0,
            segment_start: 0,
            entries: Vec::new(),
            segments: Vec::new(),
            effort: Effort::default(),
            broken: false,
        }
    }

    /// How much time blocks may take; the fewest bits unless another effort is chosen. Readers need not know.
    #[must_use]
    pub fn with_effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    /// What is being recorded.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.offset
    }

    /// The tick that [`push_next`](Self::push_next) would take: one after the last.
    pub fn next_tick(&self) -> i64 {
        self.next_tick
    }

    /// One row: its tick, and one cell per column, `None` for a gap.
    ///
    /// # Errors
    /// If the row has another number of cells, or a block is full and cannot be written.
    pub fn push(&mut self, tick: i64, row: &[Option<f64>]) -> Result<(), Error> {
        if self.broken {
            return Err(Error::Broken);
        }
        if row.len() != self.columns.len() {
            let expected = format!("{} cells, one per column", self.columns.len());
            return Err(ArgumentError::new("row", format!("{} cells", row.len()), expected).into());
        }
        self.ticks.push(tick);
        for (cells, cell) in self.columns.iter_mut().zip(row) {
            cells.push(*cell);
        }
        self.next_tick = tick.wrapping_add(1);
        if self.ticks.len() == self.schema.rows_per_block {
            self.write_block(Starts::Learned)?;
        }
        Ok(())
    }

    /// One row, one tick after the last; for rows without time.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn push_next(&mut self, row: &[Option<f64>]) -> Result<(), Error> {
        self.push(self.next_tick, row)
    }

    /// Writes the rows so far as a block, however few: a reader then has them.
    ///
    /// # Errors
    /// If writing fails.
    pub fn flush(&mut self) -> Result<(), Error> {
        if self.broken {
            return Err(Error::Broken);
        }
        if !self.ticks.is_empty() {
            self.write_block(Starts::Learned)?;
        }
        self.writer.flush().map_err(Error::io("write"))
    }

    /// Writes the rest and the index. A recording that was not finished can be read too, only without index.
    ///
    /// # Errors
    /// If writing fails.
    pub fn finish(mut self) -> Result<W, Error> {
        if self.broken {
            return Err(Error::Broken);
        }
        // The only block says itself what others would share.
        if !self.ticks.is_empty() {
            self.write_block(Starts::None)?;
        }
        self.write_header(Starts::None)?;
        // The only segment is its own footer.
        let is_only = self.segments.is_empty() && !self.entries.is_empty();
        self.write_segment(if is_only { index::ONLY } else { index::SEGMENT })?;
        let footer = match &self.header {
            Some(header) if !is_only => index::push_footer(header, &self.segments),
            _ => Vec::new(),
        };
        let length = if is_only {
            self.segments[0].length
        } else {
            footer.len() as u64
        };
        self.write(&[footer, index::trailer(length)].concat())?;
        self.writer.flush().map_err(Error::io("write"))?;
        Ok(self.writer)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        if let Err(error) = self.writer.write_all(bytes) {
            self.broken = true;
            return Err(Error::io("write")(error));
        }
        self.offset += bytes.len() as u64;
        Ok(())
    }

    fn write_header(&mut self, starts: Starts) -> Result<(), Error> {
        if self.header.is_some() {
            return Ok(());
        }
        let bounds = (0..self.columns.len())
            .map(|i| self.share_bound(i).unwrap_or(0.0))
            .collect();
        let mut header = Header::new(self.schema.clone(), &self.ticks, bounds);
        if starts == Starts::Learned {
            header = header.with_starts(&self.columns);
        }
        self.write(&header.to_bytes())?;
        self.segment_start = self.offset;
        self.header = Some(header);
        Ok(())
    }

    /// The bound that a share means by now; `None` for columns without a share.
    fn share_bound(&self, column: usize) -> Option<f64> {
        let spec = &self.schema.columns[column];
        let Bound::ShareOfRange(share) = spec.bound else {
            return None;
        };
        let range = spec
            .known_range()
            .or_else(|| self.ends[column].map(|(low, high)| high - low));
        Some(share_of(share, range.unwrap_or(0.0)))
    }

    fn write_block(&mut self, starts: Starts) -> Result<(), Error> {
        for (ends, cells) in self.ends.iter_mut().zip(&self.columns) {
            for value in cells.iter().flatten().filter(|value| value.is_finite()) {
                let (low, high) = ends.unwrap_or((*value, *value));
                *ends = Some((low.min(*value), high.max(*value)));
            }
        }
        self.write_header(starts)?;
        let Some(header) = &self.header else {
            return Err(Error::Broken);
        };
        let own: Vec<Option<f64>> = (0..self.columns.len())
            .map(|i| own_bound(self.share_bound(i)?, header.share_bounds[i]))
            .collect();
        let (bytes, restored) = block::encode(header, &self.ticks, &self.columns, &own, self.effort);
        self.write(&bytes)?;
        self.entries.push(Entry::of(bytes.len() as u64, &self.ticks, &restored));
        self.ticks.clear();
        self.columns.iter_mut().for_each(Vec::clear);
        if self.entries.len() == BLOCKS_PER_SEGMENT {
            self.write_segment(index::SEGMENT)?;
        }
        Ok(())
    }

    fn write_segment(&mut self, kind: u8) -> Result<(), Error> {
        if self.entries.is_empty() {
            return Ok(());
        }
        let Some(header) = &self.header else {
            return Err(Error::Broken);
        };
        let content = index::push_segment(header, &self.entries);
        let bytes = index::special(header.check, kind, &content);
        self.write(&bytes)?;
        let segment = Segment::new(self.segment_start, bytes.len() as u64, &self.entries);
        self.segment_start = segment.end();
        self.segments.push(segment);
        self.entries.clear();
        Ok(())
    }

    /// Whether rows are numbered.
    pub fn is_numbered(&self) -> bool {
        self.schema.time == TimeBase::Numbered
    }
}
