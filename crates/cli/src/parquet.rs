//! Reading and writing of Parquet through Arrow record batches.

use crate::clock;
use crate::error::Error;
use crate::target::Target;
use arrow_array::cast::AsArray;
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::Field;
use fewbits_record::arrow::{cells, ticks};
use fewbits_record::{Block, Schema, TimeBase, TimeFormat};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Number of rows per batch.
const ROWS: usize = 1 << 14;
/// Time base in which timestamps are converted to text.
const NANOSECONDS: TimeBase = TimeBase::Clock {
    decimals: 9,
    tolerance: 0,
    format: TimeFormat::Utc,
};

fn refused<E: std::error::Error + Send + Sync + 'static>(file: &str) -> impl Fn(E) -> Error + use<E> {
    let file = file.to_owned();
    move |source| Error::Parquet {
        file: file.clone(),
        source: Box::new(source),
    }
}

/// Rows of a Parquet file as text, like those of a CSV file.
pub(crate) struct Rows {
    reader: ParquetRecordBatchReader,
    /// Names of the columns.
    pub(crate) names: Vec<String>,
    /// Cells of the present batch, by column, and the index of its next row.
    cells: Vec<Vec<String>>,
    row: usize,
    file: String,
}

impl Rows {
    pub(crate) fn open(opened: File, file: &str) -> Result<Self, Error> {
        let builder = ParquetRecordBatchReaderBuilder::try_new(opened).map_err(refused(file))?;
        let names = builder
            .schema()
            .fields()
            .iter()
            .map(|field| field.name().clone())
            .collect();
        Ok(Self {
            reader: builder.with_batch_size(ROWS).build().map_err(refused(file))?,
            names,
            cells: Vec::new(),
            row: 0,
            file: file.to_owned(),
        })
    }

    /// Reads the next row into `record`. Returns whether there was one.
    pub(crate) fn read(&mut self, record: &mut csv::StringRecord) -> Result<bool, Error> {
        while self.cells.first().is_none_or(|cells| self.row >= cells.len()) {
            let Some(batch) = self.reader.next() else {
                return Ok(false);
            };
            let batch = batch.map_err(refused(&self.file))?;
            self.cells = texts(&batch);
            self.row = 0;
        }
        record.clear();
        self.cells.iter().for_each(|cells| record.push_field(&cells[self.row]));
        self.row += 1;
        Ok(true)
    }
}

/// The cells of a batch as text. A cell of a type other than number, time or text contains the name of its type, and is refused when it is
/// used.
fn texts(batch: &RecordBatch) -> Vec<Vec<String>> {
    let column = |(field, array): (&Arc<Field>, &ArrayRef)| -> Vec<String> {
        let name = field.name();
        if let Some(texts) = array.as_string_opt::<i32>() {
            return texts.iter().map(|text| text.unwrap_or_default().to_owned()).collect();
        }
        // Ticks of seconds have their number of decimals in the metadata.
        let decimals = field
            .metadata()
            .get("decimals")
            .and_then(|decimals| decimals.parse().ok());
        let time = decimals.map_or(NANOSECONDS, |decimals| TimeBase::Clock {
            decimals,
            tolerance: 0,
            format: TimeFormat::Seconds,
        });
        let cells = match decimals {
            None => cells(name, array).ok(),
            Some(_) => None,
        };
        if let Some(cells) = cells {
            return cells
                .into_iter()
                .map(|cell| cell.map_or(String::new(), |value| format!("{value:?}")))
                .collect();
        }
        match ticks(name, array, decimals.unwrap_or(clock::NANOSECONDS)) {
            Ok(ticks) => ticks.into_iter().map(|tick| clock::shown(tick, time)).collect(),
            Err(error) => vec![error.to_string(); array.len()],
        }
    };
    let fields = batch.schema();
    fields.fields().iter().zip(batch.columns()).map(column).collect()
}

/// Rows of a recording as Parquet.
pub(crate) struct Sink {
    writer: ArrowWriter<Target>,
    schema: Schema,
    block: Block,
    file: String,
}

impl Sink {
    /// Rows of these columns.
    pub(crate) fn create(path: &Path, schema: &Schema, names: &[String]) -> Result<Self, Error> {
        let file = path.display().to_string();
        let target = Target::open(Some(path))?;
        let kept = names
            .iter()
            .map(|name| schema.position(name).map(|i| schema.columns()[i].clone()));
        let schema = kept
            .collect::<Result<_, _>>()
            .and_then(|columns| Schema::new(columns, schema.time()))
            .map_err(Error::recording(&file))?;
        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let writer = ArrowWriter::try_new(target, schema.to_arrow().into(), Some(properties));
        let mut sink = Self {
            writer: writer.map_err(refused(&file))?,
            block: Block::default(),
            schema,
            file,
        };
        sink.clear();
        Ok(sink)
    }

    fn clear(&mut self) {
        self.block = Block::default();
        self.block.columns = vec![Vec::new(); self.schema.columns().len()];
    }

    pub(crate) fn write(&mut self, tick: i64, values: &[Option<f64>]) -> Result<(), Error> {
        self.block.ticks.push(tick);
        let columns = self.block.columns.iter_mut().zip(values);
        columns.for_each(|(column, value)| column.push(*value));
        if self.block.ticks.len() == ROWS {
            self.write_batch()
        } else {
            Ok(())
        }
    }

    fn write_batch(&mut self) -> Result<(), Error> {
        if self.block.ticks.is_empty() {
            return Ok(());
        }
        let batch = self
            .block
            .to_record_batch(&self.schema)
            .map_err(Error::recording(&self.file))?;
        self.clear();
        self.writer.write(&batch).map_err(refused(&self.file))
    }

    /// Writes the remaining rows and the end of the file, without which it cannot be read.
    pub(crate) fn finish(mut self) -> Result<(), Error> {
        self.write_batch()?;
        self.writer.into_inner().map_err(refused(&self.file))?.finish()
    }
}
