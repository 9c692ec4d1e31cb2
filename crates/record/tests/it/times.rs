//! Ticks: on a grid, uneven and exact, within a tolerance, at the ends of what a tick can be.

use crate::common::{Numbers, read};
use fewbits_record::{Bound, Column, Playback, Recorder, Schema, TimeBase, TimeFormat};
use std::io::Cursor;

fn restored(ticks: &[i64], tolerance: u64) -> (usize, Vec<i64>) {
    let time = TimeBase::Clock {
        decimals: 9,
        tolerance,
        format: TimeFormat::Seconds,
    };
    let schema = Schema::new(vec![Column::new("x", Bound::Lossless).unwrap()], time).unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema.with_rows_per_block(100).unwrap());
    for tick in ticks {
        recorder.push(*tick, &[Some(1.0)]).unwrap();
    }
    let bytes = recorder.finish().unwrap();
    (bytes.len(), read(&bytes).iter().map(|row| row.tick).collect())
}

#[test]
fn exact_ticks_return() {
    let mut numbers = Numbers(1);
    let mut clock = 1_500_000_000_000_000_000_i64;
    let mut walk = || {
        clock += 1_000_000 * (1.0 + 1e4 * numbers.next()) as i64;
        clock
    };
    let uneven: Vec<i64> = (0..350).map(|_| walk()).collect();
    let even: Vec<i64> = (0..350).map(|i| -5 + 2_000_000_000 * i).collect();
    let mut hole = even.clone();
    hole[130..].iter_mut().for_each(|tick| *tick += 7);
    let ends = vec![i64::MIN, i64::MAX, 0, 0, i64::MIN, 5];
    let back: Vec<i64> = (0..120).map(|i| 40 - i).collect();
    for ticks in [&uneven, &even, &hole, &ends, &back, &vec![9; 230], &vec![i64::MAX]] {
        assert_eq!(&restored(ticks, 0).1, ticks);
    }
    // A grid costs next to nothing; milliseconds at random 16 bits each at most.
    assert!(restored(&even, 0).0 < 200 && restored(&uneven, 0).0 < 300 + 2 * uneven.len());
}

#[test]
fn tolerant_ticks_are_within_it() {
    let mut numbers = Numbers(2);
    let jitter: Vec<i64> = (0..400)
        .map(|i| 1_000_000_000 * i + (1e7 * (2.0 * numbers.next() - 1.0)) as i64)
        .collect();
    let drift: Vec<i64> = (0..400)
        .map(|i| 1_000_000_100 * i + (3e7 * (2.0 * numbers.next() - 1.0)) as i64 + i * i * 5000)
        .collect();
    for ticks in [&jitter, &drift] {
        for tolerance in [1, 1_000, 10_000_000, 25_000_000] {
            let (_, restored) = restored(ticks, tolerance);
            let worst = ticks.iter().zip(&restored).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
            assert!(worst <= tolerance && restored.len() == ticks.len(), "{worst} > {tolerance}");
        }
    }
    assert!(restored(&jitter, 25_000_000).0 < restored(&jitter, 0).0 / 3);
}

#[test]
fn small_tolerance_costs_no_more_than_exact_times() {
    let mut numbers = Numbers(4);
    let seconds: Vec<i64> = (0..300)
        .map(|i| 1_000_000_000 * (600 * i + (60.0 * numbers.next()) as i64))
        .collect();
    let (exact, _) = restored(&seconds, 0);
    for tolerance in [1_000, 1_000_000, 400_000_000] {
        let (bytes, restored) = restored(&seconds, tolerance);
        assert!(bytes <= exact + 8, "{tolerance}: {bytes} bytes, exact {exact}");
        assert_eq!(restored, seconds);
    }
}

/// Times keep their own name, in a recording of one block and of several; frames do not carry it.
#[test]
fn times_keep_their_name() {
    let time = TimeBase::Clock {
        decimals: 0,
        tolerance: 0,
        format: TimeFormat::Utc,
    };
    let column = Column::new("x", Bound::Absolute(0.1)).unwrap();
    let schema = Schema::new(vec![column], time).unwrap();
    assert_eq!(schema.time_name(), "time");
    let written = |schema: &Schema| {
        let mut recorder = Recorder::new(Vec::new(), schema.clone()).with_identity(7);
        (0..100).for_each(|i| recorder.push(60 * i, &[Some(i as f64)]).unwrap());
        recorder.finish().unwrap()
    };
    for rows in [1 << 16, 16] {
        let schema = schema.clone().with_rows_per_block(rows).unwrap();
        let named = schema.clone().with_time_name("Datum").unwrap();
        let bytes = written(&named);
        let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
        assert_eq!((playback.schema(), playback.schema().time_name()), (&named, "Datum"));
        assert_eq!(playback.rows().filter(Result::is_ok).count(), 100);
        let wider = Playback::new(Cursor::new(&bytes))
            .unwrap()
            .widened(&[Some(Bound::Absolute(1.0))])
            .unwrap();
        assert_eq!(wider.unwrap().time_name(), "Datum");
        // The usual name is not stored.
        let usual = schema.clone().with_time_name("time").unwrap();
        assert_eq!(written(&usual), written(&schema));
        assert_eq!(bytes.len(), written(&schema).len() + "Datum".len() + 1);
    }
    assert!(schema.clone().with_time_name("n".repeat(1025)).is_err());
    let rows = Schema::new(vec![Column::new("x", Bound::Lossless).unwrap()], TimeBase::Numbered).unwrap();
    assert_eq!(rows.with_time_name("Datum").unwrap().time_name(), "time");
}
