//! Bits per sample of whole recordings of real series, beside the references of other programs.
//!
//! `cargo run --release -p fewbits-record --example measure -- FOLDER [KEY]` reads `manifest.csv` (key, ..., period, range),
//! `baselines.csv` (key, bound in percent of the range, codec, bits per sample) and for each key `KEY.f64`, little-endian doubles. It
//! prints one line for each series and bound, then the summary. Every restored sample is checked. With `day` in place of a key it
//! records the day of telemetry of `docs/record.md`.

use fewbits_record::{Bound, Column, Playback, Recorder, Schema, TimeBase, TimeFormat};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

type Failure = Box<dyn std::error::Error>;

const PERCENTS: [&str; 7] = ["0.0", "0.0001", "0.01", "0.25", "0.5", "1.0", "2.0"];
/// Rows per block that are measured; the first is the default of files.
const ROWS: [usize; 3] = [1 << 16, 512, 128];

/// Bits per sample of the whole recording, and of its blocks alone.
struct Cost {
    whole: f64,
    blocks: f64,
}

fn measure(samples: &[f64], column: &Column, rows: usize) -> Result<Cost, Failure> {
    let schema = Schema::new(vec![column.clone()], TimeBase::Numbered)?.with_rows_per_block(rows)?;
    let mut recorder = Recorder::new(Vec::new(), schema);
    for sample in samples {
        recorder.push_next(&[(!sample.is_nan()).then_some(*sample)])?;
    }
    let bytes = recorder.finish()?;
    let mut playback = Playback::new(Cursor::new(&bytes))?;
    let blocks: u64 = playback.index()?.iter().map(|block| block.bytes).sum();
    let mut read = 0;
    for block in playback.blocks() {
        let block = block?;
        for (tick, cell) in block.ticks.iter().zip(&block.columns[0]) {
            let sample = Some(samples[*tick as usize]).filter(|sample| !sample.is_nan());
            if !column.keeps(sample, *cell, block.share_bounds[0]) {
                return Err(format!("row {tick}: {sample:?} restored as {cell:?}").into());
            }
            read += 1;
        }
    }
    assert_eq!(read, samples.len());
    let bits = |bytes: f64| 8.0 * bytes / samples.len() as f64;
    Ok(Cost {
        whole: bits(bytes.len() as f64),
        blocks: bits(blocks as f64),
    })
}

/// A series of the folder.
fn series(folder: &Path, key: &str) -> Result<Vec<f64>, Failure> {
    let bytes = std::fs::read(folder.join(format!("{key}.f64")))?;
    let numbers = bytes.as_chunks::<8>().0.iter();
    Ok(numbers.map(|chunk| f64::from_le_bytes(*chunk)).collect())
}

/// Columns of a day of telemetry, their ranges, and the period of one.
const DAY: [(&str, f64, Option<f64>); 5] = [
    ("temp1_degc", 0.667, None),
    ("hum2_pct", 3.529, None),
    ("c_111_ppm", 7.376, None),
    ("wind_speed_mps", 1.32, None),
    ("wind_dir_deg", 360.0, Some(360.0)),
];

/// Five columns with 1 % NaN and a gap of 60 rows: mean bytes over twenty draws of the NaN.
fn day(folder: &Path, rows_per_block: usize) -> Result<(), Failure> {
    let (mut columns, mut samples) = (Vec::new(), Vec::new());
    for (name, range, period) in DAY {
        let column = Column::new(name, Bound::Absolute(0.01 * range))?;
        columns.push(match period {
            Some(period) => column.with_period(period)?,
            None => column,
        });
        samples.push(series(folder, &format!("orebro1.{name}"))?);
    }
    let (mut state, mut blocks, mut whole) = (1_u64, 0, 0);
    for _ in 0..20 {
        let time = TimeBase::Clock {
            decimals: 0,
            tolerance: 0,
            format: TimeFormat::Utc,
        };
        let schema = Schema::new(columns.clone(), time)?.with_rows_per_block(rows_per_block)?;
        let mut recorder = Recorder::new(Vec::new(), schema);
        for row in 0..samples[0].len() {
            let cells = samples.iter().map(|column| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                let value = if (state >> 33) % 100 == 0 {
                    f64::NAN
                } else {
                    column[row]
                };
                (!(1700..1760).contains(&row)).then_some(value)
            });
            recorder.push(1_700_000_000 + 2 * row as i64, &cells.collect::<Vec<_>>())?;
        }
        let bytes = recorder.finish()?;
        let index = Playback::new(Cursor::new(&bytes))?.index()?;
        blocks += index.iter().map(|block| block.bytes).sum::<u64>();
        whole += bytes.len();
    }
    let mean = |sum: f64| sum / 20.0;
    println!(
        "day in blocks of {rows_per_block} rows: {:.0} bytes, of which blocks {:.0}",
        mean(whole as f64),
        mean(blocks as f64)
    );
    Ok(())
}

/// Codecs of the list that are this library's own.
fn is_own(codec: &str) -> bool {
    codec.starts_with("fewbits")
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("which folder?")?;
    let chosen = arguments.next();
    let folder = Path::new(&folder);
    if chosen.as_deref() == Some("day") {
        return [512, 1 << 14].into_iter().try_for_each(|rows| day(folder, rows));
    }
    let mut references: BTreeMap<(String, String), BTreeMap<String, f64>> = BTreeMap::new();
    for record in csv::Reader::from_path(folder.join("baselines.csv"))?.records() {
        let record = record?;
        let key = (record[0].to_owned(), record[1].to_owned());
        references
            .entry(key)
            .or_default()
            .insert(record[2].to_owned(), record[3].parse()?);
    }
    let only = |name: &str, all: &str| std::env::var(name).map_or(true, |given| given.split(',').any(|one| one == all));
    let mut costs: BTreeMap<(&str, String), Vec<f64>> = BTreeMap::new();
    let mut beaten: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for record in csv::Reader::from_path(folder.join("manifest.csv"))?.records() {
        let record = record?;
        let (key, period, range): (&str, f64, f64) = (&record[0], record[5].parse()?, record[6].parse()?);
        if chosen.as_ref().is_some_and(|chosen| !key.starts_with(chosen.as_str())) {
            continue;
        }
        let samples = series(folder, key)?;
        for percent in PERCENTS.into_iter().filter(|percent| only("PERCENTS", percent)) {
            let delta = 0.01 * percent.parse::<f64>()? * range;
            let bound = if delta > 0.0 {
                Bound::Absolute(delta)
            } else {
                Bound::Lossless
            };
            let mut column = Column::new("x", bound)?;
            if period > 0.0 {
                column = column.with_period(period)?;
            }
            let name = (key.to_owned(), percent.to_owned());
            let others = references
                .get(&name)
                .into_iter()
                .flatten()
                .filter(|(codec, _)| !is_own(codec));
            let best = others.min_by(|a, b| a.1.total_cmp(b.1));
            for rows in ROWS.into_iter().filter(|rows| only("ROWS", &rows.to_string())) {
                let cost = measure(&samples, &column, rows)?;
                print!("{key},{percent},{rows},{:.4},{:.4}", cost.whole, cost.blocks);
                if let Some((codec, bits)) = best {
                    print!(",{codec},{bits},{:.3}", cost.whole / bits);
                    if rows == ROWS[0] && cost.whole > *bits {
                        beaten.entry(percent).or_default().push(format!(
                            "{key}: {:.4} ({:.4}) for {bits} of {codec}, {} rows",
                            cost.whole,
                            cost.blocks,
                            samples.len()
                        ));
                    }
                }
                println!();
                costs
                    .entry((percent, format!("{rows} rows, file")))
                    .or_default()
                    .push(cost.whole);
                costs
                    .entry((percent, format!("{rows} rows, blocks")))
                    .or_default()
                    .push(cost.blocks);
            }
        }
    }
    for ((percent, kind), bits) in &costs {
        println!("bound {percent} %, {kind}: mean {:.4} bits", bits.iter().sum::<f64>() / bits.len() as f64);
    }
    for (percent, list) in &beaten {
        println!("bound {percent} %: a file of another codec is smaller on {}", list.len());
        list.iter().for_each(|line| println!("  {line}"));
    }
    Ok(())
}
