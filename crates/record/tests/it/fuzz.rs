//! The fuzzers' corpus and random mutations of it, without a fuzzer: no panic, and no more memory than the block's stated size.

use crate::common::{Numbers, rows, schema};
use fewbits_record::{Bound, Column, Effort, FrameWriter, Recorder, Schema, TimeBase, TimeFormat};
use std::path::{Path, PathBuf};

#[path = "../../fuzz/checks.rs"]
mod checks;

/// Mutations of each file of the corpus.
const MUTATIONS: usize = 150;
/// Bytes that a reader may hold at once: per cell that the header states, per byte of input, and besides.
const PER_CELL: u64 = 200;
const PER_BYTE: u64 = 24;
const BESIDES: u64 = 1 << 20;

type Check = fn(&[u8]) -> Option<usize>;
const TARGETS: [(&str, Check); 2] = [("playback", checks::playback), ("receive", checks::receive)];

fn folder(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target)
}

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let files = std::fs::read_dir(folder(target)).unwrap();
    let mut paths: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// Runs one input and checks the most memory that was held at once.
fn run(check: Check, bytes: &[u8]) {
    let mut cells = None;
    let held = allocation_counter::measure(|| cells = check(bytes)).bytes_max;
    let limit = PER_CELL * cells.unwrap_or(0) as u64 + PER_BYTE * bytes.len() as u64 + BESIDES;
    assert!(held <= limit, "{held} bytes held for {} bytes, {cells:?} cells a block", bytes.len());
}

fn mutated(bytes: &[u8], other: &[u8], numbers: &mut Numbers) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut below = |limit: usize| (numbers.next() * limit as f64) as usize;
    for _ in 0..=below(4) {
        let length = bytes.len().max(1);
        let (from, to) = (below(length), below(length));
        match below(6) {
            0 if !bytes.is_empty() => bytes[from] ^= 1 << below(8),
            1 if !bytes.is_empty() => bytes[from] = [0, 1, 0x7f, 0x80, 0xff][below(5)],
            2 => bytes.truncate(from),
            3 => {
                let part: Vec<u8> = bytes[from.min(to)..from.max(to)].to_vec();
                bytes.splice(to..to, part);
            }
            4 => drop(bytes.drain(from.min(to)..from.max(to))),
            _ if !other.is_empty() => {
                let start = below(other.len());
                let part = &other[start..(start + 1 + below(64)).min(other.len())];
                bytes.splice(from..from, part.iter().copied());
            }
            _ => {}
        }
    }
    bytes
}

#[test]
fn corpus_and_its_mutations_are_total() {
    for (target, check) in TARGETS {
        let corpus = corpus(target);
        assert!(corpus.len() >= 6, "{target}: {} files", corpus.len());
        let mut numbers = Numbers(11);
        for (i, bytes) in corpus.iter().enumerate() {
            run(check, bytes);
            let other = &corpus[(i + 1) % corpus.len()];
            for _ in 0..MUTATIONS {
                run(check, &mutated(bytes, other, &mut numbers));
            }
        }
    }
}

#[test]
fn corpus_is_read_whole() {
    for (target, check) in TARGETS {
        let cells: Vec<Option<usize>> = corpus(target).iter().map(|bytes| check(bytes)).collect();
        assert!(cells.iter().filter(|cells| cells.is_some()).count() >= 5, "{target}: {cells:?}");
    }
}

/// Schemas of different kinds.
fn schemas() -> Vec<Schema> {
    let clock = |tolerance| TimeBase::Clock {
        decimals: 3,
        tolerance,
        format: TimeFormat::Seconds,
    };
    let wide = (0..9)
        .map(|i| Column::new(format!("{i}"), Bound::Lossless).unwrap())
        .collect();
    let circle = vec![
        Column::new("angle", Bound::Absolute(2.0))
            .unwrap()
            .with_period(360.0)
            .unwrap(),
        Column::new("share", Bound::ShareOfRange(0.01)).unwrap(),
    ];
    vec![
        schema(16, TimeBase::Numbered),
        schema(16, clock(0)),
        schema(8, clock(5)),
        Schema::new(wide, TimeBase::Numbered)
            .unwrap()
            .with_rows_per_block(4)
            .unwrap(),
        Schema::new(circle, clock(0)).unwrap().with_rows_per_block(32).unwrap(),
    ]
}

#[test]
#[ignore = "writes the corpus anew"]
fn corpus_is_written() {
    for (number, schema) in schemas().into_iter().enumerate() {
        let columns = schema.columns().len();
        let row = |i: usize| -> Vec<_> { rows(80)[i].iter().cycle().take(columns).copied().collect() };
        let tick = |i: usize| 1000 * i as i64 + (i % 7) as i64 * 3;
        let effort = if number % 2 == 0 {
            Effort::Thorough
        } else {
            Effort::Fast
        };
        let mut recorder = Recorder::new(Vec::new(), schema.clone()).with_effort(effort);
        let mut writer = FrameWriter::new(schema, 400).unwrap();
        let mut frames = Vec::new();
        for i in 0..80 {
            recorder.push(tick(i), &row(i)).unwrap();
            frames.extend(writer.push(tick(i), &row(i)).unwrap());
        }
        frames.extend(writer.flush().unwrap());
        let with_lengths = |frames: &[Vec<u8>]| -> Vec<u8> {
            let framed = |frame: &Vec<u8>| [&(frame.len() as u16).to_le_bytes()[..], frame].concat();
            frames.iter().flat_map(framed).collect()
        };
        let whole = recorder.finish().unwrap();
        let all = [writer.header_frames(), frames.clone()].concat();
        std::fs::write(folder("playback").join(format!("recording-{number}")), &whole).unwrap();
        std::fs::write(folder("receive").join(format!("frames-{number}")), with_lengths(&all)).unwrap();
        if number == 0 {
            std::fs::write(folder("playback").join("cut-off"), &whole[..whole.len() / 2]).unwrap();
            std::fs::write(folder("receive").join("without-header"), with_lengths(&frames)).unwrap();
        }
    }
}
