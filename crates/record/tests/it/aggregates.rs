//! Minimum, maximum, number and mean of stretches of time, by the index where it has them.

use crate::common::{Cells, Numbers};
use fewbits_record::{Aggregate, Bound, Column, Playback, Recorder, Schema, TimeBase, TimeFormat};
use std::cell::Cell;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::rc::Rc;

/// Counts the bytes that are read.
struct Counted<R>(R, Rc<Cell<u64>>);

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let read = self.0.read(bytes)?;
        self.1.set(self.1.get() + read as u64);
        Ok(read)
    }
}

impl<R: Seek> Seek for Counted<R> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.0.seek(to)
    }
}

fn schema(rows_per_block: usize, tolerance: u64) -> Schema {
    let columns = vec![
        Column::new("wave", Bound::Absolute(0.05)).unwrap(),
        Column::new("state", Bound::Lossless).unwrap(),
        Column::new("none", Bound::Lossless).unwrap(),
    ];
    let time = TimeBase::Clock {
        decimals: 0,
        tolerance,
        format: TimeFormat::Utc,
    };
    Schema::new(columns, time)
        .unwrap()
        .with_rows_per_block(rows_per_block)
        .unwrap()
}

/// Rows with gaps, NaN and a pause.
fn rows(count: usize) -> Vec<(i64, Cells)> {
    let mut numbers = Numbers(3);
    (0..count)
        .map(|i| {
            let wave = match i % 97 {
                5 => None,
                9 => Some(f64::NAN),
                _ => Some(20.0 + 5.0 * (1e-3 * i as f64).sin() + 0.3 * numbers.next()),
            };
            let pause = if i > count / 2 { 5000 } else { 0 };
            (-700 + 2 * i as i64 + pause, vec![wave, Some((i / 3000) as f64), None])
        })
        .collect()
}

fn recorded(schema: Schema, rows: &[(i64, Cells)]) -> Vec<u8> {
    let mut recorder = Recorder::new(Vec::new(), schema);
    for (tick, cells) in rows {
        recorder.push(*tick, cells).unwrap();
    }
    recorder.finish().unwrap()
}

#[test]
fn stretches_are_those_of_the_rows() {
    let rows = rows(30_000);
    // Blocks with aggregates in the index, blocks without, a single block, and times within a tolerance.
    for (rows_per_block, tolerance) in [(4096, 0), (500, 0), (1 << 16, 0), (4096, 3)] {
        let bytes = recorded(schema(rows_per_block, tolerance), &rows);
        for (every, ticks) in [
            (3600, (i64::MIN, i64::MAX)),
            (50_000, (i64::MIN, i64::MAX)),
            (10_000, (12_345, 54_321)),
            (1 << 40, (i64::MIN, i64::MAX)),
        ] {
            let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
            let read: Vec<_> = playback.rows().map(Result::unwrap).collect();
            let found = playback.aggregates(every, ticks, |error| panic!("{error}")).unwrap();
            let mut expected = std::collections::BTreeMap::<i64, Vec<&[Option<f64>]>>::new();
            for row in read.iter().filter(|row| (ticks.0..=ticks.1).contains(&row.tick)) {
                expected
                    .entry(row.tick.div_euclid(every as i64))
                    .or_default()
                    .push(&row.values);
            }
            assert_eq!(found.len(), expected.len());
            for (stretch, (number, rows)) in found.iter().zip(&expected) {
                assert_eq!((stretch.tick, stretch.rows), (number * every as i64, rows.len() as u64));
                for (i, aggregate) in stretch.columns.iter().enumerate() {
                    let values: Vec<f64> = rows.iter().filter_map(|row| row[i]).filter(|x| x.is_finite()).collect();
                    assert_eq!(aggregate.count(), values.len() as u64);
                    let ends = values
                        .iter()
                        .fold((f64::MAX, f64::MIN), |(l, h), x| (x.min(l), x.max(h)));
                    assert_eq!(aggregate.ends(), (!values.is_empty()).then_some(ends));
                    let mean = values.iter().sum::<f64>() / values.len() as f64;
                    assert!(
                        aggregate
                            .mean()
                            .is_none_or(|found| (found - mean).abs() < 1e-12 * mean.abs().max(1.0))
                    );
                }
            }
        }
    }
}

#[test]
fn long_stretches_are_read_from_the_index() {
    let rows = rows(60_000);
    let bytes = recorded(schema(4096, 0), &rows);
    let read = Rc::new(Cell::new(0));
    let mut playback = Playback::new(Counted(Cursor::new(&bytes), read.clone())).unwrap();
    playback.columns(&["wave"]).unwrap();
    let found = playback
        .aggregates(1 << 40, (i64::MIN, i64::MAX), |error| panic!("{error}"))
        .unwrap();
    let sum: u64 = found.iter().map(|stretch| stretch.rows).sum();
    // One block lies on both sides of tick 0. The recording's header is read in one chunk.
    assert!(
        sum == 60_000 && read.get() < (1 << 16) + bytes.len() as u64 / 4,
        "{} of {}",
        read.get(),
        bytes.len()
    );
}

#[test]
fn a_hundredth_of_the_time_takes_two_hundredths_of_the_bytes() {
    // The proportions of 10^8 rows in blocks of 65,536.
    let count = 1_000_000;
    let mut numbers = Numbers(5);
    let columns = vec![Column::new("x", Bound::Absolute(0.05)).unwrap()];
    let schema = Schema::new(columns, TimeBase::Numbered)
        .unwrap()
        .with_rows_per_block(655)
        .unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema).with_effort(fewbits_record::Effort::Fast);
    for i in 0..count {
        let x = (1e-2 * i as f64).sin() + numbers.next();
        recorder.push_next(&[Some(x)]).unwrap();
    }
    let bytes = recorder.finish().unwrap();
    let read = Rc::new(Cell::new(0));
    let mut playback = Playback::new(Counted(Cursor::new(&bytes), read.clone())).unwrap();
    read.set(0);
    let found = playback.range(500_000, 509_999).map(Result::unwrap).count();
    assert_eq!(found, 10_000);
    assert!(read.get() * 50 <= bytes.len() as u64, "{} of {}", read.get(), bytes.len());
}

#[test]
fn damaged_blocks_are_told_and_the_rest_counts() {
    let rows = rows(20_000);
    let mut bytes = recorded(schema(4096, 0), &rows);
    let first = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap()[0].offset as usize;
    bytes[first + 100] ^= 1;
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    let mut told = 0;
    let found = playback.aggregates(100, (i64::MIN, i64::MAX), |_| told += 1).unwrap();
    assert_eq!((told, found.iter().map(|stretch| stretch.rows).sum::<u64>()), (1, 20_000 - 4096));
    assert!(playback.aggregates(0, (0, 0), |_| ()).is_err());
    assert_eq!(Aggregate::default().mean(), None);
}

/// Three blocks of 4096 rows, of few bytes.
fn small() -> (Vec<u8>, Vec<Aggregate>) {
    let columns = ["a", "b"]
        .map(|name| Column::new(name, Bound::Lossless).unwrap())
        .to_vec();
    let schema = Schema::new(columns, TimeBase::Numbered)
        .unwrap()
        .with_rows_per_block(4096)
        .unwrap();
    let row = |i: i64| vec![Some((i / 1000) as f64), (i % 4096 < 4000).then_some(7.0)];
    let mut recorder = Recorder::new(Vec::new(), schema);
    (0..10_000).for_each(|i| recorder.push_next(&row(i)).unwrap());
    let of = |column: usize| Aggregate::of((0..10_000).filter_map(|i| row(i)[column]).collect::<Vec<_>>());
    (recorder.finish().unwrap(), vec![of(0), of(1)])
}

/// The aggregates of all rows, and whether damage was told; `None` if the recording is refused.
fn whole(bytes: &[u8]) -> Option<(u64, Vec<Aggregate>, bool)> {
    let mut playback = Playback::new(Cursor::new(bytes)).ok()?;
    let mut told = !playback.is_finished();
    let found = playback
        .aggregates(1 << 40, (i64::MIN, i64::MAX), |_| told = true)
        .unwrap();
    let columns = found.first().map(|stretch| stretch.columns.clone()).unwrap_or_default();
    Some((found.iter().map(|stretch| stretch.rows).sum(), columns, told))
}

fn is_right(found: &(u64, Vec<Aggregate>, bool), truth: &[Aggregate]) -> bool {
    let near = |(a, b): (&Aggregate, &Aggregate)| {
        let means = a.mean().unwrap_or(0.0) - b.mean().unwrap_or(0.0);
        (a.count(), a.ends()) == (b.count(), b.ends()) && means.abs() < 1e-9
    };
    found.0 == 10_000 && found.1.iter().zip(truth).all(near)
}

#[test]
fn damage_of_any_bit_is_told_or_does_not_matter() {
    let (bytes, truth) = small();
    assert!(bytes.len() < 2000 && is_right(&whole(&bytes).unwrap(), &truth), "{}", bytes.len());
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Some(found) = whole(&flipped) {
            assert!(found.2 || is_right(&found, &truth), "bit {bit}: {found:?}");
        }
    }
    for length in 0..bytes.len() {
        if let Some(found) = whole(&bytes[..length]) {
            assert!(found.2, "cut at {length}: {found:?}");
        }
    }
}

#[test]
fn blocks_that_are_missing_doubled_or_moved_are_told() {
    let (bytes, truth) = small();
    let index = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap();
    let place = |i: usize| index[i].offset as usize..(index[i].offset + index[i].bytes) as usize;
    let (first, second, end) = (place(0), place(1), place(2).end);
    let [a, b, c] = [0, 1, 2].map(|i| &bytes[place(i)]);
    let (head, tail) = (&bytes[..first.start], &bytes[end..]);
    assert_eq!(second.start, first.end);
    for blocks in [
        vec![a, c],
        vec![b, c],
        vec![a, b],
        vec![a, a, b, c],
        vec![a, b, c, c],
        vec![b, a, c],
        vec![c, b, a],
        vec![],
    ] {
        let mixed = [head, &blocks.concat(), tail].concat();
        let found = whole(&mixed).unwrap();
        // The numbers of the index are those of the rows that were recorded, wherever their blocks stand.
        assert!(found.2 || is_right(&found, &truth), "{} blocks: {found:?}", blocks.len());
    }
}
