//! Conversion of the indices of a block to bytes and back, in each of the codings.

use super::coder::{Coder, Reader, Writer};
use super::counts::Counts;
use super::grid::{Grid, unzigzag, zigzag};
use super::head::{Coding, invalid, write_head};
use super::model::Model;
use super::rows::{LARGEST, Others, code_all};
use fewbits_core::CodecError;
use pco::data_types::Number;
use pco::standalone::{DecompressorItem, FileDecompressor, simple_compress};
use pco::{ChunkConfig, DeltaSpec};

/// Bits of the length field of the first index.
const FIRST_LENGTH: u32 = 6;

fn from_pco(error: impl std::fmt::Display) -> CodecError {
    invalid("pco block", error, "what a writer of as many rows wrote")
}

fn write_first(writer: &mut Writer, indices: &[i64]) -> i64 {
    let first = indices.first().copied().unwrap_or(0);
    let length = u64::BITS - zigzag(first).leading_zeros();
    writer.raw(u64::from(length), FIRST_LENGTH);
    writer.raw(zigzag(first), length);
    first
}

fn read_first(reader: &mut Reader<'_>) -> Result<i64, CodecError> {
    let length = reader.raw(0, FIRST_LENGTH) as u32;
    let first = unzigzag(reader.raw(0, length));
    if first.unsigned_abs() > LARGEST as u64 {
        return Err(invalid("first index", first, "at most 2^46 in size"));
    }
    Ok(first)
}

pub(super) fn with_models(
    grid: &Grid,
    indices: &[i64],
    exceptions: &[(usize, f64)],
    others: Option<&Others<'_>>,
) -> Result<Vec<u8>, CodecError> {
    let mut bytes = Vec::with_capacity(64 + indices.len() / 2);
    write_head(grid, Coding::Models, others.is_some(), exceptions, &mut bytes);
    let mut writer = Writer::new(bytes);
    let first = write_first(&mut writer, indices);
    let model = Model::new(indices.len(), first, grid.cells(), others.is_some());
    code_all(&mut writer, model, Some(indices), indices.len(), others)?;
    Ok(writer.finish())
}

pub(super) fn read_models(
    bytes: &[u8],
    rows: usize,
    grid: &Grid,
    others: Option<&Others<'_>>,
) -> Result<Vec<i64>, CodecError> {
    let mut reader = Reader::new(bytes);
    let first = read_first(&mut reader)?;
    let model = Model::new(rows, first, grid.cells(), others.is_some());
    let indices = code_all(&mut reader, model, None, rows, others)?;
    reader.finish()?;
    Ok(indices)
}

pub(super) fn with_counts(grid: &Grid, indices: &[i64], exceptions: &[(usize, f64)]) -> Result<Vec<u8>, CodecError> {
    let mut bytes = Vec::with_capacity(64 + indices.len() / 2);
    write_head(grid, Coding::Counts, false, exceptions, &mut bytes);
    let mut writer = Writer::new(bytes);
    let first = write_first(&mut writer, indices);
    let second = Counts::prefers_second(indices);
    writer.raw(u64::from(second), 1);
    code_all(&mut writer, Counts::new(first, second), Some(indices), indices.len(), None)?;
    Ok(writer.finish())
}

pub(super) fn read_counts(bytes: &[u8], rows: usize) -> Result<Vec<i64>, CodecError> {
    let mut reader = Reader::new(bytes);
    let first = read_first(&mut reader)?;
    let counts = Counts::new(first, reader.raw(0, 1) == 1);
    let indices = code_all(&mut reader, counts, None, rows, None)?;
    reader.finish()?;
    Ok(indices)
}

/// Orders of differences that are tried besides the one that pco chooses, which is bad for few distinct indices.
const ORDERS: [usize; 2] = [0, 1];

pub(super) fn smallest_pco<T: Number>(numbers: &[T]) -> Result<Vec<u8>, CodecError> {
    let mut best = simple_compress(numbers, &ChunkConfig::default()).map_err(from_pco)?;
    for order in ORDERS {
        let config = ChunkConfig::default().with_delta_spec(DeltaSpec::TryConsecutive(order));
        let bytes = simple_compress(numbers, &config).map_err(from_pco)?;
        if bytes.len() < best.len() {
            best = bytes;
        }
    }
    Ok(best)
}

pub(super) fn raw_samples(bytes: &[u8], rows: usize) -> Result<Vec<f64>, CodecError> {
    let (samples, rest) = bytes.as_chunks::<8>();
    if samples.len() != rows || !rest.is_empty() {
        return Err(invalid("block", format!("{} bytes", bytes.len()), "8 bytes per row"));
    }
    Ok(samples.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

/// Numbers of a pco stream. It must have as many as there are rows, and nothing after them.
pub(super) fn from_pco_bytes<T: Number + Default>(bytes: &[u8], rows: usize) -> Result<Vec<T>, CodecError> {
    let mut numbers = Vec::new();
    let (file, mut rest) = FileDecompressor::new(bytes).map_err(from_pco)?;
    while let DecompressorItem::Chunk(mut chunk) = file.chunk_decompressor::<T, _>(rest).map_err(from_pco)? {
        let (start, count) = (numbers.len(), chunk.n());
        if count > rows - start {
            return Err(from_pco(format!("{count} rows more")));
        }
        numbers.resize(start + count, T::default());
        chunk.read(&mut numbers[start..]).map_err(from_pco)?;
        rest = chunk.into_src();
    }
    // The footer of pco is one byte.
    if numbers.len() != rows || rest.len() != 1 {
        let missing = rows - numbers.len();
        return Err(from_pco(format!("{missing} rows too few, {} bytes left", rest.len())));
    }
    Ok(numbers)
}
