//! Bits per sample and speed of blocks over a directory of recordings, beside pco on the plain lattice in the same run.
//!
//! ```text
//! cargo run --release -p fewbits-block-codec --example blocks -- DIRECTORY [BOUND]..
//! ```
//!
//! Each file `*.f64` is one recording: little-endian doubles. A name that contains `@P.` is a circle of period `P`. Bounds are in per cent of
//! the range (of the period); 0 is lossless. Bits are means over the recordings; a CRC-32 per block is counted with blocks of 512 and 128
//! rows; with starts, what all blocks of a recording share is told once and counted. Speeds are millions of samples per second of whole
//! recordings, the best of several times each (of `ROUNDS`, an environment variable; 5 if it is not set).

use fewbits_block_codec::{BlockCodec, Effort};
use pco::ChunkConfig;
use pco::standalone::{simple_compress, simple_decompress};
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
    let numbers = bytes.as_chunks::<8>().0.iter();
    let samples: Vec<f64> = numbers.map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let period = name.split_once('@').and_then(|(_, period)| period.parse().ok());
    let ends = samples
        .iter()
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let range = period.unwrap_or(ends.1 - ends.0);
    Ok(Recording { samples, period, range })
}

/// The result, and the shortest of several times in seconds.
fn timed<T>(rounds: usize, work: impl Fn() -> Result<T, Failure>) -> Result<(T, f64), Failure> {
    let (mut result, mut best) = (None, f64::INFINITY);
    for _ in 0..rounds.max(1) {
        let clock = Instant::now();
        result = Some(work()?);
        best = best.min(clock.elapsed().as_secs_f64());
    }
    Ok((result.ok_or("no round")?, best))
}

/// Bytes, and seconds of writing and reading, of the whole recording; the bound is checked.
fn whole(recording: &Recording, codec: BlockCodec, delta: f64, rounds: usize) -> Result<(usize, f64, f64), Failure> {
    let samples = &recording.samples;
    let (bytes, writing) = timed(rounds, || Ok(codec.encode(samples)?))?;
    let (values, reading) = timed(rounds, || Ok(codec.decode(&bytes, samples.len())?))?;
    for (value, sample) in values.iter().zip(samples) {
        let straight = (value - recording.period.map_or(*sample, |period| sample.rem_euclid(period))).abs();
        let error = recording
            .period
            .map_or(straight, |period| straight.min((period - straight).abs()));
        if error > delta && value.to_bits() != sample.to_bits() {
            return Err(format!("{sample} returned as {value}").into());
        }
    }
    Ok((bytes.len(), writing, reading))
}

/// Bytes of blocks of so many rows with a CRC-32 each, if wanted behind a start that the first block taught and whose bytes are counted.
fn blocks(recording: &Recording, codec: BlockCodec, rows: usize, with_start: bool) -> Result<usize, Failure> {
    let first = &recording.samples[..rows.min(recording.samples.len())];
    let start = with_start.then(|| codec.start(first)).flatten();
    let mut taught = Vec::new();
    if let Some(start) = &start {
        codec.code_start(&mut taught, Some(start))?;
    }
    let mut size = taught.len();
    for samples in recording.samples.chunks(rows) {
        size += 4 + match &start {
            Some(start) => codec.encode_from(start, samples, &[])?.bytes.len(),
            None => codec.encode(samples)?.len(),
        };
    }
    Ok(size)
}

/// Bytes and times of pco on the indices of the plain lattice; on the samples if lossless.
fn plain_pco(recording: &Recording, delta: f64, rounds: usize) -> Result<(usize, f64, f64), Failure> {
    let config = ChunkConfig::default();
    if delta == 0.0 {
        let (bytes, writing) = timed(rounds, || Ok(simple_compress(&recording.samples, &config)?))?;
        let (_, reading) = timed(rounds, || Ok(simple_decompress::<f64>(&bytes)?))?;
        return Ok((bytes.len(), writing, reading));
    }
    let first = recording.samples.first().copied().unwrap_or(0.0);
    let place = |x: &f64| ((x - first) / (2.0 * delta)).round() as i64;
    let indices: Vec<i64> = recording.samples.iter().map(place).collect();
    let (bytes, writing) = timed(rounds, || Ok(simple_compress(&indices, &config)?))?;
    let (_, reading) = timed(rounds, || Ok(simple_decompress::<i64>(&bytes)?))?;
    Ok((bytes.len(), writing, reading))
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let directory = arguments.next().ok_or("usage: blocks DIRECTORY [BOUND]..")?;
    let mut bounds: Vec<f64> = arguments.map(|bound| bound.parse()).collect::<Result<_, _>>()?;
    if bounds.is_empty() {
        bounds = vec![0.0, 1e-4, 0.01, 0.25, 1.0];
    }
    let rounds = std::env::var("ROUNDS").map_or(Ok(5), |rounds| rounds.parse())?;
    let mut files: Vec<_> = std::fs::read_dir(directory)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<_, _>>()?;
    files.retain(|file| file.extension().is_some_and(|extension| extension == "f64"));
    files.sort();
    let recordings = files.iter().map(|file| read(file)).collect::<Result<Vec<_>, _>>()?;
    println!(
        "bound%   bits: whole   fast    pco  512+crc 128+crc  with starts: 512 128 | 10^6/s, writing and reading: whole, fast, pco"
    );
    for bound in bounds {
        let (mut bits, mut times, mut all) = ([0.0; 7], [0.0; 6], 0.0);
        for recording in &recordings {
            let delta = 0.01 * bound * recording.range;
            let codec = if bound == 0.0 {
                BlockCodec::lossless()
            } else {
                let codec = BlockCodec::new(delta)?;
                recording.period.map_or(Ok(codec), |period| codec.on_circle(period))?
            };
            let n = recording.samples.len() as f64;
            let found = [
                whole(recording, codec, delta, rounds)?,
                whole(recording, codec.with_effort(Effort::Fast), delta, rounds)?,
                plain_pco(recording, delta, rounds)?,
            ];
            let sizes = [
                found[0].0,
                found[1].0,
                found[2].0,
                blocks(recording, codec, 512, false)?,
                blocks(recording, codec, 128, false)?,
                blocks(recording, codec, 512, true)?,
                blocks(recording, codec, 128, true)?,
            ];
            for (sum, bytes) in bits.iter_mut().zip(sizes) {
                *sum += 8.0 * bytes as f64 / n / recordings.len() as f64;
            }
            for (sum, spent) in times.iter_mut().zip(found.iter().flat_map(|(_, w, r)| [*w, *r])) {
                *sum += spent;
            }
            all += n;
        }
        let bits: Vec<String> = bits.iter().map(|bits| format!("{bits:.4}")).collect();
        let speeds: Vec<String> = times.iter().map(|time| format!("{:.1}", 1e-6 * all / time)).collect();
        println!("{bound:<8} {}  | {}", bits.join("  "), speeds.join("  "));
    }
    Ok(())
}
