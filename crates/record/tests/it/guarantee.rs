//! Every sample keeps its promise, whatever its size.

use crate::common::{Cells, Numbers, read, record, row_holds, rows, schema};
use fewbits_record::{Bound, Column, Playback, Recorder, Schema, TimeBase, is_within, is_within_on_circle};
use std::io::Cursor;

fn one(column: Column, rows_per_block: usize, samples: &[f64]) -> (usize, Vec<f64>) {
    let schema = Schema::new(vec![column], TimeBase::Numbered)
        .unwrap()
        .with_rows_per_block(rows_per_block)
        .unwrap();
    let rows: Vec<Cells> = samples.iter().map(|x| vec![Some(*x)]).collect();
    let bytes = record(schema, &rows);
    let restored: Vec<f64> = read(&bytes).into_iter().map(|row| row.values[0].unwrap()).collect();
    assert_eq!(restored.len(), samples.len());
    (bytes.len(), restored)
}

fn signals() -> Vec<Vec<f64>> {
    let mut numbers = Numbers(3);
    let mut wild = |scale: f64| (0..300).map(|_| scale * (numbers.next() - 0.5)).collect::<Vec<f64>>();
    vec![
        vec![0.0, -0.0, 5e-324, -5e-324, 1e-310, f64::MIN_POSITIVE],
        vec![f64::MAX, f64::MIN, 0.0, f64::MAX, 1.0],
        wild(1.0),
        wild(1e-300),
        wild(1e300),
        wild(1e9),
        (0..300).map(|i| 0.1 * f64::from(i % 17)).collect(),
        (0..300).map(|i| 1e16 + f64::from(i)).collect(),
        vec![4.2; 100],
        vec![-0.0; 10],
    ]
}

#[test]
fn absolute_bounds_hold_at_all_magnitudes() {
    for delta in [5e-324, 1e-310, 1e-12, 0.05, 3.0, 1e16, 8e307] {
        for samples in signals() {
            let column = Column::new("x", Bound::Absolute(delta)).unwrap();
            let (_, restored) = one(column, 128, &samples);
            for (sample, value) in samples.iter().zip(&restored) {
                assert!(is_within(*sample, *value, delta), "{delta}: {sample} {value}");
            }
        }
    }
}

#[test]
fn lossless_returns_every_bit() {
    for samples in signals() {
        let (_, restored) = one(Column::new("x", Bound::Lossless).unwrap(), 128, &samples);
        let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
        assert_eq!(bits(&samples), bits(&restored));
    }
}

#[test]
fn decimals_return_exactly_and_others_within_half() {
    for places in [0, 1, 3, 15] {
        let unit = 10_f64.powi(-i32::from(places));
        for samples in signals() {
            let (_, restored) = one(Column::new("x", Bound::Decimals(places)).unwrap(), 128, &samples);
            for (sample, value) in samples.iter().zip(&restored) {
                assert!(is_within(*sample, *value, 0.5 * unit), "{places}: {sample} {value}");
                let ten = 10_f64.powi(i32::from(places));
                let scaled = (sample * ten).round();
                if scaled.abs() < 9e15 && scaled / ten == *sample {
                    assert_eq!(sample, value);
                }
            }
        }
    }
}

#[test]
fn shares_hold_with_the_range_so_far() {
    // The range grows from block to block, from nothing.
    let samples: Vec<f64> = (0..1000)
        .map(|i| if i < 64 { 3.0 } else { 1e-3 * f64::from(i).powi(2) })
        .collect();
    let schema = Schema::new(vec![Column::new("x", Bound::ShareOfRange(0.02)).unwrap()], TimeBase::Numbered).unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema.with_rows_per_block(64).unwrap());
    for sample in &samples {
        recorder.push_next(&[Some(*sample)]).unwrap();
    }
    let bytes = recorder.finish().unwrap();
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    let mut bounds = Vec::new();
    for block in playback.blocks() {
        let block = block.unwrap();
        let bound = block.share_bounds[0].unwrap();
        let end = (*block.ticks.last().unwrap() + 1) as usize;
        let (low, high) = samples[..end]
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        assert!(bound <= 0.02 * (high - low));
        for (tick, value) in block.ticks.iter().zip(&block.columns[0]) {
            assert!(is_within(samples[*tick as usize], value.unwrap(), bound));
        }
        bounds.push(bound);
    }
    assert!(bounds[0] == 0.0 && *bounds.last().unwrap() > 0.7 * 0.02 * 998.0, "{bounds:?}");
}

#[test]
fn circles_hold_around_the_seam() {
    let mut numbers = Numbers(11);
    let mut angle = 350.0;
    let samples: Vec<f64> = (0..600)
        .map(|_| {
            angle += 30.0 * (numbers.next() - 0.4);
            angle
        })
        .collect();
    for delta in [1e-9, 0.5, 20.0] {
        let column = Column::new("x", Bound::Absolute(delta))
            .unwrap()
            .with_period(360.0)
            .unwrap();
        let (_, restored) = one(column, 200, &samples);
        for (sample, value) in samples.iter().zip(&restored) {
            assert!(is_within_on_circle(*sample, *value, delta, 360.0), "{delta}: {sample} {value}");
            assert!((0.0..360.0).contains(value));
        }
    }
}

#[test]
fn gaps_nan_and_infinities_return() {
    let truth = rows(1000);
    let restored = read(&record(schema(128, TimeBase::Numbered), &truth));
    assert_eq!(restored.len(), truth.len());
    for (sample, row) in truth.iter().zip(&restored) {
        assert!(row_holds(sample, &row.values), "{sample:?} {row:?}");
    }
    let odd = f64::from_bits(0x7ff8_0000_dead_beef);
    let cells = [None, Some(odd), Some(f64::NAN), Some(f64::INFINITY), None, Some(1.0)];
    let schema = Schema::new(vec![Column::new("x", Bound::Absolute(1.0)).unwrap()], TimeBase::Numbered).unwrap();
    let bytes = record(schema, &cells.map(|cell| vec![cell]));
    let bits = |cell: Option<f64>| cell.map(f64::to_bits);
    let restored: Vec<_> = read(&bytes).iter().map(|row| bits(row.values[0])).collect();
    assert_eq!(restored[..5], cells.map(bits)[..5]);
}

#[test]
fn instrument_steps_are_found() {
    let mut numbers = Numbers(5);
    // Multiples of 0.0625 are decimals of four places; their step is 625 units of the last.
    let mut level = 0.0;
    let samples: Vec<f64> = (0..2048)
        .map(|_| {
            level += (3.0 * numbers.next() - 1.5).round();
            0.0625 * level
        })
        .collect();
    let (bytes, restored) = one(Column::new("x", Bound::Lossless).unwrap(), 512, &samples);
    assert_eq!(samples, restored);
    assert!(8 * bytes < 3 * samples.len(), "{bytes} bytes");
}
