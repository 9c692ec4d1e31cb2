//! Recordings that are continued, after an orderly end and after a crash at any byte.

use crate::common::{row_holds, rows, schema};
use fewbits_record::{Playback, Recorder, TimeBase};

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
