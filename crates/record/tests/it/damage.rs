//! Cut, flipped, mixed up: what is damaged is refused, everything else is read.

use crate::common::{Cells, record, row_holds, rows, schema};
use fewbits_record::{Block, BlockReader, Error, Playback, TimeBase};
use std::io::Cursor;

const ROWS: usize = 60;
const PER_BLOCK: usize = 20;

/// Checks every block that is read against the rows; returns how many rows were read and how many errors there were.
fn check(blocks: impl Iterator<Item = Result<Block, Error>>, truth: &[Cells], context: &str) -> (usize, usize) {
    let (mut read, mut errors) = (0, 0);
    for block in blocks {
        let Ok(block) = block else {
            errors += 1;
            assert!(errors <= 2 * ROWS, "{context}: no end of errors");
            continue;
        };
        for (i, tick) in block.ticks.iter().enumerate() {
            let row: Cells = block.columns.iter().map(|cells| cells[i]).collect();
            let sample = usize::try_from(*tick).ok().and_then(|tick| truth.get(tick));
            assert!(sample.is_some_and(|sample| row_holds(sample, &row)), "{context}: row {tick} is {row:?}");
            read += 1;
        }
    }
    (read, errors)
}

#[test]
fn truncation_at_every_byte_keeps_whole_blocks() {
    let truth = rows(ROWS);
    let bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &truth);
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    let ends: Vec<usize> = playback
        .index()
        .unwrap()
        .iter()
        .map(|block| (block.offset + block.bytes) as usize)
        .collect();
    assert_eq!(ends.len(), ROWS / PER_BLOCK);
    let header = playback.index().unwrap()[0].offset as usize;
    for length in 0..bytes.len() {
        let cut = &bytes[..length];
        let context = format!("cut at {length}");
        let Ok(mut playback) = Playback::new(Cursor::new(cut)) else {
            assert!(length < header, "{context}");
            continue;
        };
        let expected = PER_BLOCK * ends.iter().filter(|end| **end <= length).count();
        assert_eq!(check(playback.blocks(), &truth, &context).0, expected, "{context}");
        assert_eq!(check(BlockReader::new(cut).unwrap(), &truth, &context).0, expected, "{context}");
    }
}

#[test]
fn flipped_bits_lose_one_block_at_most() {
    let truth = rows(ROWS);
    let bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &truth);
    let header = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap()[0].offset as usize;
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        let context = format!("bit {bit}");
        let Ok(mut playback) = Playback::new(Cursor::new(&flipped)) else {
            assert!(bit / 8 < header, "{context}");
            continue;
        };
        assert!(bit / 8 >= header, "{context}: a damaged header was accepted");
        let (read, errors) = check(playback.blocks(), &truth, &context);
        assert!(read + PER_BLOCK * errors.min(1) >= ROWS, "{context}: {read} rows");
        let (read, errors) = check(BlockReader::new(&flipped[..]).unwrap(), &truth, &context);
        assert!(read + PER_BLOCK * errors.min(1) >= ROWS, "{context}: {read} rows in order");
    }
}

#[test]
fn another_recordings_header_opens_no_block() {
    let truth = rows(ROWS);
    let bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &truth);
    // The same columns with another size of blocks: of the same length in bytes.
    let other = record(schema(PER_BLOCK + 1, TimeBase::Numbered), &truth);
    let start = |bytes: &[u8]| Playback::new(Cursor::new(bytes)).unwrap().index().unwrap()[0].offset as usize;
    let mut mixed = other[..start(&other)].to_vec();
    mixed.extend_from_slice(&bytes[start(&bytes)..]);
    let mut playback = Playback::new(Cursor::new(&mixed)).unwrap();
    assert_eq!(check(playback.blocks(), &truth, "mixed").0, 0);
    assert_eq!(check(BlockReader::new(&mixed[..]).unwrap(), &truth, "mixed").0, 0);
}

#[test]
fn versions_and_foreign_files_are_told_apart() {
    let mut bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &rows(5));
    bytes[4] = 9;
    assert!(matches!(Playback::new(Cursor::new(&bytes)), Err(Error::Version { found: 9, supported: 6 })));
    for version in [1, 3, 4, 9] {
        let old = [b"\x8bfewb\r\n", &[version][..], &[0; 20]].concat();
        assert!(matches!(
            Playback::new(Cursor::new(&old)),
            Err(Error::Version { found, supported: 6 }) if found == version
        ));
    }
    assert!(matches!(Playback::new(Cursor::new(b"time,value\n1,2\n")), Err(Error::NotARecording)));
    assert!(matches!(Playback::new(Cursor::new(b"")), Err(Error::NotARecording)));
}
