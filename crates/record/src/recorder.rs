//! Writing of recordings.

use crate::append::{self, Append};
use crate::block::{self, Block};
use crate::error::{Error, ensure};
use crate::header::{Form, Header};
use crate::index::{self, BLOCKS_PER_SEGMENT, BlockInfo, Segment};
use crate::resume::{self, Opened};
use crate::scan::{Kind, Scanner};
use crate::schema::Schema;
use crate::waiting::Waiting;
use crate::wire::{checked, written};
use fewbits_block_codec::Effort;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Largest number of rows of a single block for which a code that its columns share is tried.
const SHARED_ROWS: usize = 1 << 13;

/// Writes rows in blocks.
///
/// The header is written with the first block, because it contains the spacing of times and the ranges, which the first rows determine.
/// Each block is written by one call and never changed: after a crash at any byte all blocks before it can be read.
/// Memory: the rows of one block, 1024 entries of the index, and 40 bytes per 1024 blocks.
#[derive(Debug)]
pub struct Recorder<W> {
    writer: W,
    schema: Schema,
    header: Option<Header>,
    /// The rows of the block that is not full yet.
    rows: Waiting,
    next_tick: i64,
    /// Number of bytes written.
    offset: u64,
    entries: Vec<BlockInfo>,
    segments: Vec<Segment>,
    /// Number of the next block.
    next_number: u64,
    /// The append that is undone if the recorder is dropped before it is complete.
    append: Append,
    effort: Effort,
    /// The identity of a new recording, if it is not random.
    identity: Option<u32>,
    broken: bool,
}

impl Recorder<File> {
    /// Creates a file, and locks it against other writers. An existing one is replaced.
    ///
    /// # Errors
    /// If the file cannot be created, or another program writes to it.
    pub fn create(path: impl AsRef<Path>, schema: Schema) -> Result<Self, Error> {
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        let file = options.open(path).map_err(Error::io("create"))?;
        append::lock(&file)?;
        file.set_len(0).map_err(Error::io("create"))?;
        Ok(Self::new(file, schema))
    }

    /// Continues a recording, finished or not, and locks it against other writers.
    ///
    /// Nothing is overwritten before the first block. If the recorder is dropped before [`finish`](Self::finish), [`flush`](Self::flush) or
    /// [`sync`](Self::sync), the file is what it was. After a crash it is what it was, too, once it is resumed or read by
    /// [`Playback::open`](crate::Playback::open); a file with `.append` added to the name keeps what is needed for that.
    ///
    /// # Errors
    /// If the file cannot be opened or read, its header is incomplete or damaged, or another program writes to it.
    pub fn resume(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let (file, append, resumed) = match resume::open(path)? {
            Opened::InPlace(file, append, resumed) => (file, append, *resumed),
            Opened::Other(file, header, single, scanner) => return Self::copied(file, path, &header, single, scanner),
        };
        let schema = resumed.header.schema.clone();
        Ok(Self {
            header: Some(resumed.header),
            next_tick: resume::next_tick(&resumed.segments, &resumed.entries),
            offset: resumed.offset,
            segments: resumed.segments,
            entries: resumed.entries,
            next_number: resumed.next_number,
            append,
            ..Self::new(file, schema)
        })
    }

    /// Continues a copy with a header of this version that goes on. Its blocks keep their bytes but for the first numbers.
    fn copied(
        locked: File,
        path: &Path,
        old: &Header,
        single: Option<Vec<u8>>,
        mut scanner: Scanner,
    ) -> Result<Self, Error> {
        let mut reader = locked.try_clone().map_err(Error::io("open"))?;
        let (file, append) = resume::copy(locked, path)?;
        let mut copy = Self {
            append,
            ..Self::new(file, old.schema.clone())
        };
        copy.put_header(old.clone().with_form(Form::File).renewed())?;
        if let Some(content) = single {
            let block = block::only(old, &content, content.len() as u64, |_| true)?;
            let content = block::renewed(old, &content, 0).map_err(Error::Header)?;
            copy.put_again(&content, &block)?;
        }
        while let Some(found) = scanner.next(&mut reader, old)? {
            if found.kind == Kind::Block {
                let block = scanner.decoded(old, &found, |_| true)?;
                let content = block::content_of(scanner.bytes(&found));
                let content = content.and_then(|content| block::renewed(old, content, copy.next_number));
                copy.put_again(&content.map_err(|damage| found.damaged(damage))?, &block)?;
            }
        }
        copy.next_tick = resume::next_tick(&copy.segments, &copy.entries);
        Ok(copy)
    }

    /// Writes the rows so far as a block, even if it is not full, and waits until the storage device has them.
    ///
    /// # Errors
    /// If writing fails.
    pub fn sync(&mut self) -> Result<(), Error> {
        self.flush()?;
        self.writer.sync_data().map_err(Error::io("write"))
    }
}

impl<W: Write> Recorder<W> {
    /// A recording into any sink. Each block is written by one call, so no buffer is needed.
    pub fn new(writer: W, schema: Schema) -> Self {
        Self {
            writer,
            rows: Waiting::new(schema.columns.len()),
            schema,
            header: None,
            next_tick: 0,
            offset: 0,
            entries: Vec::new(),
            segments: Vec::new(),
            next_number: 0,
            append: Append::default(),
            effort: Effort::default(),
            identity: None,
            broken: false,
        }
    }

    /// Sets how much computing time blocks may take. The default gives the fewest bits. Readers need not know it.
    #[must_use]
    pub fn with_effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    /// Sets the identity that tells this recording from others with equal columns, so that the same rows give the same bytes. By default it
    /// is random. Blocks of recordings with one identity and equal headers can be exchanged unnoticed: derive it from what is recorded. No
    /// effect on a recording that is resumed.
    #[must_use]
    pub fn with_identity(mut self, identity: u32) -> Self {
        self.identity = Some(identity);
        self
    }

    /// Columns and time of the recording.
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

    /// Adds one row: its tick, and one cell per column, `None` for a gap.
    ///
    /// # Errors
    /// If the number of cells is not that of the columns, or a full block cannot be written.
    pub fn push(&mut self, tick: i64, row: &[Option<f64>]) -> Result<(), Error> {
        ensure!(!self.broken, Error::Broken);
        self.rows.check("row", row.iter().map(|_| 1), 1)?;
        self.space()?;
        self.rows.extend(&[tick], row.iter().map(std::slice::from_ref));
        self.added(tick)
    }

    /// Adds one row whose tick is one after the last; for rows without time.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn push_next(&mut self, row: &[Option<f64>]) -> Result<(), Error> {
        self.push(self.next_tick, row)
    }

    /// Adds rows by columns: a tick of each row, and as many cells of each column, `None` for a gap. Faster than row by row.
    ///
    /// # Errors
    /// If there are not as many columns as the recording has, or cells of a column as ticks: nothing is added then. If a full block cannot
    /// be written: rows before it were added.
    pub fn push_columns(&mut self, ticks: &[i64], columns: &[impl AsRef<[Option<f64>]>]) -> Result<(), Error> {
        ensure!(!self.broken, Error::Broken);
        self.rows
            .check("columns", columns.iter().map(|cells| cells.as_ref().len()), ticks.len())?;
        let mut from = 0;
        while from < ticks.len() {
            let to = ticks.len().min(from + self.space()?);
            self.rows
                .extend(&ticks[from..to], columns.iter().map(|cells| &cells.as_ref()[from..to]));
            self.added(ticks[to - 1])?;
            from = to;
        }
        Ok(())
    }

    /// Number of rows until the block is full. The first block waits for one row more: if none follows, the recording is a single block, which
    /// takes fewer bytes.
    fn space(&mut self) -> Result<usize, Error> {
        if self.rows.ticks.len() == self.schema.rows_per_block {
            self.write_block()?;
        }
        Ok(self.schema.rows_per_block - self.rows.ticks.len())
    }

    /// After rows of which this is the last tick.
    fn added(&mut self, tick: i64) -> Result<(), Error> {
        self.next_tick = tick.wrapping_add(1);
        if self.rows.ticks.len() == self.schema.rows_per_block && self.header.is_some() {
            self.write_block()?;
        }
        Ok(())
    }

    /// Writes the rows so far as a block, even if it is not full, so that a reader can read them.
    ///
    /// # Errors
    /// If writing fails.
    pub fn flush(&mut self) -> Result<(), Error> {
        ensure!(!self.broken, Error::Broken);
        if !self.rows.ticks.is_empty() {
            self.write_block()?;
        }
        self.writer.flush().map_err(Error::io("write"))?;
        self.append.commit()
    }

    /// Writes the remaining rows and the index. A recording that was not finished can be read too, but without index.
    ///
    /// # Errors
    /// If writing fails.
    pub fn finish(mut self) -> Result<W, Error> {
        ensure!(!self.broken, Error::Broken);
        if self.header.is_none() && !self.rows.ticks.is_empty() {
            let bytes = self.single();
            self.write(&bytes)?;
            self.writer.flush().map_err(Error::io("write"))?;
            return Ok(self.writer);
        }
        if !self.rows.ticks.is_empty() {
            self.write_block()?;
        }
        self.write_header()?;
        // A single segment is also the footer.
        let is_only = self.segments.is_empty() && (1..=BLOCKS_PER_SEGMENT).contains(&self.entries.len());
        self.write_segment(if is_only { index::ONLY } else { index::SEGMENT })?;
        let footer = match &self.header {
            Some(header) if !is_only => {
                let content = written(|fields| index::footer(fields, header, &self.segments));
                index::special(header.check, index::FOOTER, &content)
            }
            _ => Vec::new(),
        };
        let length = if is_only {
            self.segments[0].length
        } else {
            footer.len() as u64
        };
        self.write(&[footer, index::trailer(length)].concat())?;
        self.writer.flush().map_err(Error::io("write"))?;
        self.append.commit()?;
        Ok(self.writer)
    }

    /// The whole recording of the waiting rows as a single block.
    fn single(&self) -> Vec<u8> {
        let (columns, rows) = (&self.rows.columns, self.rows.ticks.len());
        let plain = self.rows.header(&self.schema).with_form(Form::Single(rows));
        let written = |header: &Header| header.single(&self.rows.first(rows, header, 0, self.effort).content().0);
        let apart = written(&plain);
        // Columns with starts share one code. It is shorter if they have few rows or help each other.
        let is_worth_it = columns.len() > 1 && rows <= SHARED_ROWS && self.effort == Effort::Thorough;
        let shared = is_worth_it.then(|| written(&plain.with_starts(columns)));
        shared.filter(|shared| shared.len() < apart.len()).unwrap_or(apart)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.append.begin()?;
        if let Err(error) = self.writer.write_all(bytes) {
            // The file may now end within a block, and nothing may follow that.
            self.broken = true;
            return Err(Error::io("write")(error));
        }
        self.offset += bytes.len() as u64;
        Ok(())
    }

    fn write_header(&mut self) -> Result<(), Error> {
        if self.header.is_some() {
            return Ok(());
        }
        let mut header = self.rows.header(&self.schema);
        if let Some(identity) = self.identity {
            header = header.with_identity(identity);
        }
        self.put_header(header.with_starts(&self.rows.columns))
    }

    fn put_header(&mut self, header: Header) -> Result<(), Error> {
        self.write(&header.to_bytes())?;
        self.header = Some(header);
        Ok(())
    }

    /// Puts a block of this content, which another recording had, behind the others.
    fn put_again(&mut self, content: &[u8], block: &Block) -> Result<(), Error> {
        let check = self.header.as_ref().map_or(0, |header| header.check);
        let bytes = checked(check, &[], content);
        let entry = BlockInfo::of(self.offset, bytes.len() as u64, &block.ticks, &block.columns);
        self.put(&bytes, entry)
    }

    /// Puts a block behind the others, and a segment of the index if it is full.
    fn put(&mut self, bytes: &[u8], entry: BlockInfo) -> Result<(), Error> {
        self.write(bytes)?;
        self.entries.push(entry);
        self.next_number += 1;
        if self.entries.len() >= BLOCKS_PER_SEGMENT {
            self.write_segment(index::SEGMENT)?;
        }
        Ok(())
    }

    fn write_block(&mut self) -> Result<(), Error> {
        self.write_header()?;
        let header = self.header.as_ref().ok_or(Error::Broken)?;
        let rows = self.rows.ticks.len();
        let (bytes, restored) = self.rows.first(rows, header, self.next_number, self.effort).block();
        // The index has the ends of what a reader gets, which may lie outside those of the samples.
        let entry = BlockInfo::of(self.offset, bytes.len() as u64, &self.rows.ticks, &restored);
        self.put(&bytes, entry)?;
        self.rows.remove(rows);
        Ok(())
    }

    fn write_segment(&mut self, kind: u8) -> Result<(), Error> {
        if self.entries.is_empty() {
            return Ok(());
        }
        let header = self.header.as_ref().ok_or(Error::Broken)?;
        // Damage of which a resumed recording keeps the bytes may put more blocks between segments: a segment that lists none has them searched.
        let is_listed = self.entries.len() <= BLOCKS_PER_SEGMENT;
        let listed = if is_listed { self.entries.as_slice() } else { &[] };
        let content = written(|fields| index::segment(fields, header, 0, listed));
        let bytes = index::special(header.check, kind, &content);
        self.write(&bytes)?;
        self.segments.push(Segment::new(bytes.len() as u64, &self.entries));
        self.entries.clear();
        Ok(())
    }
}
