//! Conversion between blocks and Arrow record batches.
//!
//! A batch has one field for time and one of 64-bit floats per column, of 64-bit integers for whole numbers; a gap is `null`.
//!
//! | time base | field of time |
//! |---|---|
//! | numbered | `row`: 64-bit integers |
//! | UTC or local, with 0, 3, 6 or 9 decimals | `time`: timestamps of that unit, in UTC or without a zone |
//! | any other | `time`: 64-bit integers, ticks; metadata `decimals` |

use crate::block::{Block, Cells};
use crate::error::{Error, listed};
use crate::integers::Integers;
use crate::recorder::Recorder;
use crate::schema::{Schema, TimeBase, TimeFormat};
use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Date64Type, Decimal32Type, Decimal64Type, Decimal128Type, DurationMicrosecondType,
    DurationMillisecondType, DurationNanosecondType, DurationSecondType, Float32Type, Float64Type, Int8Type, Int16Type,
    Int32Type, Int64Type, TimestampMicrosecondType, TimestampMillisecondType, TimestampNanosecondType,
    TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, Float64Array, Int64Array, PrimitiveArray, RecordBatch};
use arrow_schema::{DataType, Field, TimeUnit};
use fewbits_block_codec::ArgumentError;
use std::collections::HashMap;
use std::io::Write;
use std::sync::Arc;

/// Integers up to this size are exact doubles.
const MAX_WHOLE: i64 = 1 << 53;

/// The unit of timestamps with as many decimals as the ticks; `None` for other time bases.
fn unit_of(time: TimeBase) -> Option<TimeUnit> {
    match time {
        TimeBase::Clock {
            decimals,
            format: TimeFormat::Utc | TimeFormat::Local,
            ..
        } => match decimals {
            0 => Some(TimeUnit::Second),
            3 => Some(TimeUnit::Millisecond),
            6 => Some(TimeUnit::Microsecond),
            9 => Some(TimeUnit::Nanosecond),
            _ => None,
        },
        _ => None,
    }
}

/// The zone of timestamps; `None` for local times.
fn zone_of(time: TimeBase) -> Option<Arc<str>> {
    let is_utc = matches!(
        time,
        TimeBase::Clock {
            format: TimeFormat::Utc,
            ..
        }
    );
    is_utc.then(|| "UTC".into())
}

fn decimals_of(unit: TimeUnit) -> u8 {
    match unit {
        TimeUnit::Second => 0,
        TimeUnit::Millisecond => 3,
        TimeUnit::Microsecond => 6,
        TimeUnit::Nanosecond => 9,
    }
}

impl Schema {
    /// The fields of batches of this recording. Units, and the decimals of ticks, are in the metadata.
    pub fn to_arrow(&self) -> arrow_schema::Schema {
        let time = match (self.time, unit_of(self.time)) {
            (_, Some(unit)) => Field::new("time", DataType::Timestamp(unit, zone_of(self.time)), false),
            (TimeBase::Clock { decimals, .. }, None) => {
                let decimals = HashMap::from([("decimals".to_owned(), decimals.to_string())]);
                Field::new("time", DataType::Int64, false).with_metadata(decimals)
            }
            (TimeBase::Numbered, None) => Field::new("row", DataType::Int64, false),
        };
        let columns = self.columns.iter().map(|column| {
            let kind = match column.integers {
                None => DataType::Float64,
                Some(_) => DataType::Int64,
            };
            let field = Field::new(&column.name, kind, true);
            if column.unit().is_empty() {
                field
            } else {
                field.with_metadata(HashMap::from([("unit".to_owned(), column.unit().to_owned())]))
            }
        });
        arrow_schema::Schema::new(std::iter::once(time).chain(columns).collect::<Vec<_>>())
    }
}

impl Block {
    /// The rows as a batch with the fields of [`Schema::to_arrow`]. Columns that were not requested are left out.
    ///
    /// # Errors
    /// If the block is not of a recording with this schema.
    pub fn to_record_batch(&self, schema: &Schema) -> Result<RecordBatch, Error> {
        let fields = schema.to_arrow();
        if self.columns.len() != schema.columns.len() {
            let given = format!("{} columns", self.columns.len());
            return Err(ArgumentError::new("schema", given, format!("{}", schema.columns.len())).into());
        }
        let ticks = || self.ticks.iter().copied();
        let time: ArrayRef = match unit_of(schema.time) {
            Some(TimeUnit::Second) => stamps::<TimestampSecondType>(ticks(), zone_of(schema.time)),
            Some(TimeUnit::Millisecond) => stamps::<TimestampMillisecondType>(ticks(), zone_of(schema.time)),
            Some(TimeUnit::Microsecond) => stamps::<TimestampMicrosecondType>(ticks(), zone_of(schema.time)),
            Some(TimeUnit::Nanosecond) => stamps::<TimestampNanosecondType>(ticks(), zone_of(schema.time)),
            None => Arc::new(Int64Array::from_iter_values(ticks())),
        };
        let asked = (0..self.columns.len()).filter(|i| self.columns[*i].len() == self.rows());
        let kept: Vec<usize> = asked.collect();
        let cells = kept
            .iter()
            .map(|i| array(&self.columns[*i], schema.columns[*i].integers));
        let arrays: Vec<ArrayRef> = std::iter::once(time).chain(cells).collect();
        let places: Vec<usize> = std::iter::once(0).chain(kept.iter().map(|i| i + 1)).collect();
        Ok(RecordBatch::try_new(Arc::new(fields.project(&places)?), arrays)?)
    }
}

/// Cells of a column; codes of whole numbers as these.
fn array(cells: &[Option<f64>], integers: Option<Integers>) -> ArrayRef {
    match integers {
        None => Arc::new(cells.iter().copied().collect::<Float64Array>()),
        Some(integers) => {
            let numbers = cells.iter().map(|cell| cell.map(|code| integers.number(code)));
            Arc::new(numbers.collect::<Int64Array>())
        }
    }
}

fn stamps<T>(ticks: impl Iterator<Item = i64>, zone: Option<Arc<str>>) -> ArrayRef
where
    T: arrow_array::types::ArrowTimestampType,
{
    Arc::new(PrimitiveArray::<T>::from_iter_values(ticks).with_timezone_opt(zone))
}

/// The double nearest to `unscaled 10^-scale`; nothing for more than 53 bits.
fn decimal(unscaled: i128, scale: i8) -> Option<f64> {
    let power = 10_f64.powi(i32::from(scale).abs());
    let exact = unscaled.unsigned_abs() <= MAX_WHOLE as u128;
    exact.then(|| {
        if scale < 0 {
            unscaled as f64 * power
        } else {
            unscaled as f64 / power
        }
    })
}

/// The cells of an array of numbers, `None` for nulls. Decimals become the nearest doubles, durations seconds.
///
/// # Errors
/// If the array has no numbers, or one of more than 53 bits, which is not an exact double.
pub fn cells(name: &str, array: &dyn Array) -> Result<Cells, Error> {
    fn of<T: ArrowPrimitiveType>(array: &dyn Array, number: impl Fn(T::Native) -> Option<f64>) -> Option<Cells> {
        let cells = array.as_primitive::<T>().iter();
        cells
            .map(|cell| match cell {
                None => Some(None),
                Some(cell) => Some(Some(number(cell)?)),
            })
            .collect()
    }
    let refuse = |given: String, expected: &str| -> Error { ArgumentError::new("column", given, expected).into() };
    let found = match array.data_type() {
        DataType::Float64 => of::<Float64Type>(array, Some),
        DataType::Float32 => of::<Float32Type>(array, |x| Some(x.into())),
        DataType::Int8 => of::<Int8Type>(array, |x| Some(x.into())),
        DataType::Int16 => of::<Int16Type>(array, |x| Some(x.into())),
        DataType::Int32 => of::<Int32Type>(array, |x| Some(x.into())),
        DataType::UInt8 => of::<UInt8Type>(array, |x| Some(x.into())),
        DataType::UInt16 => of::<UInt16Type>(array, |x| Some(x.into())),
        DataType::UInt32 => of::<UInt32Type>(array, |x| Some(x.into())),
        DataType::Int64 => of::<Int64Type>(array, |x| (x.abs() <= MAX_WHOLE).then_some(x as f64)),
        DataType::UInt64 => of::<UInt64Type>(array, |x| (x <= MAX_WHOLE as u64).then_some(x as f64)),
        DataType::Boolean => Some(
            array
                .as_boolean()
                .iter()
                .map(|cell| cell.map(|yes| f64::from(u8::from(yes))))
                .collect(),
        ),
        DataType::Null => Some(vec![None; array.len()]),
        DataType::Decimal32(_, scale) => of::<Decimal32Type>(array, |x| decimal(x.into(), *scale)),
        DataType::Decimal64(_, scale) => of::<Decimal64Type>(array, |x| decimal(x.into(), *scale)),
        DataType::Decimal128(_, scale) => of::<Decimal128Type>(array, |x| decimal(x, *scale)),
        DataType::Duration(unit) => {
            let seconds = |ticks: i64| decimal(ticks.into(), decimals_of(*unit) as i8);
            match unit {
                TimeUnit::Second => of::<DurationSecondType>(array, seconds),
                TimeUnit::Millisecond => of::<DurationMillisecondType>(array, seconds),
                TimeUnit::Microsecond => of::<DurationMicrosecondType>(array, seconds),
                TimeUnit::Nanosecond => of::<DurationNanosecondType>(array, seconds),
            }
        }
        other => return Err(refuse(format!("`{name}` of {other}"), "numbers: leave the column out, or cast it")),
    };
    found.ok_or_else(|| refuse(format!("`{name}`"), "whole numbers of at most 53 bits: split the column"))
}

/// The codes of an array of whole numbers, `None` for nulls.
fn codes(name: &str, array: &dyn Array, integers: Integers) -> Result<Cells, Error> {
    if *array.data_type() == DataType::Int64 {
        let numbers = array.as_primitive::<Int64Type>().iter();
        return Ok(numbers
            .map(|number| number.map(|number| integers.code(number)))
            .collect());
    }
    let numbers = cells(name, array)?.into_iter();
    let codes: Option<Cells> = numbers
        .map(|number| match number {
            None => Some(None),
            Some(number) => Some(Some(integers.code_of(number)?)),
        })
        .collect();
    codes.ok_or_else(|| ArgumentError::new("column", format!("`{name}`"), "whole numbers of 64 bits").into())
}

/// The times of an array as ticks of `10^-decimals` seconds. Timestamps may have any unit; dates are their midnights; integers are taken as
/// ticks.
///
/// # Errors
/// If the array has no times, one is missing, or a tick overflows.
pub fn ticks(name: &str, array: &dyn Array, decimals: u8) -> Result<Vec<i64>, Error> {
    let refuse = |given: String, expected: &str| -> Error { ArgumentError::new("time", given, expected).into() };
    if array.null_count() > 0 {
        return Err(refuse(format!("`{name}` with gaps"), "a time in every row"));
    }
    if *array.data_type() == DataType::Date32 {
        let day = 86_400 * 10_i64.pow(decimals.into());
        let days = array.as_primitive::<Date32Type>().values().iter();
        let ticks: Option<Vec<i64>> = days.map(|days| i64::from(*days).checked_mul(day)).collect();
        return ticks.ok_or_else(|| {
            refuse(format!("`{name}`"), &format!("dates that fit 64 bits with {decimals} decimals of a second"))
        });
    }
    let (numbers, unit) = match array.data_type() {
        DataType::Date64 => (array.as_primitive::<Date64Type>().values(), Some(TimeUnit::Millisecond)),
        DataType::Int64 => (array.as_primitive::<Int64Type>().values(), None),
        DataType::Timestamp(unit, _) => {
            let values = match unit {
                TimeUnit::Second => array.as_primitive::<TimestampSecondType>().values(),
                TimeUnit::Millisecond => array.as_primitive::<TimestampMillisecondType>().values(),
                TimeUnit::Microsecond => array.as_primitive::<TimestampMicrosecondType>().values(),
                TimeUnit::Nanosecond => array.as_primitive::<TimestampNanosecondType>().values(),
            };
            (values, Some(*unit))
        }
        other => return Err(refuse(format!("`{name}` of {other}"), "timestamps, dates or 64-bit integers")),
    };
    let shift = unit.map_or(0, |unit| i32::from(decimals) - i32::from(decimals_of(unit)));
    let scale = 10_i64.checked_pow(shift.unsigned_abs());
    let scaled = |tick: &i64| match shift {
        0 => Some(*tick),
        1.. => tick.checked_mul(scale?),
        // A coarser unit must divide the tick: no time is rounded.
        _ => Some(*tick)
            .filter(|tick| scale.is_some_and(|scale| tick % scale == 0))
            .zip(scale)
            .map(|(t, s)| t / s),
    };
    let ticks: Option<Vec<i64>> = numbers.iter().map(scaled).collect();
    ticks
        .ok_or_else(|| refuse(format!("`{name}`"), &format!("times that are ticks of {decimals} decimals of a second")))
}

impl<W: Write> Recorder<W> {
    /// Adds the rows of a batch. Its columns are found by name: the time's name or `time` (or `row`), and every column of the schema; others are ignored.
    /// Without times, each row follows the last one.
    ///
    /// # Errors
    /// If a column is missing or has no numbers; as [`push`](Self::push). Rows before the refused one are in the recording.
    pub fn push_batch(&mut self, batch: &RecordBatch) -> Result<(), Error> {
        let array = |name: &str| {
            batch.column_by_name(name).ok_or_else(|| {
                let fields = batch.schema();
                Error::UnknownColumn {
                    name: name.to_owned(),
                    existing: listed(fields.fields().iter().map(|field| field.name().as_str())),
                }
            })
        };
        let ticks = match self.schema().time() {
            TimeBase::Numbered => match batch.column_by_name("row") {
                Some(rows) => ticks("row", rows, 0)?,
                None => (0..batch.num_rows() as i64)
                    .map(|i| self.next_tick().wrapping_add(i))
                    .collect(),
            },
            TimeBase::Clock { decimals, .. } => {
                let own = self.schema().time_name();
                let name = batch.column_by_name(own).map_or("time", |_| own);
                ticks(name, array(name)?, decimals)?
            }
        };
        let columns = self
            .schema()
            .columns()
            .iter()
            .map(|column| match (column.integers, array(column.name())?) {
                (Some(integers), array) => codes(column.name(), array, integers),
                (None, array) => cells(column.name(), array),
            });
        let columns: Vec<Cells> = columns.collect::<Result<_, _>>()?;
        let mut row = Vec::with_capacity(columns.len());
        for (i, tick) in ticks.into_iter().enumerate() {
            row.clear();
            row.extend(columns.iter().map(|cells| cells[i]));
            self.push(tick, &row)?;
        }
        Ok(())
    }
}
