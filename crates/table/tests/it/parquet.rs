//! Parquet files, made here of Arrow arrays of every type.

use super::numbers;
use arrow_array::types::Int8Type;
use arrow_array::{
    ArrayRef, BooleanArray, Date32Array, Date64Array, Decimal128Array, DictionaryArray, DurationMillisecondArray,
    Float32Array, Float64Array, Int8Array, Int64Array, LargeStringArray, PrimitiveArray, RecordBatch, StringArray,
    StringViewArray, Time32SecondArray, Time64MicrosecondArray, TimestampMillisecondArray, TimestampNanosecondArray,
    UInt64Array,
};
use fewbits_table::{Batch, Cells, Dialect, Kind, Scale, Table};
use parquet::arrow::ArrowWriter;
use parquet::basic::{BrotliLevel, Compression, GzipLevel};
use parquet::file::properties::WriterProperties;
use std::sync::Arc;

fn file(columns: Vec<(&str, ArrayRef)>, compression: Compression) -> Vec<u8> {
    let batch =
        RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, array)| (name, array, true))).unwrap();
    let properties = WriterProperties::builder().set_compression(compression).build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    bytes
}

fn open(bytes: Vec<u8>) -> Table {
    Table::open_parquet(bytes::Bytes::from(bytes), &Dialect::default()).unwrap()
}

fn all(table: &mut Table) -> Batch {
    let mut batch = Batch::default();
    table.read(&mut batch, 1000).unwrap();
    batch
}

#[test]
fn numbers_of_every_type() {
    let dictionary = DictionaryArray::<Int8Type>::new(
        Int8Array::from(vec![Some(1), None, Some(0)]),
        Arc::new(Float64Array::from(vec![19.75, 20.5])),
    );
    let decimals = Decimal128Array::from(vec![Some(1975), None, Some(-50)])
        .with_precision_and_scale(10, 2)
        .unwrap();
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("f32", Arc::new(Float32Array::from(vec![Some(0.5), None, Some(20.15)]))),
        ("i64", Arc::new(Int64Array::from(vec![Some(5), None, Some(1 << 60)]))),
        ("u64", Arc::new(UInt64Array::from(vec![Some(5), None, Some(1 << 63)]))),
        ("yes", Arc::new(BooleanArray::from(vec![Some(true), None, Some(false)]))),
        ("decimal", Arc::new(decimals)),
        ("dictionary", Arc::new(dictionary)),
        ("text", Arc::new(StringArray::from(vec![Some("1.5"), None, Some("2.5")]))),
        ("large", Arc::new(LargeStringArray::from(vec![Some("1.5"), None, Some("2.5")]))),
        ("view", Arc::new(StringViewArray::from(vec![Some("1.5"), None, Some("2.5")]))),
    ];
    let expected = [
        [0.5, f64::from(20.15_f32)],
        [5.0, 1_152_921_504_606_846_976.0],
        [5.0, 9_223_372_036_854_775_808.0],
        [1.0, 0.0],
        [19.75, -0.5],
        [20.5, 19.75],
        [1.5, 2.5],
        [1.5, 2.5],
        [1.5, 2.5],
    ];
    let gzip = Compression::GZIP(GzipLevel::default());
    for compression in [
        Compression::SNAPPY,
        gzip,
        Compression::LZ4_RAW,
        Compression::BROTLI(BrotliLevel::default()),
    ] {
        let mut table = open(file(columns.clone(), compression));
        let batch = all(&mut table);
        for ((cells, expected), (name, _)) in batch.columns.iter().zip(&expected).zip(&columns) {
            assert_eq!(numbers(cells), [Some(expected[0]), None, Some(expected[1])], "{name}");
        }
    }
}

#[test]
fn halves_are_read() {
    // 0x4CF0 is 19.75: exponent 4, fraction 240 / 1024.
    let halves = PrimitiveArray::<arrow_array::types::Float16Type>::from_iter_values([0x4CF0, 0xB800].map(half_of));
    let batch = all(&mut open(file(vec![("f16", Arc::new(halves))], Compression::SNAPPY)));
    assert_eq!(batch.columns[0], Cells::Numbers(vec![Some(19.75), Some(-0.5)]));
}

fn half_of(bits: u16) -> <arrow_array::types::Float16Type as arrow_array::ArrowPrimitiveType>::Native {
    <arrow_array::types::Float16Type as arrow_array::ArrowPrimitiveType>::Native::from_bits(bits)
}

#[test]
fn times_of_every_type() {
    let columns: Vec<(&str, ArrayRef, Scale, f64)> = vec![
        (
            "ns",
            Arc::new(TimestampNanosecondArray::from(vec![1_700_000_000_250_000_000])),
            Scale::Local,
            1_700_000_000.25,
        ),
        (
            "utc",
            Arc::new(TimestampMillisecondArray::from(vec![-631_152_000_000]).with_timezone("Europe/Berlin")),
            Scale::Utc,
            -631_152_000.0,
        ),
        ("date32", Arc::new(Date32Array::from(vec![-1])), Scale::Local, -86_400.0),
        ("date64", Arc::new(Date64Array::from(vec![86_400_000])), Scale::Local, 86_400.0),
        ("time32", Arc::new(Time32SecondArray::from(vec![61])), Scale::Seconds, 61.0),
        ("time64", Arc::new(Time64MicrosecondArray::from(vec![1_500_000])), Scale::Seconds, 1.5),
        ("duration", Arc::new(DurationMillisecondArray::from(vec![-250])), Scale::Seconds, -0.25),
        ("float", Arc::new(Float64Array::from(vec![0.1])), Scale::Seconds, 0.1),
        ("text", Arc::new(StringArray::from(vec!["2023-11-14T22:13:20Z"])), Scale::Utc, 1_700_000_000.0),
    ];
    for (name, array, scale, seconds) in columns {
        let value: ArrayRef = Arc::new(Float64Array::from(vec![7.0]));
        let mut table = open(file(vec![("x", value), (name, array)], Compression::SNAPPY));
        table.set_time(&[name]).unwrap();
        let batch = all(&mut table);
        assert_eq!((table.time().unwrap().1, batch.times[0].seconds()), (scale, seconds), "{name}");
        assert_eq!(batch.columns, [Cells::Numbers(vec![Some(7.0)])]);
    }
}

#[test]
fn a_whole_number_is_no_date() {
    let mut table = open(file(vec![("mask", Arc::new(Int64Array::from(vec![(1 << 60) + 1, 3])))], Compression::SNAPPY));
    assert_eq!(table.columns()[0].kind, Kind::Integer);
    assert_eq!(all(&mut table).columns[0].number(0), Err("1152921504606846977".to_owned()));
}

#[test]
fn types_that_cannot_be_read_are_named_when_they_are_asked_for() {
    let list =
        arrow_array::ListArray::from_iter_primitive::<arrow_array::types::Int32Type, _, _>(vec![Some(vec![Some(1)])]);
    let columns: Vec<(&str, ArrayRef)> = vec![("x", Arc::new(Float64Array::from(vec![1.5]))), ("pair", Arc::new(list))];
    let bytes = file(columns, Compression::SNAPPY);
    let message = open(bytes.clone())
        .read(&mut Batch::default(), 10)
        .unwrap_err()
        .to_string();
    assert!(message.contains("`pair`") && message.contains("List") && message.contains("--without"), "{message}");
    let mut table = open(bytes);
    table.leave_out(&["pair"]).unwrap();
    assert_eq!(all(&mut table).columns, [Cells::Numbers(vec![Some(1.5)])]);
}

#[test]
fn a_survey_counts_all_rows() {
    let texts = StringArray::from(
        (0..50)
            .map(|i| if i % 2 == 0 { "on" } else { "auto" })
            .collect::<Vec<_>>(),
    );
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time", Arc::new(TimestampMillisecondArray::from_iter_values((0..50).map(|i| 1000 * i)))),
        ("x", Arc::new(Float64Array::from_iter_values((0..50).map(f64::from)))),
        ("mode", Arc::new(texts)),
    ];
    let mut table = open(file(columns, Compression::SNAPPY));
    assert!(table.find_time().unwrap());
    let survey = table.survey().unwrap();
    assert_eq!((survey.rows, survey.columns[1].range, survey.columns[2].words["auto"]), (50, Some((0.0, 49.0)), 25));
    assert_eq!(survey.times.steps, Some((1.0, 1.0)));
}

#[test]
fn damaged_files_are_refused() {
    let bytes = file(vec![("x", Arc::new(Float64Array::from(vec![1.5; 100])))], Compression::SNAPPY);
    for cut in [0, 4, 20, bytes.len() - 9] {
        assert!(Table::open_parquet(bytes::Bytes::from(bytes[..cut].to_vec()), &Dialect::default()).is_err());
    }
}

/// No flipped bit makes a panic: not negative places of pages either, which the reader below takes for granted.
#[test]
fn every_flipped_bit_is_an_error_or_values() {
    let words = StringArray::from(vec!["on", "off", "on"]);
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("x", Arc::new(Float64Array::from(vec![1.5, 2.5, 3.5]))),
        ("mode", Arc::new(words)),
    ];
    let bytes = file(columns, Compression::SNAPPY);
    let mut refused = 0;
    for bit in 0..8 * bytes.len() {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let read = Table::open_parquet(bytes::Bytes::from(damaged), &Dialect::default())
            .and_then(|mut table| table.read(&mut Batch::default(), 10));
        refused += usize::from(read.is_err());
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn whole_numbers_beyond_64_bits_with_a_sign_name_their_row() {
    let columns = || -> Vec<(&str, ArrayRef)> {
        vec![
            ("t", Arc::new(Int64Array::from(vec![1, 2, 3]))),
            ("u", Arc::new(UInt64Array::from(vec![1, u64::MAX, 5]))),
        ]
    };
    let mut table = open(file(columns(), Compression::SNAPPY));
    assert_eq!(table.read(&mut Batch::default(), 1).unwrap(), 1);
    let said = table.read(&mut Batch::default(), 10).unwrap_err().to_string();
    assert!(said.contains("row 2, column `u`: `18446744073709551615` is a whole number"), "{said}");
    let missing = Dialect {
        missing: vec![u64::MAX.to_string()],
        ..Dialect::default()
    };
    let bytes = bytes::Bytes::from(file(columns(), Compression::SNAPPY));
    let batch = all(&mut Table::open_parquet(bytes, &missing).unwrap());
    assert_eq!(numbers(&batch.columns[1]), [Some(1.0), None, Some(5.0)]);
}

/// A file of pyarrow with the checksums of its pages: no flipped bit of a value passes.
#[test]
fn pages_that_disagree_with_their_checksum_are_refused() {
    let bytes = include_bytes!("../fixtures/checksums.parquet");
    let values = [1.5_f64, 2.5, 3.5];
    assert_eq!(numbers(&all(&mut open(bytes.to_vec())).columns[0]), values.map(Some));
    let first = bytes
        .windows(8)
        .position(|eight| eight == 1.5_f64.to_le_bytes())
        .unwrap();
    for bit in 8 * first..8 * (first + 8 * values.len()) {
        let mut damaged = bytes.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let read = Table::open_parquet(bytes::Bytes::from(damaged), &Dialect::default())
            .and_then(|mut table| table.read(&mut Batch::default(), 10));
        assert!(read.is_err(), "bit {bit}");
    }
}

#[test]
fn columns_without_rows_keep_their_times() {
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("t", Arc::new(TimestampMillisecondArray::from(Vec::<i64>::new()))),
        ("v", Arc::new(Float64Array::from(Vec::<f64>::new()))),
    ];
    let mut table = open(file(columns, Compression::UNCOMPRESSED));
    assert!(table.find_time().unwrap());
    assert_eq!(table.survey().unwrap().rows, 0);
}
