//! The tables of a link: each header that arrives is that of a table of its own.

use crate::Ending;
use crate::error::Error;
use crate::output::{Shape, Writer};
use crate::say::say;
use crate::unpack::write_blocks;
use fewbits_recipes::unpack::Selection;
use fewbits_record::{Block, FrameReader, Schema};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Largest number of tables. Frames of further ones are refused: who may send may not fill the disk with files.
const MAX_TABLES: usize = 16;
/// Refused frames are reported at most once in this time.
const REPORT_EVERY: Duration = Duration::from_secs(10);

/// Who sends on a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Senders {
    /// One sender. After it has started anew its rows go on in the same table if columns and times are those before.
    One,
    /// Anyone: another header is another table.
    Any,
}

struct Table {
    reader: FrameReader,
    /// Index of the writer; `None` if the rows of this table are refused.
    writer: Option<usize>,
}

struct Sheet {
    writer: Writer,
    all: Selection,
    schema: Schema,
}

/// Frames to tables. The first table goes to the output; the second, if that is a file `day.csv`, to `day-2.csv`, and so on.
pub(super) struct Tables<'a> {
    output: Option<&'a Path>,
    address: &'a str,
    senders: Senders,
    tables: Vec<Table>,
    sheets: Vec<Sheet>,
    /// Collects what belongs to no table yet.
    collecting: FrameReader,
    refused: u64,
    reported: Option<Instant>,
}

impl<'a> Tables<'a> {
    pub(super) fn new(output: Option<&'a Path>, address: &'a str, senders: Senders) -> Self {
        Self {
            output,
            address,
            senders,
            tables: Vec::new(),
            sheets: Vec::new(),
            collecting: FrameReader::new(),
            refused: 0,
            reported: None,
        }
    }

    /// Writes the rows that become known by this frame.
    pub(super) fn take(&mut self, frame: &[u8]) -> Result<(), Error> {
        let mut of_table = self.tables.iter_mut().enumerate().rev();
        if let Some((table, blocks)) = of_table.find_map(|(i, table)| Some((i, table.reader.handle(frame).ok()?))) {
            return self.write(table, blocks);
        }
        let blocks = match self.collecting.handle(frame) {
            Ok(blocks) => blocks,
            Err(error) => {
                self.refused += 1;
                self.report(&error.to_string());
                return Ok(());
            }
        };
        // What is no piece of a header may be of a table whose header is not complete, or damaged.
        if !self.tables.is_empty() && self.collecting.schema().is_none() && frame.first() != Some(&0) {
            self.report("damaged, or of another table");
        }
        let Some(schema) = self.collecting.schema().cloned() else {
            return Ok(());
        };
        let reader = std::mem::take(&mut self.collecting);
        let writer = self.sheet(schema)?;
        if self.tables.len() == MAX_TABLES {
            self.refused += 1;
            self.report("there are too many tables");
            return Ok(());
        }
        self.tables.push(Table { reader, writer });
        self.write(self.tables.len() - 1, blocks)
    }

    /// Index of the sheet for rows of this schema; `None` if there is none for them.
    fn sheet(&mut self, schema: Schema) -> Result<Option<usize>, Error> {
        let address = self.address;
        let is_same = |sheet: &Sheet| {
            let names = |schema: &Schema| {
                let column = |column: &fewbits_record::Column| {
                    (column.name().to_owned(), column.unit().to_owned(), column.integers())
                };
                schema.columns().iter().map(column).collect::<Vec<_>>()
            };
            sheet.schema.time() == schema.time() && names(&sheet.schema) == names(&schema)
        };
        if self.senders == Senders::One
            && let Some(last) = self
                .sheets
                .len()
                .checked_sub(1)
                .filter(|last| is_same(&self.sheets[*last]))
        {
            say!("note: {address}: the sender has started anew: its rows go on in the same table");
            return Ok(Some(last));
        }
        let path = match (self.sheets.len(), self.output) {
            (0, output) => output.map(Path::to_owned),
            (number, Some(output)) => Some(numbered(output, number + 1)),
            (_, None) => {
                let mend = "its rows are refused; with --output each table has a file of its own";
                say!("warning: {address}: another table begins: {mend}");
                return Ok(None);
            }
        };
        if self.sheets.len() == MAX_TABLES {
            return Ok(None);
        }
        if let (Some(path), true) = (&path, !self.sheets.is_empty()) {
            say!("note: {address}: another table begins: {}", path.display());
        }
        let all = Selection::all(&schema);
        let writer = Writer::new(path.as_deref(), Shape::Csv, &schema, &all.names)?;
        self.sheets.push(Sheet { writer, all, schema });
        Ok(Some(self.sheets.len() - 1))
    }

    fn write(&mut self, table: usize, blocks: Vec<Block>) -> Result<(), Error> {
        if blocks.is_empty() {
            return Ok(());
        }
        let Some(sheet) = self.tables[table].writer.and_then(|writer| self.sheets.get_mut(writer)) else {
            self.refused += blocks.len() as u64;
            return Ok(());
        };
        write_blocks(blocks.into_iter().map(Ok), &mut sheet.writer, &sheet.all, self.address).map(drop)
    }

    fn report(&mut self, reason: &str) {
        if self.reported.is_none_or(|last| last.elapsed() >= REPORT_EVERY) {
            self.reported = Some(Instant::now());
            say!("warning: {}: a frame was not used: {reason}", self.address);
        }
    }

    /// Completes the tables, and says what did not arrive.
    pub(super) fn finish(self) -> Result<Ending, Error> {
        let address = self.address;
        for sheet in self.sheets {
            sheet.writer.finish()?;
        }
        if self.tables.is_empty() {
            if let Some((some, all)) = self.collecting.pieces() {
                let frames = self.collecting.waiting();
                say!("error: {address}: {some} of {all} pieces of the header came, and {frames} frames of rows");
            }
            return Ok(Ending::no_frame(address));
        }
        let sum = |count: fn(&FrameReader) -> u64| self.tables.iter().map(|table| count(&table.reader)).sum::<u64>();
        let (received, missing, repeated) =
            (sum(FrameReader::received), sum(FrameReader::missing), sum(FrameReader::repeated));
        if missing > 0 {
            say!(
                "warning: {address}: {missing} of {} frames did not arrive: their rows are missing",
                received + missing
            );
        }
        let uncounted = sum(FrameReader::uncounted);
        if uncounted > 0 {
            say!(
                "warning: {address}: the end of the table did not arrive: how many frames are missing behind the first {} is not known",
                received + missing - uncounted
            );
        }
        if repeated > 0 {
            say!("note: {address}: {repeated} frames came again and were used once");
        }
        let unused = self.refused + self.collecting.waiting() as u64;
        if unused > 0 {
            say!("warning: {address}: {unused} frames were damaged or of another table and not used");
        }
        let has_refused_table = self.tables.iter().any(|table| table.writer.is_none());
        Ok(match missing > 0 || uncounted > 0 || has_refused_table {
            true => Ending::Failed,
            false => Ending::Good,
        })
    }
}

/// `day.csv` to `day-2.csv`.
fn numbered(path: &Path, number: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-{number}.{}", extension.to_string_lossy()),
        None => format!("{stem}-{number}"),
    };
    path.with_file_name(name)
}
