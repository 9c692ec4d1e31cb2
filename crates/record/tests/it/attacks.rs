//! Damaged files of all kinds: what is read is right, and what is missing is said.
//!
//! `FEWBITS_FILES=100000 FEWBITS_SEED=1 cargo test -p fewbits-record --test it attacks:: -- --ignored` draws others.

use crate::common::{Numbers, rows, schema};
use fewbits_record::{BlockReader, Playback, Recorder, Row, TimeBase, TimeFormat};
use std::io::Cursor;

const ROWS: usize = 90;

/// The same rows of one column and of three, in one block and in several, numbered and with times: the file, its rows, offsets of its blocks.
fn files() -> Vec<(Vec<u8>, Vec<Row>, Vec<usize>)> {
    let clock = TimeBase::Clock {
        decimals: 1,
        tolerance: 0,
        format: TimeFormat::Utc,
    };
    let all = [
        (ROWS, TimeBase::Numbered),
        (15, TimeBase::Numbered),
        (15, clock),
        (7, clock),
    ];
    (7..)
        .zip(all)
        .map(|(identity, (per_block, time))| {
            let schema = schema(per_block, time).with_time_name("Datum").unwrap();
            let mut recorder = Recorder::new(Vec::new(), schema).with_identity(identity);
            rows(ROWS).iter().for_each(|row| recorder.push_next(row).unwrap());
            let bytes = recorder.finish().unwrap();
            let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
            let index = playback.index().unwrap();
            let starts = index.iter().map(|block| block.offset as usize);
            let end = index.last().map(|block| (block.offset + block.bytes) as usize);
            let starts = starts.chain(end).collect();
            let read = playback.rows().collect::<Result<_, _>>().unwrap();
            (bytes, read, starts)
        })
        .collect()
}

fn damaged(bytes: &[u8], starts: &[usize], other: &[u8], numbers: &mut Numbers) -> Vec<u8> {
    let mut below = |limit: usize| ((numbers.next() * limit as f64) as usize).min(limit.max(1) - 1);
    let mut all = bytes.to_vec();
    for _ in 0..=below(3) {
        let at = below(all.len().max(1));
        let blocks = starts.len() - 1;
        let (a, b) = (below(blocks), below(blocks));
        let whole = starts.last().is_some_and(|end| *end <= all.len());
        match below(9) {
            0 | 1 if !all.is_empty() => all[at] ^= 1 << below(8),
            // A burst.
            2 => (at..all.len().min(at + 4)).for_each(|i| all[i] ^= below(256) as u8),
            3 => all.truncate(at),
            4 => drop(all.drain(at..(at + 1 + below(40)).min(all.len()))),
            5 => drop(all.splice(at..at, (0..=below(20)).map(|i| bytes[i]))),
            // Blocks are dropped, doubled and put elsewhere.
            6 if whole => drop(all.drain(starts[a]..starts[a + 1])),
            7 if whole => drop(all.splice(starts[b]..starts[b], bytes[starts[a]..starts[a + 1]].iter().copied())),
            // A part of another recording of the same rows.
            _ => {
                let from = below(other.len());
                let part = &other[from..(from + 1 + below(200)).min(other.len())];
                let end = (at + part.len()).min(all.len());
                drop(all.splice(at..end, part.iter().copied()));
            }
        }
    }
    all
}

/// NaN equals itself here.
fn same(a: &Row, b: &Row) -> bool {
    let bits = |row: &Row| -> Vec<_> { row.values.iter().map(|cell| cell.map(f64::to_bits)).collect() };
    a.tick == b.tick && bits(a) == bits(b)
}

/// Checks that rows are some of the true ones, in their order; returns how many.
fn check<'a>(found: impl Iterator<Item = &'a Row>, truth: &[Row], context: &str) -> usize {
    let (mut next, mut count) = (0, 0);
    for row in found {
        let place = truth[next..].iter().position(|own| same(own, row));
        next += place.unwrap_or_else(|| panic!("{context}: {row:?} is wrong, or not in its place")) + 1;
        count += 1;
    }
    count
}

/// Returns how many files were read in part and how many not at all.
fn attack(count: usize, seed: u64) -> (usize, usize) {
    let files = files();
    let mut numbers = Numbers(seed);
    let (mut parts, mut none) = (0, 0);
    for i in 0..count {
        let (bytes, truth, starts) = &files[i % files.len()];
        let (other, _, others) = &files[(i / files.len() + 1) % files.len()];
        let all = damaged(bytes, starts, other, &mut numbers);
        // Behind the whole header of the other recording its rows are right.
        let header = &other[..others[0]];
        if all.starts_with(header) && !bytes.starts_with(header) {
            continue;
        }
        let context = format!("seed {seed}, file {i}");
        if let Ok(mut playback) = Playback::new(Cursor::new(&all)) {
            let (read, errors): (Vec<_>, Vec<_>) = playback.rows().partition(Result::is_ok);
            let read: Vec<Row> = read.into_iter().map(Result::unwrap).collect();
            let found = check(read.iter(), truth, &context);
            assert!(found == truth.len() || !errors.is_empty(), "{context}: {found} rows without an error");
            parts += 1;
        } else {
            none += 1;
        }
        // From a pipe, rows that are read are right too.
        if let Ok(reader) = BlockReader::new(all.as_slice()) {
            for block in reader.flatten() {
                for (row, tick) in block.ticks.iter().enumerate() {
                    let values: Vec<_> = block.columns.iter().map(|cells| cells[row].map(f64::to_bits)).collect();
                    let own = truth.iter().find(|own| own.tick == *tick);
                    let own: Option<Vec<_>> =
                        own.map(|own| own.values.iter().map(|cell| cell.map(f64::to_bits)).collect());
                    assert_eq!(own, Some(values), "{context}, tick {tick}");
                }
            }
        }
    }
    (parts, none)
}

#[test]
fn damaged_files_give_no_wrong_rows() {
    let (parts, none) = attack(3000, 20_261_126);
    assert!(parts > 1000 && none > 100, "{parts} {none}");
}

#[test]
#[ignore = "as many files as are asked for"]
fn many_damaged_files_give_no_wrong_rows() {
    let number = |name: &str, usual: u64| std::env::var(name).map_or(usual, |number| number.parse().unwrap());
    let (count, seed) = (number("FEWBITS_FILES", 100_000), number("FEWBITS_SEED", 1));
    let (parts, none) = attack(count as usize, seed);
    println!("{count} files: {parts} read, {none} refused");
}
