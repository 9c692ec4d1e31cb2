//! Appending changes a recording wholly or not at all, and only one writer may do it.

use crate::common::{Cells, row_holds, rows, schema};
use fewbits_record::{Error, Playback, Recorder, TimeBase};
use std::path::{Path, PathBuf};

fn beside(path: &Path) -> PathBuf {
    path.with_file_name(format!("{}.append", path.file_name().unwrap().to_string_lossy()))
}

fn read(path: &Path, truth: &[Cells]) -> usize {
    let mut playback = Playback::open(path).unwrap();
    let rows: Vec<_> = playback.rows().collect::<Result<_, _>>().unwrap();
    for (row, sample) in rows.iter().zip(truth) {
        assert!(row_holds(sample, &row.values));
    }
    rows.len()
}

fn written(path: &Path, rows_per_block: usize, truth: &[Cells]) {
    let mut recorder = Recorder::create(path, schema(rows_per_block, TimeBase::Numbered)).unwrap();
    truth.iter().for_each(|row| recorder.push_next(row).unwrap());
    recorder.finish().unwrap();
}

#[test]
fn an_append_that_fails_leaves_every_byte() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let truth = rows(90);
    // Of several blocks, and of a single one.
    for rows_per_block in [10, 64] {
        written(&path, rows_per_block, &truth[..40]);
        let before = std::fs::read(&path).unwrap();
        for more in [0, 5, 25] {
            let mut recorder = Recorder::resume(&path).unwrap();
            truth[40..40 + more]
                .iter()
                .for_each(|row| recorder.push_next(row).unwrap());
            assert!(recorder.push_next(&[Some(1.0)]).is_err());
            drop(recorder);
            assert!(std::fs::read(&path).unwrap() == before, "{rows_per_block} rows a block, {more} appended");
            assert!(!beside(&path).exists());
        }
        let mut recorder = Recorder::resume(&path).unwrap();
        truth[40..].iter().for_each(|row| recorder.push_next(row).unwrap());
        recorder.finish().unwrap();
        assert_eq!(read(&path, &truth), 90);
        assert!(!beside(&path).exists() && Playback::open(&path).unwrap().has_index());
    }
}

/// Whatever of the new bytes reached the file: it is read as it was, and the next append begins there.
#[test]
fn a_crash_at_every_byte_of_an_append_leaves_the_old_rows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let truth = rows(60);
    written(&path, 10, &truth[..40]);
    let old = std::fs::read(&path).unwrap();
    let mut recorder = Recorder::resume(&path).unwrap();
    truth[40..].iter().for_each(|row| recorder.push_next(row).unwrap());
    // As a crash would leave it: both blocks are written, the index is not.
    let (kept, partial) = (std::fs::read(beside(&path)).unwrap(), std::fs::read(&path).unwrap());
    recorder.finish().unwrap();
    let new = std::fs::read(&path).unwrap();
    let offset = partial.iter().zip(&old).take_while(|(a, b)| a == b).count();
    let states = (offset..new.len()).map(|length| new[..length].to_vec());
    for state in states.chain([partial, new.clone()]) {
        std::fs::write(&path, &state).unwrap();
        std::fs::write(beside(&path), &kept).unwrap();
        let expected = if state == new { 60 } else { 40 };
        assert_eq!(read(&path, &truth), expected, "{} bytes", state.len());
        drop(Recorder::resume(&path).unwrap());
        let restored = std::fs::read(&path).unwrap();
        assert!(restored == if expected == 60 { &new[..] } else { &old[..] }, "{} bytes", state.len());
    }
    // Before the new bytes, the file beside is written: any part of it changes nothing.
    for length in 0..kept.len() {
        std::fs::write(&path, &old).unwrap();
        std::fs::write(beside(&path), &kept[..length]).unwrap();
        assert_eq!(read(&path, &truth), 40);
        drop(Recorder::resume(&path).unwrap());
        assert!(std::fs::read(&path).unwrap() == old);
    }
}

#[test]
fn rows_that_were_flushed_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let truth = rows(90);
    for rows_per_block in [10, 64] {
        written(&path, rows_per_block, &truth[..40]);
        let mut recorder = Recorder::resume(&path).unwrap();
        truth[40..55].iter().for_each(|row| recorder.push_next(row).unwrap());
        recorder.sync().unwrap();
        truth[55..58].iter().for_each(|row| recorder.push_next(row).unwrap());
        drop(recorder);
        let recorder = Recorder::resume(&path).unwrap();
        assert_eq!(recorder.next_tick(), 55);
        recorder.finish().unwrap();
        assert_eq!(read(&path, &truth), 55);
    }
}

#[test]
fn a_second_writer_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fewb");
    let truth = rows(90);
    let mut first = Recorder::create(&path, schema(10, TimeBase::Numbered)).unwrap();
    truth[..40].iter().for_each(|row| first.push_next(row).unwrap());
    assert!(matches!(Recorder::resume(&path), Err(Error::Locked)));
    assert!(matches!(Recorder::create(&path, schema(10, TimeBase::Numbered)), Err(Error::Locked)));
    first.finish().unwrap();
    let mut first = Recorder::resume(&path).unwrap();
    assert!(matches!(Recorder::resume(&path), Err(Error::Locked)));
    truth[40..].iter().for_each(|row| first.push_next(row).unwrap());
    first.finish().unwrap();
    assert_eq!(read(&path, &truth), 90);
}

/// Rows by columns give the bytes of the same rows one by one, however they are divided; others are refused as a whole.
#[test]
fn rows_by_columns_are_those_one_by_one() {
    let truth = rows(200);
    let columns: Vec<Cells> = (0..3).map(|i| truth.iter().map(|row| row[i]).collect()).collect();
    for (rows_per_block, sizes) in [(64, [1, 63, 64, 65]), (100, [200, 100, 7, 99]), (500, [200, 150, 3, 0])] {
        let schema = schema(rows_per_block, TimeBase::Numbered);
        let mut single = Recorder::new(Vec::new(), schema.clone()).with_identity(7);
        for (tick, row) in (0..).zip(&truth) {
            single.push(tick * tick % 5 + 3 * tick, row).unwrap();
        }
        let (next, expected) = (single.next_tick(), single.finish().unwrap());
        let ticks: Vec<i64> = (0..200).map(|tick| tick * tick % 5 + 3 * tick).collect();
        let mut recorder = Recorder::new(Vec::new(), schema).with_identity(7);
        let mut from = 0;
        for size in sizes.into_iter().chain([200]) {
            let to = (from + size).min(200);
            let part: Vec<&[Option<f64>]> = columns.iter().map(|cells| &cells[from..to]).collect();
            let bytes = recorder.bytes();
            assert!(recorder.push_columns(&ticks[from..to], &part[1..]).is_err());
            let short = [
                part[0],
                part[1],
                &columns[2][..to - from + 1 - 2 * usize::from(to > from)],
            ];
            assert!(recorder.push_columns(&ticks[from..to], &short).is_err());
            assert_eq!(recorder.bytes(), bytes);
            recorder.push_columns(&ticks[from..to], &part).unwrap();
            from = to;
        }
        assert_eq!(
            (recorder.next_tick(), recorder.finish().unwrap()),
            (next, expected),
            "{rows_per_block} rows a block"
        );
    }
}
