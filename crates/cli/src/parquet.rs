//! Writing of Parquet through Arrow record batches.

use crate::clock;
use crate::error::Error;
use crate::target::Target;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, TimestampSecondType};
use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, TimestampMillisecondArray};
use arrow_schema::{DataType, Field, TimeUnit};
use fewbits_recipes::words;
use fewbits_record::{Block, Schema, TimeBase, TimeFormat};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;
use std::collections::HashMap;
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

/// The type of times in Parquet: seconds are doubles, and timestamps of whole seconds, which Parquet has not, are milliseconds.
fn type_of_times(time: TimeBase, own: &DataType) -> DataType {
    match own {
        _ if is_seconds(time) => DataType::Float64,
        DataType::Timestamp(TimeUnit::Second, zone) => DataType::Timestamp(TimeUnit::Millisecond, zone.clone()),
        own => own.clone(),
    }
}

/// The words of a column; `None` if it has numbers.
fn words_of(schema: &Schema, column: usize) -> Option<Vec<String>> {
    words::of(schema.columns().get(column)?.unit())
}

/// The fields of a recording with the types of Parquet.
fn fields_of(schema: &Schema) -> arrow_schema::Schema {
    let own = schema.to_arrow();
    let first = own.field(0);
    let time = first
        .clone()
        .with_data_type(type_of_times(schema.time(), first.data_type()));
    let time = match schema.time() {
        TimeBase::Numbered => time,
        _ => time.with_name(schema.time_name()),
    };
    let time = Arc::new(if is_seconds(schema.time()) {
        time.with_metadata(HashMap::new())
    } else {
        time
    });
    let values = own.fields().iter().skip(1).enumerate();
    let values = values.map(|(i, field)| match words_of(schema, i) {
        Some(_) => Arc::new(Field::new(field.name(), DataType::Utf8, true)),
        None => field.clone(),
    });
    arrow_schema::Schema::new(std::iter::once(time).chain(values).collect::<Vec<_>>())
}

/// A batch with the types of [`fields_of`].
fn typed(batch: &RecordBatch, schema: &Schema) -> Result<RecordBatch, Error> {
    let time = schema.time();
    let own = batch.column(0);
    let times: ArrayRef = match own.data_type() {
        _ if is_seconds(time) => {
            // The text of a tick is exact, and its double the nearest.
            let seconds = |tick: &i64| clock::shown(*tick, time).parse().unwrap_or(f64::NAN);
            Arc::new(Float64Array::from_iter_values(own.as_primitive::<Int64Type>().values().iter().map(seconds)))
        }
        DataType::Timestamp(TimeUnit::Second, zone) => {
            let ticks = own.as_primitive::<TimestampSecondType>().values();
            let stamps: Option<Vec<i64>> = ticks.iter().map(|tick| tick.checked_mul(1000)).collect();
            let stamps = stamps
                .ok_or_else(|| Error::content("Parquet", "a time is beyond its timestamps: write CSV instead"))?;
            Arc::new(TimestampMillisecondArray::from(stamps).with_timezone_opt(zone.clone()))
        }
        _ => own.clone(),
    };
    let texts = |array: &ArrayRef, words: &[String]| -> ArrayRef {
        let word = |number: Option<f64>| words.get(number? as usize).map(String::as_str);
        Arc::new(
            array
                .as_primitive::<Float64Type>()
                .iter()
                .map(word)
                .collect::<StringArray>(),
        )
    };
    let values = batch.columns().iter().skip(1).enumerate();
    let values = values.map(|(i, array)| match words_of(schema, i) {
        Some(words) => texts(array, &words),
        None => array.clone(),
    });
    let columns: Vec<ArrayRef> = std::iter::once(times).chain(values).collect();
    RecordBatch::try_new(Arc::new(fields_of(schema)), columns).map_err(refused("Parquet"))
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
            .and_then(|kept| kept.with_time_name(schema.time_name()))
            .map_err(Error::recording(&file))?;
        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let fields = fields_of(&schema);
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
        let batch = typed(&batch, &self.schema)?;
        self.clear();
        self.writer.write(&batch).map_err(refused(&self.file))
    }

    /// Writes the remaining rows and the end of the file, without which it cannot be read.
    pub(crate) fn finish(mut self) -> Result<(), Error> {
        self.write_batch()?;
        self.writer.into_inner().map_err(refused(&self.file))?.finish()
    }
}
