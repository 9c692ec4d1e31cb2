//! `fewbits bench`: sizes and speeds of several codecs on a table, in one run.
//!
//! Lossy columns are compared at equal guaranteed error: pco gets the indices of a lattice of step `2 delta`. zstd has no error bound and
//! gets the doubles.

use crate::arguments::BenchOptions;
use crate::error::Error;
use crate::input::Cells;
use crate::numbers::widened;
use crate::pack::schema;
use crate::{Ending, output};
use fewbits_record::{Bound, Effort, Playback, Recorder, Schema};
use pco::ChunkConfig;
use pco::standalone::{simple_compress, simple_decompress};
use serde::Serialize;
use std::io::Cursor;
use std::time::Instant;

/// Bits of an uncompressed sample.
const RAW_BITS: f64 = 64.0;

#[derive(Serialize)]
struct Line {
    codec: &'static str,
    /// The error bound of its restored values.
    promise: &'static str,
    bytes: usize,
    bits_per_sample: f64,
    encode_samples_per_second: f64,
    decode_samples_per_second: f64,
}

fn line(codec: &'static str, promise: &'static str, bytes: usize, samples: usize, encode: f64, decode: f64) -> Line {
    Line {
        codec,
        promise,
        bytes,
        bits_per_sample: 8.0 * bytes as f64 / samples as f64,
        encode_samples_per_second: samples as f64 / encode,
        decode_samples_per_second: samples as f64 / decode,
    }
}

fn ours(
    codec: &'static str,
    effort: Effort,
    schema: Schema,
    ticks: &[i64],
    columns: &Cells,
) -> Result<Line, fewbits_record::Error> {
    let samples = columns.len() * ticks.len();
    let start = Instant::now();
    let mut recorder = Recorder::new(Vec::new(), schema).with_effort(effort);
    let mut row = Vec::with_capacity(columns.len());
    for (i, tick) in ticks.iter().enumerate() {
        row.clear();
        row.extend(columns.iter().map(|column| column[i]));
        recorder.push(*tick, &row)?;
    }
    let bytes = recorder.finish()?;
    let encode = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let mut rows = 0;
    for block in Playback::new(Cursor::new(&bytes))?.blocks() {
        rows += block?.rows();
    }
    debug_assert_eq!(rows, ticks.len());
    Ok(line(codec, "as asked", bytes.len(), samples, encode, start.elapsed().as_secs_f64()))
}

fn failed(_: pco::errors::PcoError) -> Error {
    Error::Option {
        option: "bench",
        value: "pco".to_owned(),
        expected: "samples that pco takes",
    }
}

fn packed<T: pco::data_types::Number>(columns: &[Vec<T>]) -> Result<(usize, f64, f64), Error> {
    let (mut bytes, mut encode, mut decode) = (0, 0.0, 0.0);
    for column in columns {
        let start = Instant::now();
        let packed = simple_compress(column, &ChunkConfig::default()).map_err(failed)?;
        encode += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let restored: Vec<T> = simple_decompress(&packed).map_err(failed)?;
        decode += start.elapsed().as_secs_f64();
        debug_assert_eq!(restored.len(), column.len());
        bytes += packed.len();
    }
    Ok((bytes, encode, decode))
}

/// Indices on a lattice of `2 delta` for lossy columns; `None` if a column has another kind of bound.
fn indices(schema: &Schema, finite: &[Vec<f64>]) -> Option<Vec<Vec<i64>>> {
    let column = |(column, samples): (&fewbits_record::Column, &Vec<f64>)| {
        let (low, high) = samples.iter().copied().fold(None, widened).unwrap_or_default();
        let step = match column.bound() {
            Bound::Absolute(delta) => 2.0 * delta,
            Bound::ShareOfRange(share) => 2.0 * share * column.period().unwrap_or(high - low),
            Bound::Decimals(places) => 10_f64.powi(-i32::from(places)),
            _ => return None,
        };
        Some(samples.iter().map(|x| (x / step).round() as i64).collect())
    };
    schema.columns().iter().zip(finite).map(column).collect()
}

/// Runs the task.
pub(crate) fn run(options: &BenchOptions) -> Result<Ending, Error> {
    let (mut table, schema) = schema(&options.table, &options.bounds)?;
    let (ticks, columns) = table.rows(schema.time(), usize::MAX)?;
    let file = table.file().to_owned();
    let samples = columns.len() * ticks.len();
    let finite: Vec<Vec<f64>> = columns
        .iter()
        .map(|cells| cells.iter().flatten().copied().filter(|x| x.is_finite()).collect())
        .collect();
    let mut lines = Vec::new();
    for (name, effort) in [("fewbits", Effort::Thorough), ("fewbits --fast", Effort::Fast)] {
        lines.push(ours(name, effort, schema.clone(), &ticks, &columns).map_err(Error::recording(&file))?);
    }
    if let Ok(one) = schema.clone().with_rows_per_block(ticks.len()) {
        lines.push(
            ours("fewbits, one block", Effort::Thorough, one, &ticks, &columns).map_err(Error::recording(&file))?,
        );
    }
    if let Some(indices) = indices(&schema, &finite) {
        let (bytes, encode, decode) = packed(&indices)?;
        lines.push(line("lattice + pco", "as asked, no gaps, no time", bytes, samples, encode, decode));
    }
    let (bytes, encode, decode) = packed(&finite)?;
    lines.push(line("pco", "lossless, no gaps, no time", bytes, samples, encode, decode));
    #[cfg(feature = "zstd")]
    lines.push(zstandard(&finite, samples).map_err(Error::io("zstd", "compress"))?);
    if options.json {
        output::json(&lines)?;
        return Ok(Ending::Good);
    }
    let mut text = format!("{} rows of {} columns, {} bytes as doubles\n", ticks.len(), columns.len(), 8 * samples);
    let head = ["codec", "bytes", "bits each", "ratio", "M/s encode", "M/s decode"];
    let [codec, bytes, bits, ratio, encode, decode] = head;
    text += &format!("{codec:<20} {bytes:>12} {bits:>10} {ratio:>8} {encode:>12} {decode:>12}  promise\n");
    for line in &lines {
        text += &format!(
            "{:<20} {:>12} {:>10.3} {:>8.1} {:>12.2} {:>12.2}  {}\n",
            line.codec,
            line.bytes,
            line.bits_per_sample,
            RAW_BITS / line.bits_per_sample,
            1e-6 * line.encode_samples_per_second,
            1e-6 * line.decode_samples_per_second,
            line.promise
        );
    }
    output::print(&text)?;
    Ok(Ending::Good)
}

#[cfg(feature = "zstd")]
fn zstandard(columns: &[Vec<f64>], samples: usize) -> std::io::Result<Line> {
    /// Compression level of the zstd references in `docs/record.md`.
    const LEVEL: i32 = 19;
    let raw: Vec<u8> = columns.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    let start = Instant::now();
    let packed = zstd::encode_all(&raw[..], LEVEL)?;
    let encode = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let restored = zstd::decode_all(&packed[..])?;
    debug_assert_eq!(restored.len(), raw.len());
    let decode = start.elapsed().as_secs_f64();
    Ok(line("zstd 19", "lossless, no gaps, no time", packed.len(), samples, encode, decode))
}
