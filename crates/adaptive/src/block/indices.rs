//! Conversion of the indices of a block to bytes and back, in each of the codings.

use super::coder::{Coder, Reader, Writer};
use super::counts::Counts;
use super::grid::{Grid, unzigzag, zigzag};
use super::head::{Coding, write_head};
use super::model::Model;
use super::rows::{LARGEST, Others, code_all};
use fewbits_core::CodecError;
use pco::data_types::Number;
use pco::standalone::{DecompressorItem, FileDecompressor, simple_compress};
use pco::{ChunkConfig, DeltaSpec};

/// Bits of the length field of the first index.
const FIRST_LENGTH: u32 = 6;

fn from_pco(error: impl std::fmt::Display) -> CodecError {
    CodecError::invalid("pco block", error, "what a writer of as many rows wrote")
}

/// Codes the first index of a block that has no [`Start`](super::Start).
fn code_first<C: Coder>(coder: &mut C, wanted: Option<i64>) -> Result<i64, CodecError> {
    let z = wanted.map_or(0, zigzag);
    let length = coder.raw(u64::from(u64::BITS - z.leading_zeros()), FIRST_LENGTH) as u32;
    let first = unzigzag(coder.raw(z, length));
    if first.unsigned_abs() > LARGEST as u64 {
        return Err(CodecError::invalid("first index", first, "at most 2^46 in size"));
    }
    Ok(first)
}

/// Codes the indices after the first one by models, or by counts with one bit in front. Counts do not use `others`.
pub(super) fn code_rest<C: Coder>(
    coder: &mut C,
    by_models: bool,
    grid: &Grid,
    first: i64,
    wanted: Option<&[i64]>,
    rows: usize,
    others: Option<&Others<'_>>,
) -> Result<Vec<i64>, CodecError> {
    if by_models {
        let model = Model::new(rows, first, grid.cells(), others.is_some());
        return code_all(coder, model, wanted, rows, others);
    }
    // The reader does not know the indices in advance: whether differences of differences are smaller is told.
    let second = coder.raw(u64::from(wanted.is_some_and(Counts::prefers_second)), 1) == 1;
    code_all(coder, Counts::new(first, second), wanted, rows, None)
}

/// A block whose indices are coded by models or by counts.
pub(super) fn write_block(
    by_models: bool,
    grid: &Grid,
    indices: &[i64],
    exceptions: &[(usize, f64)],
    others: Option<&Others<'_>>,
) -> Result<Vec<u8>, CodecError> {
    let mut bytes = Vec::with_capacity(64 + indices.len() / 2);
    let coding = if by_models { Coding::Models } else { Coding::Counts };
    write_head(grid, coding, others.is_some(), exceptions, &mut bytes);
    let mut writer = Writer::new(bytes);
    let first = code_first(&mut writer, Some(indices.first().copied().unwrap_or(0)))?;
    code_rest(&mut writer, by_models, grid, first, Some(indices), indices.len(), others)?;
    Ok(writer.finish())
}

/// The indices of a block of [`write_block`], without its head.
pub(super) fn read_block(
    bytes: &[u8],
    by_models: bool,
    grid: &Grid,
    rows: usize,
    others: Option<&Others<'_>>,
) -> Result<Vec<i64>, CodecError> {
    let mut reader = Reader::new(bytes);
    let first = code_first(&mut reader, None)?;
    let indices = code_rest(&mut reader, by_models, grid, first, None, rows, others)?;
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
        return Err(CodecError::invalid("block", format!("{} bytes", bytes.len()), "8 bytes per row"));
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
