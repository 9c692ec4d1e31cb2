//! Arrow arrays as cells, without a detour through text. Only arrays of text are read as text.

use crate::column::{Cells, Kind};
use crate::error::Error;
use crate::number::{self, Number};
use crate::time::{Scale, Time};
use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Date64Type, Decimal32Type, Decimal64Type, Decimal128Type, Decimal256Type,
    DurationMicrosecondType, DurationMillisecondType, DurationNanosecondType, DurationSecondType, Float16Type,
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, Time32MillisecondType, Time32SecondType,
    Time64MicrosecondType, Time64NanosecondType, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef};
use arrow_schema::{DataType, Field, TimeUnit};

/// Cells of an array.
#[derive(Debug, Clone)]
pub(crate) enum Decoded {
    Cells(Cells),
    Texts(Vec<Option<String>>),
}

/// The kind of cells of a type; `None` for text, whose kind its cells decide. `Err` if the type cannot be read.
pub(crate) fn kind_of(kind: &DataType) -> Result<Option<Kind>, ()> {
    Ok(Some(match kind {
        DataType::Null | DataType::Float16 | DataType::Float32 | DataType::Float64 => Kind::Number,
        DataType::Int8 | DataType::Int16 | DataType::Int32 | DataType::UInt8 | DataType::UInt16 | DataType::UInt32 => {
            Kind::Number
        }
        // A profile tells whether all are doubles.
        DataType::Int64 | DataType::UInt64 => Kind::Integer,
        DataType::Decimal32(..) | DataType::Decimal64(..) | DataType::Decimal128(..) | DataType::Decimal256(..) => {
            Kind::Number
        }
        DataType::Boolean => Kind::Boolean,
        DataType::Timestamp(..) | DataType::Date32 | DataType::Date64 => Kind::Time,
        DataType::Time32(_) | DataType::Time64(_) | DataType::Duration(_) => Kind::Time,
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => return Ok(None),
        DataType::Dictionary(_, values) => return kind_of(values),
        _ => return Err(()),
    }))
}

/// What times of a type are measured from.
pub(crate) fn scale_of(kind: &DataType) -> Option<Scale> {
    match kind {
        DataType::Timestamp(_, Some(_)) => Some(Scale::Utc),
        DataType::Timestamp(_, None) | DataType::Date32 | DataType::Date64 => Some(Scale::Local),
        DataType::Time32(_) | DataType::Time64(_) | DataType::Duration(_) => Some(Scale::Seconds),
        DataType::Dictionary(_, values) => scale_of(values),
        _ => None,
    }
}

/// The refusal of a column by the name of its type.
pub(crate) fn refused(field: &Field) -> Error {
    Error::Type {
        column: crate::error::printable(field.name()),
        kind: field.data_type().to_string(),
        mend: "leave it out with --without, or cast it to numbers, times or text",
    }
}

fn decimals_of(unit: TimeUnit) -> u8 {
    match unit {
        TimeUnit::Second => 0,
        TimeUnit::Millisecond => 3,
        TimeUnit::Microsecond => 6,
        TimeUnit::Nanosecond => 9,
    }
}

fn each<T: ArrowPrimitiveType, U>(array: &dyn Array, cell: impl Fn(T::Native) -> U) -> Vec<Option<U>> {
    array.as_primitive::<T>().iter().map(|value| value.map(&cell)).collect()
}

fn numbers<T: ArrowPrimitiveType>(array: &dyn Array, cell: impl Fn(T::Native) -> f64) -> Option<Decoded> {
    Some(Decoded::Cells(Cells::Numbers(each::<T, f64>(array, cell))))
}

fn times<T: ArrowPrimitiveType>(array: &dyn Array, decimals: u8) -> Option<Decoded>
where
    T::Native: Into<i64>,
{
    Some(Decoded::Cells(Cells::Times(each::<T, Time>(array, |ticks| {
        Time::from_ticks(ticks.into(), decimals)
    }))))
}

/// Decimals of a fixed scale, each the nearest double; `None` if one is a whole number that is no double.
fn decimals<T: ArrowPrimitiveType>(
    array: &dyn Array,
    scale: i8,
    wide: impl Fn(T::Native) -> Option<i128>,
) -> Option<Decoded> {
    let number = |value: T::Native| {
        let value = wide(value)?;
        let (sign, size) = (if value < 0 { "-" } else { "" }, value.unsigned_abs().to_string());
        let places = usize::try_from(scale).unwrap_or(0);
        let text = if scale < 0 {
            format!("{sign}{size}{}", "0".repeat(usize::from(scale.unsigned_abs())))
        } else {
            let padded = format!("{size:0>width$}", width = places + 1);
            let (whole, rest) = padded.split_at(padded.len() - places);
            format!("{sign}{whole}.{rest}")
        };
        match number::parse(text.as_bytes(), number::Syntax::default()) {
            Ok(Number::Double(value, _)) => Some(value),
            _ => None,
        }
    };
    let cells = each::<T, Option<f64>>(array, number);
    let cells = cells.into_iter().map(|cell| match cell {
        None => Some(None),
        Some(value) => value.map(Some),
    });
    Some(Decoded::Cells(Cells::Numbers(cells.collect::<Option<_>>()?)))
}

/// The cells of an array.
///
/// # Errors
/// If its type cannot be read.
pub(crate) fn decode(field: &Field, array: &ArrayRef) -> Result<Decoded, Error> {
    // Whole ticks of seconds, as older versions of the command `fewbits` wrote them.
    if let Some(decimals) = field
        .metadata()
        .get("decimals")
        .and_then(|decimals| decimals.parse::<u8>().ok())
        && *array.data_type() == DataType::Int64
    {
        return times::<Int64Type>(array, decimals).ok_or_else(|| refused(field));
    }
    if let Some(dictionary) = array.as_any_dictionary_opt() {
        let values =
            decode(&Field::new(field.name(), dictionary.values().data_type().clone(), true), dictionary.values())?;
        let keys = dictionary.normalized_keys();
        let picked = |row: usize| (!dictionary.keys().is_null(row)).then(|| keys[row]);
        return Ok(taken(&values, (0..array.len()).map(picked).collect()));
    }
    plain(array).ok_or_else(|| refused(field))
}

/// Cells at these places.
fn taken(values: &Decoded, places: Vec<Option<usize>>) -> Decoded {
    fn of<T: Clone>(cells: &[Option<T>], places: Vec<Option<usize>>) -> Vec<Option<T>> {
        places
            .into_iter()
            .map(|place| place.and_then(|place| cells.get(place).cloned().flatten()))
            .collect()
    }
    match values {
        Decoded::Texts(texts) => Decoded::Texts(of(texts, places)),
        Decoded::Cells(cells) => Decoded::Cells(match cells {
            Cells::Numbers(cells) => Cells::Numbers(of(cells, places)),
            Cells::Integers(cells) => Cells::Integers(of(cells, places)),
            Cells::Booleans(cells) => Cells::Booleans(of(cells, places)),
            Cells::Words(cells) => Cells::Words(of(cells, places)),
            Cells::Times(cells) => Cells::Times(of(cells, places)),
        }),
    }
}

fn plain(array: &ArrayRef) -> Option<Decoded> {
    use TimeUnit::{Microsecond, Millisecond, Nanosecond, Second};
    let texts = |texts: Vec<Option<&str>>| {
        Some(Decoded::Texts(texts.into_iter().map(|text| text.map(str::to_owned)).collect()))
    };
    match array.data_type() {
        DataType::Null => Some(Decoded::Cells(Cells::Numbers(vec![None; array.len()]))),
        DataType::Float64 => numbers::<Float64Type>(array, |x| x),
        DataType::Float32 => numbers::<Float32Type>(array, f64::from),
        DataType::Float16 => numbers::<Float16Type>(array, |x| x.to_f64()),
        DataType::Int8 => numbers::<Int8Type>(array, f64::from),
        DataType::Int16 => numbers::<Int16Type>(array, f64::from),
        DataType::Int32 => numbers::<Int32Type>(array, f64::from),
        DataType::UInt8 => numbers::<UInt8Type>(array, f64::from),
        DataType::UInt16 => numbers::<UInt16Type>(array, f64::from),
        DataType::UInt32 => numbers::<UInt32Type>(array, f64::from),
        DataType::Int64 => Some(Decoded::Cells(Cells::Integers(each::<Int64Type, i64>(array, |x| x)))),
        DataType::UInt64 => {
            let whole = each::<UInt64Type, u64>(array, |x| x);
            let signed: Option<Vec<Option<i64>>> = whole
                .iter()
                .map(|cell| cell.map_or(Some(None), |x| i64::try_from(x).ok().map(Some)))
                .collect();
            if let Some(signed) = signed {
                return Some(Decoded::Cells(Cells::Integers(signed)));
            }
            let exact = |x: u64| ((x as f64) as u128 == u128::from(x)).then_some(x as f64);
            let doubles = whole.iter().map(|cell| cell.map_or(Some(None), |x| exact(x).map(Some)));
            Some(match doubles.collect::<Option<_>>() {
                Some(doubles) => Decoded::Cells(Cells::Numbers(doubles)),
                // As text, so that the refusal has the cell and its row, and the cell may be named as a gap.
                None => Decoded::Texts(whole.into_iter().map(|cell| cell.map(|x| x.to_string())).collect()),
            })
        }
        DataType::Decimal32(_, scale) => decimals::<Decimal32Type>(array, *scale, |x| Some(x.into())),
        DataType::Decimal64(_, scale) => decimals::<Decimal64Type>(array, *scale, |x| Some(x.into())),
        DataType::Decimal128(_, scale) => decimals::<Decimal128Type>(array, *scale, Some),
        DataType::Decimal256(_, scale) => decimals::<Decimal256Type>(array, *scale, |x| x.to_i128()),
        DataType::Boolean => Some(Decoded::Cells(Cells::Booleans(array.as_boolean().iter().collect()))),
        DataType::Timestamp(unit, _) => match unit {
            Second => times::<TimestampSecondType>(array, decimals_of(*unit)),
            Millisecond => times::<TimestampMillisecondType>(array, decimals_of(*unit)),
            Microsecond => times::<TimestampMicrosecondType>(array, decimals_of(*unit)),
            Nanosecond => times::<TimestampNanosecondType>(array, decimals_of(*unit)),
        },
        DataType::Date32 => Some(Decoded::Cells(Cells::Times(each::<Date32Type, Time>(array, |days| {
            Time::from_ticks(i64::from(days) * 86_400, 0)
        })))),
        DataType::Date64 => times::<Date64Type>(array, 3),
        DataType::Time32(Second) => times::<Time32SecondType>(array, 0),
        DataType::Time32(_) => times::<Time32MillisecondType>(array, 3),
        DataType::Time64(Nanosecond) => times::<Time64NanosecondType>(array, 9),
        DataType::Time64(_) => times::<Time64MicrosecondType>(array, 6),
        DataType::Duration(unit) => match unit {
            Second => times::<DurationSecondType>(array, decimals_of(*unit)),
            Millisecond => times::<DurationMillisecondType>(array, decimals_of(*unit)),
            Microsecond => times::<DurationMicrosecondType>(array, decimals_of(*unit)),
            Nanosecond => times::<DurationNanosecondType>(array, decimals_of(*unit)),
        },
        DataType::Utf8 => texts(array.as_string::<i32>().iter().collect()),
        DataType::LargeUtf8 => texts(array.as_string::<i64>().iter().collect()),
        DataType::Utf8View => texts(array.as_string_view().iter().collect()),
        _ => None,
    }
}
