//! Batches in and out.

use crate::common::{Cells, row_holds, rows, schema};
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{ArrayRef, Float32Array, Int64Array, RecordBatch, StringArray, TimestampMillisecondArray};
use fewbits_record::{Column, Playback, Recorder, Schema, TimeBase, TimeFormat};
use std::io::Cursor;
use std::sync::Arc;

fn batches(bytes: &[u8]) -> Vec<RecordBatch> {
    let mut playback = Playback::new(Cursor::new(bytes)).unwrap();
    let schema = playback.schema().clone();
    playback
        .blocks()
        .map(|block| block.unwrap().to_record_batch(&schema).unwrap())
        .collect()
}

fn utc(decimals: u8) -> Schema {
    let time = TimeBase::Clock {
        decimals,
        tolerance: 0,
        format: TimeFormat::Utc,
    };
    schema(32, time)
}

#[test]
fn recorded_batches_are_recorded_again() {
    for schema in [utc(9), utc(3), utc(4), schema(32, TimeBase::Numbered)] {
        let truth = rows(100);
        let mut recorder = Recorder::new(Vec::new(), schema.clone());
        for (i, row) in truth.iter().enumerate() {
            recorder.push(1_700_000 + 7 * i as i64, row).unwrap();
        }
        let first = batches(&recorder.finish().unwrap());
        let mut again = Recorder::new(Vec::new(), schema);
        first.iter().for_each(|batch| again.push_batch(batch).unwrap());
        let second = batches(&again.finish().unwrap());
        let count: usize = second.iter().map(RecordBatch::num_rows).sum();
        assert_eq!((count, second[0].column(0)), (100, first[0].column(0)));
        let (mut row, mut at) = (Cells::new(), 0);
        for batch in &second {
            for i in 0..batch.num_rows() {
                row.clear();
                let cells = (1..4).map(|c| batch.column(c).as_primitive::<Float64Type>());
                row.extend(cells.map(|cells| cells.iter().nth(i).unwrap()));
                // The wave was coded twice within .05.
                row[0] = row[0]
                    .filter(|wave| !wave.is_finite())
                    .or(truth[at][0].filter(|_| row[0].is_some()));
                assert!(row_holds(&truth[at], &row));
                at += 1;
            }
        }
    }
}

#[test]
fn other_types_and_missing_columns() {
    let arrays = |count: ArrayRef| {
        let time: ArrayRef = Arc::new(TimestampMillisecondArray::from(vec![1, 2]));
        let wave: ArrayRef = Arc::new(Float32Array::from(vec![Some(0.5), None]));
        let price: ArrayRef = Arc::new(Int64Array::from(vec![7, 8]));
        RecordBatch::try_from_iter([("price", price), ("wave", wave), ("count", count), ("time", time)]).unwrap()
    };
    let mut recorder = Recorder::new(Vec::new(), utc(6));
    recorder
        .push_batch(&arrays(Arc::new(Int64Array::from(vec![1 << 53, -1]))))
        .unwrap();
    let mut playback = Playback::new(Cursor::new(recorder.finish().unwrap())).unwrap();
    let read: Vec<_> = playback.rows().collect::<Result<_, _>>().unwrap();
    assert_eq!((read[0].tick, read[1].tick), (1000, 2000));
    assert_eq!(read[1].values, [None, Some(8.0), Some(-1.0)]);
    assert_eq!(read[0].values[2], Some(9_007_199_254_740_992.0));
    let mut recorder = Recorder::new(Vec::new(), utc(6));
    for (count, part) in [
        (Arc::new(Int64Array::from(vec![(1 << 53) + 1, 0])) as ArrayRef, "53 bits"),
        (Arc::new(StringArray::from(vec!["a", "b"])), "`count` of Utf8"),
    ] {
        let message = recorder.push_batch(&arrays(count)).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    let partial = arrays(Arc::new(Int64Array::from(vec![1, 2]))).project(&[0, 3]).unwrap();
    let message = recorder.push_batch(&partial).unwrap_err().to_string();
    assert!(message.contains("`wave`") && message.contains("price, time"), "{message}");
    let mut seconds = Recorder::new(Vec::new(), utc(0));
    let message = seconds
        .push_batch(&arrays(Arc::new(Int64Array::from(vec![1, 2]))))
        .unwrap_err()
        .to_string();
    assert!(message.contains("0 decimals"), "{message}");
}

#[test]
fn whole_numbers_of_64_bits_are_integers() {
    let numbers = [Some(1_i64 << 60), None, Some(-3), Some(i64::MAX)];
    let columns = vec![Column::of_integers("id", 5).unwrap()];
    let schema = Schema::new(columns, TimeBase::Numbered).unwrap();
    let array: ArrayRef = Arc::new(Int64Array::from(numbers.to_vec()));
    let batch = RecordBatch::try_from_iter([("id", array)]).unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema.clone());
    recorder.push_batch(&batch).unwrap();
    let found = batches(&recorder.finish().unwrap());
    assert_eq!(
        found[0].column(1).as_primitive::<arrow_array::types::Int64Type>(),
        &Int64Array::from(numbers.to_vec())
    );
    // Doubles are taken if they are whole.
    let of = |number: f64| -> ArrayRef { Arc::new(arrow_array::Float64Array::from(vec![number])) };
    let mut recorder = Recorder::new(Vec::new(), schema);
    recorder
        .push_batch(&RecordBatch::try_from_iter([("id", of(7.0))]).unwrap())
        .unwrap();
    assert!(
        recorder
            .push_batch(&RecordBatch::try_from_iter([("id", of(7.5))]).unwrap())
            .is_err()
    );
}

/// Decimals and durations are numbers, dates are midnights; what is no exact double is refused.
#[test]
fn decimals_durations_and_dates_are_taken() {
    use arrow_array::{Date32Array, Decimal128Array, DurationMillisecondArray};
    use fewbits_record::arrow::{cells, ticks};
    let prices = Decimal128Array::from(vec![Some(2013), None, Some(-5)])
        .with_precision_and_scale(9, 2)
        .unwrap();
    assert_eq!(cells("x", &prices).unwrap(), [Some(20.13), None, Some(-0.05)]);
    let thousands = Decimal128Array::from(vec![7]).with_precision_and_scale(9, -3).unwrap();
    assert_eq!(cells("x", &thousands).unwrap(), [Some(7000.0)]);
    let long = Decimal128Array::from(vec![1_i128 << 60])
        .with_precision_and_scale(30, 2)
        .unwrap();
    assert!(cells("x", &long).is_err());
    assert_eq!(cells("x", &DurationMillisecondArray::from(vec![Some(1500), None])).unwrap(), [Some(1.5), None]);
    let days = Date32Array::from(vec![-1, 0, 20_454]);
    assert_eq!(ticks("t", &days, 3).unwrap(), [-86_400_000, 0, 1_767_225_600_000]);
    assert!(ticks("t", &Date32Array::from(vec![i32::MAX]), 9).is_err());
}
