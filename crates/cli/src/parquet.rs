//! Writing of Parquet through Arrow record batches.

use crate::clock;
use crate::error::Error;
use crate::target::Target;
use arrow_array::cast::AsArray;
use arrow_array::types::Int64Type;
use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_schema::{DataType, Field};
use fewbits_record::{Block, Schema, TimeBase, TimeFormat};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Number of rows per batch.
const ROWS: usize = 1 << 14;
fn refused<E: std::error::Error + Send + Sync + 'static>(file: &str) -> impl Fn(E) -> Error + use<E> {
    let file = file.to_owned();
    move |source| Error::Parquet {
        file: file.clone(),
        source: Box::new(source),
    }
}

/// Whether ticks are seconds with decimals, which other programs read as doubles.
fn is_seconds(time: TimeBase) -> bool {
    matches!(
        time,
        TimeBase::Clock {
            format: TimeFormat::Seconds,
            ..
        }
    )
}

/// The fields of a recording, times in seconds as doubles.
fn fields_with_seconds(schema: &Schema) -> arrow_schema::Schema {
    let own = schema.to_arrow();
    if !is_seconds(schema.time()) {
        return own;
    }
    let time = Arc::new(Field::new("time", DataType::Float64, false));
    arrow_schema::Schema::new(
        std::iter::once(time)
            .chain(own.fields().iter().skip(1).cloned())
            .collect::<Vec<_>>(),
    )
}

/// A batch whose ticks of seconds are the doubles next to them.
fn with_seconds(batch: RecordBatch, time: TimeBase) -> Result<RecordBatch, arrow_schema::ArrowError> {
    if !is_seconds(time) {
        return Ok(batch);
    }
    let ticks = batch.column(0).as_primitive::<Int64Type>();
    // The text of a tick is exact, and its double the nearest.
    let seconds = ticks
        .values()
        .iter()
        .map(|tick| clock::shown(*tick, time).parse().unwrap_or(f64::NAN));
    let seconds: ArrayRef = Arc::new(Float64Array::from_iter_values(seconds));
    let columns: Vec<ArrayRef> = std::iter::once(seconds)
        .chain(batch.columns().iter().skip(1).cloned())
        .collect();
    let own = batch.schema();
    let field = Arc::new(Field::new("time", DataType::Float64, false));
    let fields: Vec<_> = std::iter::once(field)
        .chain(own.fields().iter().skip(1).cloned())
        .collect();
    RecordBatch::try_new(Arc::new(arrow_schema::Schema::new(fields)), columns)
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
        let fields = fields_with_seconds(&schema);
        let writer = ArrowWriter::try_new(target, fields.into(), Some(properties));
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
        let batch = with_seconds(batch, self.schema.time()).map_err(refused(&self.file))?;
        self.clear();
        self.writer.write(&batch).map_err(refused(&self.file))
    }

    /// Writes the remaining rows and the end of the file, without which it cannot be read.
    pub(crate) fn finish(mut self) -> Result<(), Error> {
        self.write_batch()?;
        self.writer.into_inner().map_err(refused(&self.file))?.finish()
    }
}
