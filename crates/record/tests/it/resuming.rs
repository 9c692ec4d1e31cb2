//! Recordings that are continued, after an orderly end and after a crash at any byte.

use crate::common::{Cells, record, row_holds, rows, schema};
use fewbits_record::{BlockReader, Playback, Recorder, TimeBase, TimeFormat};
use std::io::Cursor;

#[test]
fn resumed_recording_holds_all_rows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let truth = rows(3000);
    let mut recorder = Recorder::create(&path, schema(2, TimeBase::Numbered)).unwrap();
    for (i, row) in truth.iter().enumerate() {
        // 1250 blocks: more than one segment of the index.
        if [7, 8, 500, 2500].contains(&i) {
            recorder.finish().unwrap();
            recorder = Recorder::resume(&path).unwrap();
            assert_eq!(recorder.next_tick(), i as i64);
        }
        recorder.push_next(row).unwrap();
    }
    recorder.finish().unwrap();
    let mut playback = Playback::open(&path).unwrap();
    assert!(playback.has_index());
    assert_eq!(playback.index().unwrap().iter().map(|block| block.rows).sum::<u64>(), 3000);
    for (row, sample) in playback.rows().zip(&truth) {
        assert!(row_holds(sample, &row.unwrap().values));
    }
}

#[test]
fn crash_at_every_byte_is_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let truth = rows(60);
    let mut recorder = Recorder::create(&path, schema(10, TimeBase::Numbered)).unwrap();
    truth[..40].iter().for_each(|row| recorder.push_next(row).unwrap());
    recorder.finish().unwrap();
    let whole = std::fs::read(&path).unwrap();
    let header = Playback::open(&path).unwrap().index().unwrap()[0].offset as usize;
    for length in (0..=whole.len()).rev() {
        std::fs::write(&path, &whole[..length]).unwrap();
        let Ok(mut recorder) = Recorder::resume(&path) else {
            assert!(length < header, "cut at {length}");
            continue;
        };
        let next = recorder.next_tick() as usize;
        truth[next..].iter().for_each(|row| recorder.push_next(row).unwrap());
        recorder.finish().unwrap();
        let mut playback = Playback::open(&path).unwrap();
        let read: Vec<_> = playback.rows().map(Result::unwrap).collect();
        assert_eq!(read.len(), truth.len(), "cut at {length}");
        assert!(
            read.iter()
                .zip(&truth)
                .all(|(row, sample)| row_holds(sample, &row.values)),
            "cut at {length}"
        );
        assert!(playback.has_index() && length >= header);
    }
}

/// A recording of more blocks than a segment lists, without its end, of which a bit of an early block is wrong or a byte is missing.
#[test]
fn damage_before_a_segment_leaves_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.fewb");
    let truth: Vec<Cells> = rows(60).into_iter().cycle().take(1150).collect();
    let whole = record(schema(1, TimeBase::Numbered), &truth);
    let third = Playback::new(Cursor::new(&whole)).unwrap().index().unwrap()[2].offset as usize;
    for cut in [0, 1] {
        let mut bytes = whole[..whole.len() - 100].to_vec();
        bytes[third + 1] ^= 1;
        bytes.drain(third + 1..third + 1 + cut);
        std::fs::write(&path, &bytes).unwrap();
        for round in 1..3 {
            let mut recorder = Recorder::resume(&path).unwrap();
            let next = recorder.next_tick();
            truth[..3].iter().for_each(|row| recorder.push_next(row).unwrap());
            recorder.finish().unwrap();
            let mut playback = Playback::open(&path).unwrap();
            assert!(playback.has_index(), "{cut} bytes cut, round {round}");
            let (read, errors): (Vec<_>, Vec<_>) = playback.rows().partition(Result::is_ok);
            let ticks: Vec<i64> = read.into_iter().map(|row| row.unwrap().tick).collect();
            let expected: Vec<i64> = (0..next + 3).filter(|tick| *tick != 2).collect();
            assert!(
                ticks == expected && next as usize + 3 > 1140,
                "{cut} bytes cut, round {round}: {} rows",
                ticks.len()
            );
            assert!(!errors.is_empty());
        }
    }
}

/// Two blocks of equal length that changed places leave every length of the index right; what is appended then is read behind them.
#[test]
fn rows_behind_exchanged_blocks_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let truth = vec![rows(1).remove(0); 60];
    let mut bytes = record(schema(10, TimeBase::Numbered), &truth);
    let index = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap();
    let (start, length) = (index[4].offset as usize, index[4].bytes as usize);
    assert_eq!(index[5].bytes, index[4].bytes);
    bytes[start..start + 2 * length].rotate_left(length);
    std::fs::write(&path, &bytes).unwrap();
    let mut recorder = Recorder::resume(&path).unwrap();
    truth[..15].iter().for_each(|row| recorder.push_next(row).unwrap());
    recorder.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let blocks = BlockReader::new(&bytes[..]).unwrap().flatten();
    assert_eq!(
        blocks
            .filter(|block| block.ticks[0] >= 60)
            .map(|block| block.rows())
            .sum::<usize>(),
        15
    );
    let mut playback = Playback::open(&path).unwrap();
    assert_eq!(playback.rows().flatten().filter(|row| row.tick >= 60).count(), 15);
}

/// A crafted block whose number has no next one is damage; the recording goes on behind it.
#[test]
fn a_block_of_the_largest_number_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let time = TimeBase::Clock {
        decimals: 0,
        tolerance: 0,
        format: TimeFormat::Seconds,
    };
    let truth = rows(20);
    let mut recorder = Recorder::new(Vec::new(), schema(10, time));
    // Uneven times stand in the block, whatever its number is.
    (0..)
        .zip(&truth)
        .for_each(|(i, row)| recorder.push(i * i, row).unwrap());
    let bytes = recorder.finish().unwrap();
    let index = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap();
    let (first, last) = (index[0].offset as usize, index[1].offset as usize);
    // The length takes one byte, and so does the head, which has the number from bit 2 on.
    let content = &bytes[last + 1..last + index[1].bytes as usize - 4];
    assert!(content.len() == usize::from(bytes[last]) && content[0] < 0x80);
    let head = [&[content[0] | 0xfc][..], &[0xff; 8], &[1]].concat();
    let block = [&[bytes[last] + 9][..], &head, &content[1..]].concat();
    let sum = crc32fast::hash(&[&bytes[first - 4..first], &block].concat());
    std::fs::write(&path, [&bytes[..last], &block, &sum.to_le_bytes()].concat()).unwrap();
    let mut recorder = Recorder::resume(&path).unwrap();
    (100..)
        .zip(&truth)
        .for_each(|(tick, row)| recorder.push(tick, row).unwrap());
    recorder.finish().unwrap();
    let mut playback = Playback::open(&path).unwrap();
    let ticks = playback.rows().flatten().map(|row| row.tick);
    assert_eq!(ticks.collect::<Vec<_>>(), (0..10).map(|i| i * i).chain(100..120).collect::<Vec<_>>());
}
