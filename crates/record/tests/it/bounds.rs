//! Bounds relative to each value, bounds of several recordings in a row, and headers of few bytes.

use crate::common::Numbers;
use fewbits_record::{Bound, Column, Playback, Recorder, Schema, TimeBase};
use std::io::Cursor;

fn packed(column: Column, samples: &[f64]) -> Vec<u8> {
    let schema = Schema::new(vec![column], TimeBase::Numbered).unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema);
    samples
        .iter()
        .for_each(|sample| recorder.push_next(&[Some(*sample)]).unwrap());
    recorder.finish().unwrap()
}

fn restored(bytes: &[u8]) -> (Column, Vec<f64>) {
    let mut playback = Playback::new(Cursor::new(bytes)).unwrap();
    let column = playback.schema().columns()[0].clone();
    (column, playback.rows().map(|row| row.unwrap().values[0].unwrap()).collect())
}

/// Samples over many magnitudes, with zeros and both signs.
fn wide(count: usize) -> Vec<f64> {
    let mut numbers = Numbers(11);
    let mut level = 0.0_f64;
    (0..count)
        .map(|i| {
            level = 0.98 * level + numbers.next() - 0.5;
            match i % 83 {
                0 => 0.0,
                1 => -0.0,
                _ => (3.0 * level).exp() * if i % 400 < 40 { -1.0 } else { 1.0 },
            }
        })
        .collect()
}

#[test]
fn relative_bounds_hold_for_every_value() {
    for (share, floor) in [(0.01, 0.001), (0.1, 5.0), (1e-5, 1e-9), (0.5, 1e-3)] {
        for scale in [1e-4, 1.0, 1e4] {
            let samples: Vec<f64> = wide(4000).iter().map(|x| x * scale).collect();
            let bound = Bound::Relative {
                share,
                floor: floor * scale,
            };
            let bytes = packed(Column::new("x", bound).unwrap(), &samples);
            let (column, values) = restored(&bytes);
            assert_eq!(column.bound(), bound);
            for (sample, value) in samples.iter().zip(&values) {
                assert!((value - sample).abs() <= (share * sample.abs()).max(floor * scale), "{sample} {value}");
                assert!(column.keeps(Some(*sample), Some(*value), None));
            }
        }
    }
    // Samples at the ends of the doubles, and those that are constant within the bound.
    let bound = Bound::Relative {
        share: 0.01,
        floor: 1e-300,
    };
    let samples = [f64::MAX, f64::MIN, 5e-324, -5e-324, 1e-300, 1e308, f64::MIN_POSITIVE];
    let (column, values) = restored(&packed(Column::new("x", bound).unwrap(), &samples));
    for (sample, value) in samples.iter().zip(&values) {
        assert!(column.keeps(Some(*sample), Some(*value), None), "{sample} {value}");
    }
    let level: Vec<f64> = (0..1000).map(|i| 100.0 + f64::from(i % 7) * 0.1).collect();
    assert!(
        packed(
            Column::new(
                "x",
                Bound::Relative {
                    share: 0.01,
                    floor: 1e-3
                }
            )
            .unwrap(),
            &level
        )
        .len()
            < 40
    );
}

#[test]
fn relative_bounds_are_tighter_where_values_are_small() {
    let samples = wide(4000);
    let relative = packed(
        Column::new(
            "x",
            Bound::Relative {
                share: 0.01,
                floor: 1e-3,
            },
        )
        .unwrap(),
        &samples,
    );
    let largest = samples.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let absolute = packed(Column::new("x", Bound::Absolute(1e-3)).unwrap(), &samples);
    assert!(largest > 3.0 && 10 * relative.len() < 9 * absolute.len(), "{} {}", relative.len(), absolute.len());
}

#[test]
fn relative_bounds_out_of_range_are_refused() {
    for (share, floor) in [
        (0.0, 1.0),
        (0.6, 1.0),
        (1e-7, 1.0),
        (f64::NAN, 1.0),
        (0.1, 0.0),
        (0.1, -1.0),
        (0.1, f64::NAN),
        (0.1, 1e308),
    ] {
        assert!(Column::new("x", Bound::Relative { share, floor }).is_err(), "{share} {floor}");
    }
    let relative = Column::new("x", Bound::Relative { share: 0.1, floor: 1.0 }).unwrap();
    assert!(relative.clone().with_period(360.0).is_err() && relative.with_earlier_bound(0.1).is_err());
}

#[test]
fn bounds_of_recordings_in_a_row_add_up() {
    let mut numbers = Numbers(5);
    let samples: Vec<f64> = (0..3000)
        .map(|i| 10.0 * (0.01 * f64::from(i)).sin() + numbers.next())
        .collect();
    let (_, first) = restored(&packed(Column::new("x", Bound::Absolute(0.1)).unwrap(), &samples));
    let column = Column::new("x", Bound::Absolute(0.5))
        .unwrap()
        .with_earlier_bound(0.1)
        .unwrap();
    let (column, second) = restored(&packed(column, &first));
    assert_eq!((column.bound(), column.earlier_bound()), (Bound::Absolute(0.5), 0.1));
    let largest = samples
        .iter()
        .zip(&second)
        .fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()));
    assert!(largest > 0.4 && largest <= 0.6, "{largest}");
    for (sample, value) in samples.iter().zip(&second) {
        assert!(column.keeps(Some(*sample), Some(*value), None));
        assert!(!column.keeps(Some(value + 0.6001), Some(*value), None));
    }
    let lossless = Column::new("x", Bound::Lossless)
        .unwrap()
        .with_earlier_bound(0.1)
        .unwrap();
    let (lossless, same) = restored(&packed(lossless, &first));
    assert!(
        same == first
            && samples
                .iter()
                .zip(&same)
                .all(|(a, b)| lossless.keeps(Some(*a), Some(*b), None))
    );
    for earlier in [-0.1, f64::NAN, f64::INFINITY] {
        assert!(
            Column::new("x", Bound::Lossless)
                .unwrap()
                .with_earlier_bound(earlier)
                .is_err()
        );
    }
    assert!(
        Column::new("x", Bound::Decimals(2))
            .unwrap()
            .with_earlier_bound(0.1)
            .is_err()
    );
}

#[test]
fn header_of_a_small_file_takes_24_bytes_beside_names() {
    // Bounds that were computed have many digits.
    let mut numbers = Numbers(3);
    for bound in [0.01, 0.1 / 3.0, 0.01 * 0.667, 2.0_f64.powi(-40), 1e9 / 7.0, 0.1 + 0.2] {
        for period in [None, Some(360.0), Some(std::f64::consts::TAU)] {
            let mut column = Column::new("x", Bound::Absolute(bound)).unwrap();
            if let Some(period) = period.filter(|period| period / bound < 1e10) {
                column = column.with_period(period).unwrap();
            }
            let samples: Vec<f64> = (0..300).map(|_| 9.0 * bound * numbers.next()).collect();
            let bytes = packed(column, &samples);
            let block = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap()[0].bytes;
            let (read, _) = restored(&bytes);
            let Bound::Absolute(stored) = read.bound() else {
                panic!()
            };
            assert!(stored <= bound && stored > 0.9999 * bound, "{bound} {stored}");
            let rest = bytes.len() as u64 - block - "x".len() as u64;
            assert!(rest <= 24, "{bound} {period:?}: {rest} bytes");
        }
    }
}

/// The bound that a header states in fewer digits is not too small for the circle.
#[test]
fn recordings_of_the_smallest_bound_on_a_circle_are_read() {
    let cells = (1_u64 << 40) as f64;
    for share in [1.0, 1.000_001, 1.000_02, 1.5] {
        let bound = 360.0 / cells * share;
        let column = Column::new("direction", Bound::Absolute(bound)).unwrap();
        let samples = [0.1, 359.5, 12.0, 11.9];
        let (column, values) = restored(&packed(column.with_period(360.0).unwrap(), &samples));
        let mut pairs = samples.iter().zip(&values);
        assert!(pairs.all(|(x, value)| column.keeps(Some(*x), Some(*value), None)), "{share}");
        assert!(matches!(column.bound(), Bound::Absolute(stated) if stated <= bound), "{share}");
    }
}
