//! Bits per sample and speed of blocks over a directory of recordings, beside pco on the plain lattice and the coded stream.
//!
//! ```text
//! cargo run --release -p fewbits-adaptive --example blocks -- DIRECTORY [BOUND]..
//! ```
//!
//! Each file is one recording: little-endian doubles. A name that contains `@P.` is a circle of period `P`. Bounds are in per cent
//! of the range (of the period); 0 is lossless. Numbers are means over the recordings; a CRC-32 per block is counted with blocks of
//! 512 and 128 rows; with starts, what all blocks of a recording share is told once and counted.

use fewbits_adaptive::{Config, CosetConfig, CosetReceiver, CosetSensor, Sensor, Silence, StreamWriter};
use fewbits_block_codec::{BlockCodec, Effort};
use fewbits_core::Observation;
use pco::ChunkConfig;
use pco::standalone::simple_compress;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

type Failure = Box<dyn Error>;

struct Recording {
    samples: Vec<f64>,
    period: Option<f64>,
    range: f64,
}

fn read(file: &Path) -> Result<Recording, Failure> {
    let bytes = std::fs::read(file)?;
    let samples: Vec<f64> = bytes
        .as_chunks::<8>()
        .0
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
        .collect();
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let period = name.split_once('@').and_then(|(_, period)| period.parse().ok());
    let ends = samples
        .iter()
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let range = period.unwrap_or(ends.1 - ends.0);
    Ok(Recording { samples, period, range })
}

/// What the blocks of a recording share.
#[derive(Clone, Copy)]
enum Shared {
    Nothing,
    /// A start that the first block taught; its bytes are counted.
    Start,
}

/// Bytes and seconds of writing and reading in blocks of so many rows; the bound is checked.
fn blocks(
    recording: &Recording,
    codec: BlockCodec,
    delta: f64,
    rows: usize,
    shared: Shared,
) -> Result<(usize, f64, f64), Failure> {
    let (mut size, mut writing, mut reading) = (0, 0.0, 0.0);
    let first = &recording.samples[..rows.min(recording.samples.len())];
    let start = match shared {
        Shared::Nothing => None,
        Shared::Start => codec.start(first),
    };
    size += start.map_or(0, |start| start.to_bytes().len());
    for samples in recording.samples.chunks(rows) {
        let clock = Instant::now();
        let bytes = match &start {
            Some(start) => codec.encode_from(start, samples, &[])?.bytes,
            None => codec.encode(samples)?,
        };
        writing += clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let values = match &start {
            Some(start) => codec.decode_from(start, &bytes, samples.len(), &[])?,
            None => codec.decode(&bytes, samples.len())?,
        };
        reading += clock.elapsed().as_secs_f64();
        size += bytes.len();
        for (value, sample) in values.iter().zip(samples) {
            let straight = (value - recording.period.map_or(*sample, |period| sample.rem_euclid(period))).abs();
            let error = recording
                .period
                .map_or(straight, |period| straight.min((period - straight).abs()));
            if error > delta && value.to_bits() != sample.to_bits() {
                return Err(format!("{sample} returned as {value}").into());
            }
        }
    }
    Ok((size, writing, reading))
}

/// pco on the indices of the plain lattice, as if its order of differences had been chosen by itself; on the samples if lossless.
fn plain_pco(recording: &Recording, delta: f64) -> Result<usize, Failure> {
    if delta == 0.0 {
        return Ok(simple_compress(&recording.samples, &ChunkConfig::default())?.len());
    }
    let first = recording.samples.first().copied().unwrap_or(0.0);
    let indices: Vec<i64> = recording
        .samples
        .iter()
        .map(|x| ((x - first) / (2.0 * delta)).round() as i64)
        .collect();
    Ok(simple_compress(&indices, &ChunkConfig::default())?.len())
}

fn stream(recording: &Recording, config: Config) -> Result<usize, Failure> {
    let (mut sensor, mut stream) = (Sensor::new(config), StreamWriter::new(Silence::Coded));
    for sample in &recording.samples {
        sensor.write_after(1, *sample, &mut stream)?;
    }
    Ok(4 * stream.finish().len())
}

/// Bits and slots out of bound of coset reports, every fiftieth packet or so lost.
fn lossy(recording: &Recording, delta: f64) -> Result<(usize, usize), Failure> {
    let config = CosetConfig::new(delta, 4, 128)?;
    let (mut sensor, mut receiver) = (CosetSensor::new(config), CosetReceiver::new(config));
    let (mut bits, mut out, mut state) = (0, 0, 1_u64);
    for sample in &recording.samples {
        let report = sensor.encode(*sample)?;
        bits += report.map_or(0, |packet| packet.bits());
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let lost = (state >> 33) % 50 == 0;
        let observation = if lost { Observation::Nothing } else { report.into() };
        let value = receiver.receive(&observation)?.value;
        out += usize::from(value.is_none_or(|value| (value - sample).abs() > delta));
    }
    Ok((bits, out))
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let directory = arguments.next().ok_or("usage: blocks DIRECTORY [BOUND]..")?;
    let mut bounds: Vec<f64> = arguments.map(|bound| bound.parse()).collect::<Result<_, _>>()?;
    if bounds.is_empty() {
        bounds = vec![0.0, 1e-4, 0.25, 0.5, 1.0, 2.0];
    }
    let mut files: Vec<_> = std::fs::read_dir(directory)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<_, _>>()?;
    files.sort();
    let recordings = files.iter().map(|file| read(file)).collect::<Result<Vec<_>, _>>()?;
    println!(
        "bound%  whole  512+crc  128+crc   fast    pco  stream | writes  reads  fast: writes reads (10^6/s) | lossy bits  out% | with starts: 512+crc 128+crc, fast"
    );
    for bound in bounds {
        let mut sums = [0.0; 12];
        let (mut times, mut samples) = ([0.0; 4], 0.0);
        for recording in &recordings {
            let delta = 0.01 * bound * recording.range;
            let codec = if bound == 0.0 {
                BlockCodec::lossless()
            } else {
                let codec = BlockCodec::new(delta)?;
                recording.period.map_or(Ok(codec), |period| codec.on_circle(period))?
            };
            let n = recording.samples.len();
            let quick = codec.with_effort(Effort::Fast);
            let (whole, writing, reading) = blocks(recording, codec, delta, n, Shared::Nothing)?;
            let (fast, fast_writing, fast_reading) = blocks(recording, quick, delta, n, Shared::Nothing)?;
            let in_blocks = |codec, rows, shared| {
                let (bytes, ..) = blocks(recording, codec, delta, rows, shared)?;
                Ok::<_, Failure>(bytes + 4 * n.div_ceil(rows))
            };
            let mut sizes = [
                whole,
                in_blocks(codec, 512, Shared::Nothing)?,
                in_blocks(codec, 128, Shared::Nothing)?,
                fast,
                0,
                0,
                in_blocks(codec, 512, Shared::Start)?,
                in_blocks(codec, 128, Shared::Start)?,
                in_blocks(quick, 512, Shared::Start)?,
                in_blocks(quick, 128, Shared::Start)?,
            ]
            .map(|b| 8 * b);
            sizes[4] = 8 * plain_pco(recording, delta)?;
            let mut lost = (0, 0);
            if bound > 0.0 {
                let config = Config::new(delta)?;
                let config = recording.period.map_or(Ok(config), |period| config.circular(period))?;
                sizes[5] = 8 * stream(recording, config)?;
                if recording.period.is_none() && bound > 0.01 {
                    lost = lossy(recording, delta)?;
                }
            }
            let all = sizes.into_iter().chain([lost.0, 100 * lost.1]);
            for (sum, bits) in sums.iter_mut().zip(all) {
                *sum += bits as f64 / n as f64 / recordings.len() as f64;
            }
            for (time, spent) in times.iter_mut().zip([writing, reading, fast_writing, fast_reading]) {
                *time += spent;
            }
            samples += n as f64;
        }
        let speed = times.map(|time| 1e-6 * samples / time);
        println!(
            "{bound:<7} {:.4}  {:.4}   {:.4}  {:.4}  {:.4}  {:.4} | {:.2} {:.2}  {:.1} {:.1} | {:.3} {:.2} | {:.4} {:.4}, {:.4} {:.4}",
            sums[0],
            sums[1],
            sums[2],
            sums[3],
            sums[4],
            sums[5],
            speed[0],
            speed[1],
            speed[2],
            speed[3],
            sums[10],
            sums[11],
            sums[6],
            sums[7],
            sums[8],
            sums[9]
        );
    }
    Ok(())
}
