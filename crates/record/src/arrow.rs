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
use crate::column::Column;
use crate::error::{Error, ensure, listed};
use crate::integers::Integers;
use crate::recorder::Recorder;
use crate::schema::{Schema, TimeBase, TimeFormat};
use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Decimal32Type, Decimal64Type, Decimal128Type, Float32Type, Float64Type, Int8Type,
    Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, Float64Array, Int64Array, RecordBatch, make_array};
use arrow_schema::{DataType, Field, TimeUnit};
use fewbits_block_codec::ArgumentError;
use std::collections::HashMap;
use std::io::Write;
use std::sync::Arc;

/// Integers up to this size are exact doubles.
const MAX_WHOLE: i64 = 1 << 53;

const UNITS: [(u8, TimeUnit); 4] = [
    (0, TimeUnit::Second),
    (3, TimeUnit::Millisecond),
    (6, TimeUnit::Microsecond),
    (9, TimeUnit::Nanosecond),
];

fn decimals_of(unit: TimeUnit) -> u8 {
    let found = UNITS.iter().find(|(_, own)| *own == unit);
    found.map_or(0, |(decimals, _)| *decimals)
}

/// The type of times: timestamps with as many decimals as the ticks if there are such, and ticks otherwise.
fn type_of(time: TimeBase) -> DataType {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return DataType::Int64;
    };
    let unit = UNITS.iter().find(|(own, _)| *own == decimals);
    match (format, unit) {
        (TimeFormat::Utc, Some((_, unit))) => DataType::Timestamp(*unit, Some("UTC".into())),
        (TimeFormat::Local, Some((_, unit))) => DataType::Timestamp(*unit, None),
        _ => DataType::Int64,
    }
}

/// Cells of 64 bits as another type of 64 bits.
fn retyped(array: &dyn Array, kind: DataType) -> Result<ArrayRef, Error> {
    Ok(make_array(array.to_data().into_builder().data_type(kind).build()?))
}

impl Schema {
    /// The fields of batches of this recording. Units, and the decimals of ticks, are in the metadata.
    pub fn to_arrow(&self) -> arrow_schema::Schema {
        let field = |name: &str, kind, is_nullable, metadata: Option<(&str, String)>| {
            let metadata = metadata.map(|(key, value)| (key.to_owned(), value));
            Field::new(name, kind, is_nullable).with_metadata(HashMap::from_iter(metadata))
        };
        let kind = type_of(self.time);
        let time = match self.time {
            TimeBase::Numbered => field("row", kind, false, None),
            TimeBase::Clock { decimals, .. } => {
                let ticks = (kind == DataType::Int64).then(|| ("decimals", decimals.to_string()));
                field("time", kind, false, ticks)
            }
        };
        let columns = self.columns.iter().map(|column| {
            let kind = match column.integers {
                None => DataType::Float64,
                Some(_) => DataType::Int64,
            };
            let unit = (!column.unit.is_empty()).then(|| ("unit", column.unit.clone()));
            field(&column.name, kind, true, unit)
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
        let (given, wanted) = (self.columns.len(), schema.columns.len());
        ensure!(given == wanted, "schema", format!("{given} columns"), format!("{wanted}"));
        let ticks = Int64Array::from_iter_values(self.ticks.iter().copied());
        let time = retyped(&ticks, type_of(schema.time))?;
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

/// The double nearest to `unscaled 10^-scale`; nothing for more than 53 bits.
fn decimal(unscaled: i128, scale: i8) -> Option<f64> {
    let (number, power) = (unscaled as f64, 10_f64.powi(i32::from(scale).abs()));
    let exact = unscaled.unsigned_abs() <= MAX_WHOLE as u128;
    exact.then_some(if scale < 0 { number * power } else { number / power })
}

/// The cells of an array of numbers, `None` for nulls. Decimals become the nearest doubles, durations seconds.
///
/// # Errors
/// If the array has no numbers, or one of more than 53 bits, which is not an exact double.
pub fn cells(name: &str, array: &dyn Array) -> Result<Cells, Error> {
    fn of<T: ArrowPrimitiveType>(array: &dyn Array, number: impl Fn(T::Native) -> Option<f64>) -> Option<Cells> {
        let cells = array.as_primitive::<T>().iter();
        cells
            .map(|cell| cell.map_or(Some(None), |cell| number(cell).map(Some)))
            .collect()
    }
    let bit = |cell: Option<bool>| cell.map(|yes| f64::from(u8::from(yes)));
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
        DataType::Boolean => Some(array.as_boolean().iter().map(bit).collect()),
        DataType::Null => Some(vec![None; array.len()]),
        DataType::Decimal32(_, scale) => of::<Decimal32Type>(array, |x| decimal(x.into(), *scale)),
        DataType::Decimal64(_, scale) => of::<Decimal64Type>(array, |x| decimal(x.into(), *scale)),
        DataType::Decimal128(_, scale) => of::<Decimal128Type>(array, |x| decimal(x, *scale)),
        DataType::Duration(unit) => {
            let seconds = |ticks: i64| decimal(ticks.into(), decimals_of(*unit) as i8);
            of::<Int64Type>(&retyped(array, DataType::Int64)?, seconds)
        }
        other => return Err(refuse(format!("`{name}` of {other}"), "numbers: leave the column out, or cast it")),
    };
    found.ok_or_else(|| refuse(format!("`{name}`"), "whole numbers of at most 53 bits: split the column"))
}

/// The codes of an array of whole numbers, `None` for nulls.
fn codes(name: &str, array: &dyn Array, integers: Integers) -> Result<Cells, Error> {
    if *array.data_type() == DataType::Int64 {
        let numbers = array.as_primitive::<Int64Type>().iter();
        let code = |number: Option<i64>| number.map(|number| integers.code(number));
        return Ok(numbers.map(code).collect());
    }
    let numbers = cells(name, array)?.into_iter();
    let code = |number: Option<f64>| number.map_or(Some(None), |number| integers.code_of(number).map(Some));
    let codes: Option<Cells> = numbers.map(code).collect();
    codes.ok_or_else(|| ArgumentError::new("column", format!("`{name}`"), "whole numbers of 64 bits").into())
}

/// The times of an array as ticks of `10^-decimals` seconds. Timestamps may have any unit; dates are their midnights; integers are taken as
/// ticks.
///
/// # Errors
/// If the array has no times, one is missing, or a tick overflows.
pub fn ticks(name: &str, array: &dyn Array, decimals: u8) -> Result<Vec<i64>, Error> {
    let refuse = |given: String, expected: &str| -> Error { ArgumentError::new("time", given, expected).into() };
    ensure!(array.null_count() == 0, refuse(format!("`{name}` with gaps"), "a time in every row"));
    let refused = || refuse(format!("`{name}`"), &format!("times that are ticks of {decimals} decimals of a second"));
    let unit = match array.data_type() {
        DataType::Date32 => {
            let days = array.as_primitive::<Date32Type>().values().iter();
            let day = 86_400 * 10_i64.pow(decimals.into());
            let ticks: Option<Vec<i64>> = days.map(|days| i64::from(*days).checked_mul(day)).collect();
            return ticks.ok_or_else(refused);
        }
        DataType::Date64 => Some(TimeUnit::Millisecond),
        DataType::Int64 => None,
        DataType::Timestamp(unit, _) => Some(*unit),
        other => return Err(refuse(format!("`{name}` of {other}"), "timestamps, dates or 64-bit integers")),
    };
    let shift = unit.map_or(0, |unit| i32::from(decimals) - i32::from(decimals_of(unit)));
    let scale = 10_i64.checked_pow(shift.unsigned_abs());
    let scaled = |tick: &i64| match shift {
        0 => Some(*tick),
        1.. => tick.checked_mul(scale?),
        // A coarser unit must divide the tick: no time is rounded.
        _ => scale.filter(|scale| tick % scale == 0).map(|scale| tick / scale),
    };
    let numbers = retyped(array, DataType::Int64)?;
    let numbers = numbers.as_primitive::<Int64Type>().values().iter();
    numbers.map(scaled).collect::<Option<_>>().ok_or_else(refused)
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
        let found = |column: &Column| match (column.integers, array(column.name())?) {
            (Some(integers), array) => codes(column.name(), array, integers),
            (None, array) => cells(column.name(), array),
        };
        let columns: Vec<Cells> = self.schema().columns().iter().map(found).collect::<Result<_, _>>()?;
        self.push_columns(&ticks, &columns)
    }
}
