//! Times of recordings as columns of tables, and back.

use crate::error::{Outcome, refused};
use crate::table::Given;
use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float64Type, TimestampMicrosecondType, TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType,
};
use arrow_array::{ArrayRef, Float64Array, Int64Array, PrimitiveArray, RecordBatch, StringArray};
use arrow_schema::{ArrowError, DataType, Field, SchemaRef, TimeUnit};
use fewbits_recipes::words;
use fewbits_record::arrow::{cells, ticks};
use fewbits_record::{Schema, TimeBase, TimeFormat};
use std::sync::Arc;

/// Largest number of decimals of seconds.
pub(crate) const MAX_DECIMALS: u8 = 9;

/// The time base and the ticks of a column: timestamps in their own unit, in UTC or without a zone as they are, dates as their midnights,
/// numbers as seconds with as many decimals as they have.
pub(crate) fn clock(given: &Given, name: &str) -> Outcome<(TimeBase, Vec<i64>)> {
    let base = |decimals, format| TimeBase::Clock {
        decimals,
        format,
        tolerance: 0,
    };
    let decimals = match given.kind(name)? {
        DataType::Timestamp(TimeUnit::Second, _) | DataType::Date32 => Some(0),
        DataType::Timestamp(TimeUnit::Millisecond, _) | DataType::Date64 => Some(3),
        DataType::Timestamp(TimeUnit::Microsecond, _) => Some(6),
        DataType::Timestamp(TimeUnit::Nanosecond, _) => Some(9),
        _ => None,
    };
    if let Some(decimals) = decimals {
        let mut all = Vec::new();
        for column in given.arrays(name)? {
            all.extend(ticks(name, column, decimals)?);
        }
        let format = match given.kind(name)? {
            DataType::Timestamp(_, Some(_)) => TimeFormat::Utc,
            _ => TimeFormat::Local,
        };
        return Ok((base(decimals, format), all));
    }
    if matches!(given.kind(name)?, DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View) {
        let expected =
            "timestamps, or seconds: `pandas.to_datetime(...)`, or `str.to_datetime()` of polars, makes times of texts";
        return refused("time", format!("'{name}' of texts"), expected);
    }
    let Some(seconds) = given.numbers(name)?.into_iter().collect::<Option<Vec<f64>>>() else {
        return refused("time", format!("'{name}' with gaps"), "a time in every row");
    };
    for decimals in 0..=MAX_DECIMALS {
        let scale = 10_f64.powi(decimals.into());
        // The quotient of two exact doubles is rounded once, so it is the number that was written with these decimals.
        let tick = |x: &f64| {
            let tick = (x * scale).round();
            (tick.abs() < 9e15 && tick / scale == *x).then_some(tick as i64)
        };
        if let Some(ticks) = seconds.iter().map(tick).collect::<Option<Vec<_>>>() {
            return Ok((base(decimals, TimeFormat::Seconds), ticks));
        }
    }
    refused("time", format!("'{name}'"), "seconds of at most 9 decimals, or timestamps: round them first")
}

/// How a table shows the times of a recording.
enum Shown {
    Row,
    Seconds,
    /// Timestamps of this unit: ticks times the factor.
    Stamps(TimeUnit, i64, Option<Arc<str>>),
    /// Ticks finer than all timestamps.
    Ticks,
}

impl Shown {
    fn of(time: TimeBase) -> Self {
        let TimeBase::Clock { decimals, format, .. } = time else {
            return Self::Row;
        };
        if format == TimeFormat::Seconds {
            return Self::Seconds;
        }
        let (unit, digits) = match decimals {
            0 => (TimeUnit::Second, 0),
            1..=3 => (TimeUnit::Millisecond, 3),
            4..=6 => (TimeUnit::Microsecond, 6),
            7..=9 => (TimeUnit::Nanosecond, 9),
            _ => return Self::Ticks,
        };
        let zone = (format == TimeFormat::Utc).then(|| "UTC".into());
        Self::Stamps(unit, 10_i64.pow(u32::from(digits - decimals)), zone)
    }
}

/// The fields of a recording as a table: seconds as doubles, timestamps in UTC or without a zone, numbers of rows; then its columns, those of
/// words as texts.
pub(crate) fn fields(schema: &Schema) -> arrow_schema::Schema {
    let own = schema.to_arrow();
    let time = match Shown::of(schema.time()) {
        Shown::Row => Field::new("row", DataType::Int64, false),
        Shown::Seconds => Field::new(schema.time_name(), DataType::Float64, false),
        Shown::Stamps(unit, _, zone) => Field::new(schema.time_name(), DataType::Timestamp(unit, zone), false),
        Shown::Ticks => own.field(0).clone().with_name(schema.time_name()),
    };
    let columns = own.fields().iter().skip(1).zip(schema.columns());
    let columns = columns.map(|(field, column)| match words::of(column.unit()) {
        Some(_) => Arc::new(Field::new(field.name(), DataType::Utf8, true).with_metadata(field.metadata().clone())),
        None => field.clone(),
    });
    arrow_schema::Schema::new(std::iter::once(Arc::new(time)).chain(columns).collect::<Vec<_>>())
}

/// A batch of a recording with its times as `fields` states them.
pub(crate) fn shown(
    batch: &RecordBatch,
    ticks: &[i64],
    schema: &Schema,
    fields: SchemaRef,
) -> Result<RecordBatch, ArrowError> {
    let (time, mut columns) = (schema.time(), batch.columns().to_vec());
    let array: Option<ArrayRef> = match (Shown::of(time), time) {
        (Shown::Seconds, TimeBase::Clock { decimals, .. }) => {
            let scale = 10_f64.powi(decimals.into());
            Some(Arc::new(
                ticks
                    .iter()
                    .map(|tick| Some(*tick as f64 / scale))
                    .collect::<Float64Array>(),
            ))
        }
        (Shown::Stamps(unit, factor, zone), _) => {
            let scaled = ticks
                .iter()
                .map(|tick| tick.checked_mul(factor))
                .collect::<Option<Vec<i64>>>();
            let Some(stamps) = scaled else {
                return Err(ArrowError::ComputeError("a time is outside of the range of timestamps".to_owned()));
            };
            Some(match unit {
                TimeUnit::Second => stamped::<TimestampSecondType>(stamps, zone),
                TimeUnit::Millisecond => stamped::<TimestampMillisecondType>(stamps, zone),
                TimeUnit::Microsecond => stamped::<TimestampMicrosecondType>(stamps, zone),
                TimeUnit::Nanosecond => stamped::<TimestampNanosecondType>(stamps, zone),
            })
        }
        _ => None,
    };
    if let (Some(first), Some(array)) = (columns.first_mut(), array) {
        *first = array;
    }
    for (column, field) in columns.iter_mut().zip(fields.fields()).skip(1) {
        if *field.data_type() == DataType::Utf8 {
            let position = schema
                .position(field.name())
                .map_err(|error| ArrowError::ComputeError(error.to_string()))?;
            let words = words::of(schema.columns()[position].unit()).unwrap_or_default();
            let word = |number: Option<f64>| words.get(number? as usize).map(String::as_str);
            let texts: StringArray = column.as_primitive::<Float64Type>().iter().map(word).collect();
            *column = Arc::new(texts);
        }
    }
    RecordBatch::try_new(fields, columns)
}

fn stamped<T: arrow_array::types::ArrowTimestampType>(stamps: Vec<i64>, zone: Option<Arc<str>>) -> ArrayRef {
    Arc::new(PrimitiveArray::<T>::from_iter_values(stamps).with_timezone_opt(zone))
}

/// A batch of the caller whose numbers of seconds, if its times are such, are ticks of the recording.
pub(crate) fn ticked(batch: &RecordBatch, schema: &Schema) -> Outcome<RecordBatch> {
    let TimeBase::Clock { decimals, .. } = schema.time() else {
        return Ok(batch.clone());
    };
    let fields = batch.schema();
    let named = fields.index_of(schema.time_name()).or_else(|_| fields.index_of("time"));
    let Some(at) = named.ok().filter(|at| fields.field(*at).data_type().is_numeric()) else {
        return Ok(batch.clone());
    };
    let name = fields.field(at).name();
    let scale = 10_f64.powi(decimals.into());
    let mut ticks = Vec::with_capacity(batch.num_rows());
    for seconds in cells(name, batch.column(at))? {
        match seconds.map(|seconds| (seconds * scale).round()) {
            Some(tick) if tick.abs() < i64::MAX as f64 => ticks.push(tick as i64),
            Some(_) => return refused("time", format!("'{name}'"), "times within the clock's range"),
            None => return refused("time", format!("'{name}' with gaps"), "a time in every row"),
        }
    }
    let mut columns = batch.columns().to_vec();
    columns[at] = Arc::new(Int64Array::from(ticks));
    let mut changed: Vec<_> = fields.fields().iter().cloned().collect();
    changed[at] = Arc::new(Field::new(name, DataType::Int64, false));
    Ok(RecordBatch::try_new(Arc::new(arrow_schema::Schema::new(changed)), columns)?)
}
