//! Ranges, chosen columns, the index, pipes.

use crate::common::{record, rows, schema};
use fewbits_record::{BlockReader, Error, Playback, Recorder, TimeBase};
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
    assert_eq!(
        BlockReader::new(&bytes[..])
            .unwrap()
            .map(|block| block.unwrap().rows())
            .sum::<usize>(),
        10
    );
}
