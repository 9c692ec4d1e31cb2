//! Ranges, chosen columns, the index, pipes.

use crate::common::{Numbers, read, record, row_holds, rows, schema};
use fewbits_record::{BlockReader, Bound, Column, Effort, Error, Playback, Recorder, Schema, TimeBase};
use std::io::Cursor;

#[test]
fn range_gives_the_rows_between() {
    let truth = rows(900);
    let bytes = record(schema(64, TimeBase::Numbered), &truth);
    let unfinished = &bytes[..bytes.len() - 1];
    for bytes in [&bytes[..], unfinished] {
        let mut playback = Playback::new(Cursor::new(bytes)).unwrap();
        assert_eq!(playback.has_index(), bytes.len() != unfinished.len());
        for (from, to) in [(0, 0), (100, 250), (63, 64), (890, 5000), (-9, -1), (300, 200)] {
            let ticks: Vec<i64> = playback
                .range(from, to)
                .filter_map(|row| Some(row.ok()?.tick))
                .collect();
            let expected: Vec<i64> = (from.max(0)..=to.min(899)).collect();
            assert_eq!(ticks, expected, "{from} {to}");
        }
    }
}

#[test]
fn columns_come_in_the_order_asked() {
    let truth = rows(200);
    let bytes = record(schema(64, TimeBase::Numbered), &truth);
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    for row in playback.columns(&["count", "price"]).unwrap().rows() {
        let row = row.unwrap();
        let sample = &truth[row.tick as usize];
        assert_eq!(row.values, [sample[2], sample[1]]);
    }
    let refused = playback.columns(&["weight"]).map(|_| ()).unwrap_err();
    assert_eq!(refused.to_string(), "no column `weight`: the recording has wave, price, count");
}

#[test]
fn few_of_many_names_are_listed() {
    let columns = (0..100)
        .map(|i| Column::new(format!("c{i}"), Bound::Lossless).unwrap())
        .collect();
    let message = Schema::new(columns, TimeBase::Numbered)
        .unwrap()
        .position("x")
        .unwrap_err()
        .to_string();
    assert!(message.ends_with("c18, c19 and 80 more"), "{message}");
}

/// Columns of one code, a column of its own bytes between them, and special cells: each column alone is what it is among all.
#[test]
fn columns_of_one_code_are_read_alone() {
    let names = ["wave", "noise", "like wave", "still", "around"];
    let bounds = [
        Bound::Absolute(0.05),
        Bound::Lossless,
        Bound::Absolute(0.05),
        Bound::Absolute(0.05),
        Bound::Absolute(2.0),
    ];
    let columns = names.iter().zip(bounds).map(|(name, bound)| {
        let column = Column::new(*name, bound).unwrap();
        if *name == "around" {
            column.with_period(360.0).unwrap()
        } else {
            column
        }
    });
    let schema = Schema::new(columns.collect(), TimeBase::Numbered)
        .unwrap()
        .with_rows_per_block(128)
        .unwrap();
    let mut numbers = Numbers(3);
    let mut wave = 0.0;
    let mut row = |i: usize| -> Vec<Option<f64>> {
        wave += 0.3 * (numbers.next() - 0.5);
        let values = [
            wave,
            numbers.next(),
            2.0 - 0.5 * wave,
            7.0,
            (40.0 * wave).rem_euclid(360.0),
        ];
        let cell = |value: f64| match (numbers.next() * 100.0) as u32 {
            0 => Some(f64::NAN),
            1 => None,
            _ => Some(value),
        };
        if (300..340).contains(&i) {
            vec![None; 5]
        } else {
            values.into_iter().map(cell).collect()
        }
    };
    let truth: Vec<_> = (0..1000).map(&mut row).collect();
    for effort in [Effort::Thorough, Effort::Fast] {
        let mut recorder = Recorder::new(Vec::new(), schema.clone()).with_effort(effort);
        truth.iter().for_each(|row| recorder.push_next(row).unwrap());
        let bytes = recorder.finish().unwrap();
        let all = read(&bytes);
        let bits = |cell: &Option<f64>| cell.map(f64::to_bits);
        for (row, sample) in all.iter().zip(&truth) {
            let mut cells = row.values.iter().zip(sample).zip(schema.columns());
            assert!(cells.all(|((value, sample), column)| column.keeps(*sample, *value, None)));
        }
        let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
        for chosen in [&["still"][..], &["around", "wave"], &["noise"], &[]] {
            let rows: Vec<_> = playback.columns(chosen).unwrap().rows().map(Result::unwrap).collect();
            assert_eq!(rows.len(), truth.len());
            for (row, whole) in rows.iter().zip(&all) {
                let expected = chosen
                    .iter()
                    .map(|name| bits(&whole.values[schema.position(name).unwrap()]));
                assert!(row.values.iter().map(bits).eq(expected));
            }
        }
    }
}

/// Blocks of 1024 rows and more have tables, each column by itself; the last one has counts, in a code that columns share.
#[test]
fn fast_recordings_of_many_rows_keep_all_promises() {
    let truth = rows(5500);
    let mut recorder = Recorder::new(Vec::new(), schema(2500, TimeBase::Numbered)).with_effort(Effort::Fast);
    truth.iter().for_each(|row| recorder.push_next(row).unwrap());
    let bytes = recorder.finish().unwrap();
    let all = read(&bytes);
    assert_eq!(all.len(), truth.len());
    assert!(
        all.iter()
            .zip(&truth)
            .all(|(row, sample)| row_holds(sample, &row.values))
    );
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    let last: Vec<_> = playback
        .columns(&["count"])
        .unwrap()
        .range(4990, 5200)
        .map(Result::unwrap)
        .collect();
    assert_eq!(last.len(), 211);
    assert!(last.iter().all(|row| row.values[0] == truth[row.tick as usize][2]));
}

#[test]
fn index_names_ends_outside_the_values() {
    let truth = rows(500);
    let bytes = record(schema(64, TimeBase::Numbered), &truth);
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    let index = playback.index().unwrap();
    assert_eq!(index.iter().map(|block| block.rows).sum::<u64>(), 500);
    for (info, block) in index.iter().zip(playback.blocks()) {
        let block = block.unwrap();
        assert_eq!((info.ticks.0, info.ticks.1), (block.ticks[0], *block.ticks.last().unwrap()));
        for (ends, cells) in info.ends.iter().zip(&block.columns) {
            let (low, high) = ends.unwrap();
            assert!(
                cells
                    .iter()
                    .flatten()
                    .filter(|x| x.is_finite())
                    .all(|x| low <= *x && *x <= high)
            );
        }
    }
}

#[test]
fn pipes_read_what_files_hold() {
    let truth = rows(300);
    let bytes = record(schema(64, TimeBase::Numbered), &truth);
    let piped: Vec<_> = BlockReader::new(&bytes[..]).unwrap().map(Result::unwrap).collect();
    let indexed: Vec<_> = Playback::new(Cursor::new(&bytes))
        .unwrap()
        .blocks()
        .map(Result::unwrap)
        .collect();
    // NaN differs from itself: compare what is printed.
    assert_eq!(format!("{piped:?}"), format!("{indexed:?}"));
}

#[test]
fn empty_recording_has_no_rows() {
    let bytes = Recorder::new(Vec::new(), schema(64, TimeBase::Numbered))
        .finish()
        .unwrap();
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    assert!(playback.has_index() && playback.rows().next().is_none() && playback.index().unwrap().is_empty());
}

#[test]
fn rows_of_another_width_are_refused() {
    let mut recorder = Recorder::new(Vec::new(), schema(64, TimeBase::Numbered));
    let refused = recorder.push_next(&[Some(1.0)]).unwrap_err();
    assert!(matches!(refused, Error::Argument(_)), "{refused}");
    recorder.push_next(&[Some(1.0), None, Some(2.0)]).unwrap();
    let bytes = recorder.finish().unwrap();
    assert_eq!(Playback::new(Cursor::new(&bytes)).unwrap().rows().count(), 1);
}

#[test]
fn flushed_rows_can_be_read_at_once() {
    let truth = rows(10);
    let mut bytes = Vec::new();
    let mut recorder = Recorder::new(&mut bytes, schema(64, TimeBase::Numbered));
    truth.iter().for_each(|row| recorder.push_next(row).unwrap());
    recorder.flush().unwrap();
    drop(recorder);
    let blocks: Vec<_> = BlockReader::new(&bytes[..]).unwrap().collect();
    assert_eq!(blocks.len(), 2);
    assert_eq!(blocks[0].as_ref().unwrap().rows(), 10);
    // The recording has no end yet.
    assert!(matches!(
        blocks[1],
        Err(Error::Block {
            damage: fewbits_record::Damage::NoEnd,
            ..
        })
    ));
}

#[test]
fn related_columns_are_predicted_from_each_other() {
    let mut numbers = Numbers(9);
    let (mut level, names) = (0.0, ["a", "b", "c", "d"]);
    let rows: Vec<Vec<Option<f64>>> = (0..1500)
        .map(|i| {
            level += numbers.next() - 0.5;
            let gap = |k: i32| i % 50 != k;
            let noise = 0.002 * numbers.next();
            vec![
                gap(3).then_some(level),
                gap(7).then_some(2.0 * level + noise),
                Some(numbers.next()),
                gap(3).then_some(5.0 - level),
            ]
        })
        .collect();
    let size = |chosen: &[usize]| {
        let columns = chosen
            .iter()
            .map(|i| Column::new(names[*i], Bound::Absolute(0.01)).unwrap())
            .collect();
        let cells: Vec<_> = rows
            .iter()
            .map(|row| chosen.iter().map(|i| row[*i]).collect())
            .collect();
        record(Schema::new(columns, TimeBase::Numbered).unwrap(), &cells)
    };
    let together = size(&[0, 1, 2, 3]);
    let apart: usize = (0..4).map(|i| size(&[i]).len()).sum();
    assert!(together.len() * 5 < apart * 4, "{} {apart}", together.len());
    // A column that was predicted from others is read alone all the same.
    let mut playback = Playback::new(Cursor::new(&together)).unwrap();
    for (row, sample) in playback.columns(&["d"]).unwrap().rows().zip(&rows) {
        match (row.unwrap().values[0], sample[3]) {
            (Some(value), Some(sample)) => assert!((value - sample).abs() <= 0.01),
            (value, sample) => assert_eq!(value, sample),
        }
    }
}

#[test]
fn fast_recordings_keep_promises_too() {
    let truth = rows(600);
    let mut recorder = Recorder::new(Vec::new(), schema(64, TimeBase::Numbered)).with_effort(Effort::Fast);
    truth.iter().for_each(|row| recorder.push_next(row).unwrap());
    for (row, sample) in read(&recorder.finish().unwrap()).iter().zip(&truth) {
        assert!(row_holds(sample, &row.values));
    }
}
