//! What is missing, doubled, moved or of another recording is said, and small recordings are small.

use crate::common::{Cells, record, row_holds, rows, schema};
use fewbits_record::{BlockReader, Bound, Column, Damage, Error, Playback, Recorder, Schema, TimeBase};
use std::io::Cursor;
use std::ops::Range;

const ROWS: usize = 100;
const PER_BLOCK: usize = 20;

/// Where the blocks of a recording stand.
fn places(bytes: &[u8]) -> Vec<Range<usize>> {
    let index = Playback::new(Cursor::new(bytes)).unwrap().index().unwrap();
    let place = |block: &fewbits_record::BlockInfo| block.offset as usize..(block.offset + block.bytes) as usize;
    index.iter().map(place).collect()
}

/// The ticks of all rows that are read, each checked, and the damages; by random access and from a pipe.
fn read(bytes: &[u8], truth: &[Cells]) -> [(Vec<i64>, Vec<Damage>); 2] {
    let gathered = |blocks: &mut dyn Iterator<Item = Result<fewbits_record::Block, Error>>| {
        let (mut ticks, mut damages) = (Vec::new(), Vec::new());
        for block in blocks {
            match block {
                Ok(block) => {
                    for (i, tick) in block.ticks.iter().enumerate() {
                        let row: Cells = block.columns.iter().map(|cells| cells[i]).collect();
                        assert!(row_holds(&truth[*tick as usize], &row), "row {tick}: {row:?}");
                        ticks.push(*tick);
                    }
                }
                Err(Error::Block { damage, .. }) => damages.push(damage),
                Err(other) => panic!("{other}"),
            }
        }
        (ticks, damages)
    };
    [
        gathered(&mut Playback::new(Cursor::new(bytes)).unwrap().blocks()),
        gathered(&mut BlockReader::new(bytes).unwrap()),
    ]
}

fn all_but(missing: Range<i64>) -> Vec<i64> {
    (0..ROWS as i64).filter(|tick| !missing.contains(tick)).collect()
}

#[test]
fn missing_blocks_are_said() {
    let truth = rows(ROWS);
    let bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &truth);
    let places = places(&bytes);
    for (i, place) in places.iter().enumerate() {
        let cut = [&bytes[..place.start], &bytes[place.end..]].concat();
        let first = (i * PER_BLOCK) as i64;
        let [indexed, piped] = read(&cut, &truth);
        assert_eq!(indexed.0, all_but(first..first + PER_BLOCK as i64), "{i}");
        assert!(indexed.1.contains(&Damage::Index), "{i}: {:?}", indexed.1);
        assert_eq!(piped.0, indexed.0);
        // From a pipe a last block that is missing shows only in the index, which is not read there.
        assert_eq!(
            piped.1,
            if i + 1 < places.len() {
                vec![Damage::Missing]
            } else {
                vec![]
            },
            "{i}"
        );
    }
}

#[test]
fn doubled_and_moved_blocks_are_not_read() {
    let truth = rows(ROWS);
    let bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &truth);
    let places = places(&bytes);
    for (i, place) in places.iter().enumerate() {
        for (j, other) in places.iter().enumerate() {
            // A copy of block i before block j.
            let copied = [&bytes[..other.start], &bytes[place.clone()], &bytes[other.start..]].concat();
            for (ticks, damages) in read(&copied, &truth) {
                assert!(!damages.is_empty(), "{i} before {j}");
                assert!(ticks.windows(2).all(|pair| pair[0] < pair[1]), "{i} before {j}: {ticks:?}");
            }
            // A copy of block i in place of block j.
            if i != j {
                let replaced = [&bytes[..other.start], &bytes[place.clone()], &bytes[other.end..]].concat();
                for (ticks, damages) in read(&replaced, &truth) {
                    assert!(!damages.is_empty(), "{i} for {j}");
                    assert!(ticks.windows(2).all(|pair| pair[0] < pair[1]), "{i} for {j}: {ticks:?}");
                }
            }
        }
    }
}

/// Blocks of equal length that change places leave every length of the index right.
#[test]
fn exchanged_blocks_of_equal_length_are_not_read() {
    let value = |i: usize| ((3 * i) % 16) as f64 + (i / PER_BLOCK) as f64;
    let truth: Vec<Cells> = (0..ROWS).map(|i| vec![Some(0.0), Some(0.0), Some(value(i))]).collect();
    let bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &truth);
    let places = places(&bytes);
    let pairs = (0..places.len()).flat_map(|i| (i + 1..places.len()).map(move |j| (i, j)));
    let (i, j) = pairs
        .into_iter()
        .find(|(i, j)| places[*i].len() == places[*j].len())
        .unwrap();
    let mut exchanged = bytes.clone();
    exchanged[places[i].clone()].copy_from_slice(&bytes[places[j].clone()]);
    exchanged[places[j].clone()].copy_from_slice(&bytes[places[i].clone()]);
    for (ticks, damages) in read(&exchanged, &truth) {
        assert!(!damages.is_empty() && ticks.windows(2).all(|pair| pair[0] < pair[1]), "{ticks:?}");
    }
}

#[test]
fn blocks_of_an_equal_recording_are_refused() {
    let truth = rows(ROWS);
    let (one, two) = (
        record(schema(PER_BLOCK, TimeBase::Numbered), &truth),
        record(schema(PER_BLOCK, TimeBase::Numbered), &truth),
    );
    let (places, others) = (places(&one), places(&two));
    let mut mixed = one.clone();
    mixed[places[1].clone()].copy_from_slice(&two[others[1].clone()]);
    for (ticks, damages) in read(&mixed, &truth) {
        assert_eq!(ticks, all_but(20..40));
        assert!(!damages.is_empty());
    }
}

#[test]
fn a_recording_without_its_end_says_so() {
    let truth = rows(ROWS);
    let bytes = record(schema(PER_BLOCK, TimeBase::Numbered), &truth);
    let end = places(&bytes).last().unwrap().end;
    let playback = Playback::new(Cursor::new(&bytes[..end])).unwrap();
    assert!(!playback.is_finished() && !playback.has_index());
    for (ticks, damages) in read(&bytes[..end], &truth) {
        assert_eq!((ticks, damages), (all_but(0..0), vec![Damage::NoEnd]));
    }
    assert!(Playback::new(Cursor::new(&bytes)).unwrap().is_finished());
}

#[test]
fn a_single_block_is_read_whole_or_not_at_all() {
    let truth = rows(30);
    let bytes = record(schema(64, TimeBase::Numbered), &truth);
    assert_eq!(read(&bytes, &truth)[0].0, (0..30).collect::<Vec<_>>());
    for length in 0..bytes.len() {
        assert!(Playback::new(Cursor::new(&bytes[..length])).is_err(), "{length}");
        assert!(BlockReader::new(&bytes[..length]).is_err(), "{length}");
        if length > 0 {
            let error = Playback::new(Cursor::new(&bytes[..length])).err().unwrap();
            assert!(error.to_string().contains("the recording is cut off"), "{length}: {error}");
        }
    }
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(Playback::new(Cursor::new(&flipped)).is_err(), "{bit}");
        assert!(BlockReader::new(&flipped[..]).is_err(), "{bit}");
    }
}

/// Header and index of a recording of one column take at most 24 bytes beside the name.
#[test]
fn small_recordings_have_small_headers() {
    let name = "temperature";
    for bound in [
        Bound::Lossless,
        Bound::Absolute(0.05),
        Bound::Decimals(2),
        Bound::ShareOfRange(0.01),
    ] {
        let column = Column::new(name, bound).unwrap();
        let mut recorder = Recorder::new(Vec::new(), Schema::new(vec![column], TimeBase::Numbered).unwrap());
        for i in 0..1000 {
            recorder.push_next(&[Some((f64::from(i) * 0.01).sin())]).unwrap();
        }
        let bytes = recorder.finish().unwrap();
        let block = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap()[0].bytes as usize;
        assert!(bytes.len() - block <= 24 + name.len(), "{bound:?}: {}", bytes.len() - block);
    }
    // A column that stands still takes a few bytes whatever its length.
    let column = Column::new("x", Bound::Lossless).unwrap();
    let mut recorder = Recorder::new(Vec::new(), Schema::new(vec![column], TimeBase::Numbered).unwrap());
    (0..50_000).for_each(|_| recorder.push_next(&[Some(7.25)]).unwrap());
    let bytes = recorder.finish().unwrap();
    assert!(bytes.len() <= 32, "{}", bytes.len());
}

/// Every byte claims that a long record begins there. The time is that of reading, not the square of it.
#[test]
fn crafted_bytes_are_searched_in_bounded_time() {
    let mut bytes = record(schema(1 << 12, TimeBase::Numbered), &rows(1 << 13));
    let end = places(&bytes).last().unwrap().end;
    bytes.truncate(end);
    // Lengths of about 2^18 bytes, from each place.
    bytes.extend([0xff, 0xff, 0x0f].iter().cycle().take(300_000));
    let started = std::time::Instant::now();
    let (rows, errors): (Vec<_>, Vec<_>) = BlockReader::new(&bytes[..]).unwrap().partition(Result::is_ok);
    assert_eq!((rows.len(), errors.len()), (2, 2));
    // A checksum over each claimed record would read 7e10 bytes.
    assert!(started.elapsed().as_secs() < 20, "{:?}", started.elapsed());
}

#[test]
fn equal_tables_of_one_identity_give_equal_bytes() {
    let table = rows(ROWS);
    let of = |identity: Option<u32>| {
        let recorder = Recorder::new(Vec::new(), schema(PER_BLOCK, TimeBase::Numbered));
        let mut recorder = match identity {
            Some(identity) => recorder.with_identity(identity),
            None => recorder,
        };
        table.iter().for_each(|row| recorder.push_next(row).unwrap());
        recorder.finish().unwrap()
    };
    assert_eq!(of(Some(7)), of(Some(7)));
    assert_ne!(of(Some(7)), of(Some(8)));
    assert_ne!(of(None), of(None));
    let whole: Vec<i64> = (0..ROWS as i64).collect();
    for (ticks, damages) in read(&of(Some(7)), &table) {
        assert_eq!((ticks, damages), (whole.clone(), Vec::new()));
    }
}
