//! Conversion of the indices of a block to bytes and back, in each of the codings.

use crate::arithmetic::{Coder, Writer};
use crate::bytes::{unzigzag, zigzag};
use crate::counts::Counts;
use crate::error::{Damaged, ensure};
use crate::grid::Grid;
use crate::model::Model;
use crate::rows::{LARGEST, Others, code_all};
use pco::data_types::Number;
use pco::standalone::{DecompressorItem, FileDecompressor};
use pco::wrapped::{self, FileCompressor};
use pco::{ChunkConfig, DeltaSpec, PagingSpec};

/// Bits of the length field of the first index.
const FIRST_LENGTH: u32 = 6;

fn from_pco(error: impl std::fmt::Display) -> Damaged {
    Damaged::new("pco block", error, "what a writer of as many rows wrote")
}

/// Lengths of first indices from here on say that contexts have the lengths of rests: indices are shorter.
const WITH_RESTS: u32 = 48;
/// Least number of rows of blocks whose contexts have the lengths of rests: in shorter ones they do not learn enough.
pub(crate) const RESTS_ROWS: usize = 1024;

/// Codes the first index of a block that has no [`Start`](crate::Start), and whether contexts have the lengths of rests.
pub(crate) fn code_first<C: Coder>(coder: &mut C, wanted: Option<i64>, rests: bool) -> Result<(i64, bool), Damaged> {
    let z = wanted.map_or(0, zigzag);
    let length = u64::BITS - z.leading_zeros();
    let told = if rests && length < (1 << FIRST_LENGTH) - WITH_RESTS {
        length + WITH_RESTS
    } else {
        length
    };
    let told = coder.raw(u64::from(told), FIRST_LENGTH) as u32;
    let rests = told >= WITH_RESTS;
    let length = if rests { told - WITH_RESTS } else { told };
    let first = unzigzag(coder.raw(z, length));
    ensure!(first.unsigned_abs() <= LARGEST as u64, Damaged::new("first index", first, "at most 2^46 in size"));
    Ok((first, rests))
}

/// Codes the indices after the first one (on a circle of so many `cells`, if there is one) by models, whose contexts have the lengths of `rests` or
/// not, or if `rests` is `None` by counts with one bit in front. Counts do not use `others`.
pub(crate) fn code_rest<C: Coder>(
    coder: &mut C,
    rests: Option<bool>,
    cells: Option<i64>,
    first: i64,
    wanted: Option<&[i64]>,
    rows: usize,
    others: Option<&Others<'_>>,
) -> Result<Vec<i64>, Damaged> {
    if let Some(rests) = rests {
        let model = Model::new(rows, first, cells, others.is_some(), rests);
        return code_all(coder, model, wanted, rows, others);
    }
    // The reader does not know the indices in advance: whether differences of differences are smaller is told.
    let second = coder.raw(u64::from(wanted.is_some_and(Counts::prefers_second)), 1) == 1;
    code_all(coder, Counts::new(first, second), wanted, rows, None)
}

/// Codes the indices of a block without a start by models or by counts: `wanted` at the writer, `None` at the reader.
pub(crate) fn code_block<C: Coder>(
    coder: &mut C,
    by_models: bool,
    grid: &Grid,
    wanted: Option<&[i64]>,
    rows: usize,
    others: Option<&Others<'_>>,
) -> Result<Vec<i64>, Damaged> {
    let first = wanted.and_then(|indices| indices.first().copied());
    let (first, rests) = code_first(coder, first, by_models && rows >= RESTS_ROWS)?;
    ensure!(by_models || !rests, Damaged::new("first index", "too long", "at most 2^46 in size"));
    code_rest(coder, by_models.then_some(rests), grid.cells(), first, wanted, rows, others)
}

/// Appends the code of these indices by models or by counts to the head of a block.
pub(crate) fn write_block(
    mut bytes: Vec<u8>,
    by_models: bool,
    grid: &Grid,
    indices: &[i64],
    others: Option<&Others<'_>>,
) -> Result<Vec<u8>, Damaged> {
    bytes.reserve(64 + indices.len() / 2);
    Writer::all(bytes, |coder| code_block(coder, by_models, grid, Some(indices), indices.len(), others))
}

/// Orders of differences that are tried besides the one that pco chooses, which is bad for few distinct indices.
const ORDERS: [usize; 2] = [0, 1];
/// Effort of pco, which costs time only: to choose the order, and for the best order.
pub(crate) const LEVEL: usize = 8;
const MOST_LEVEL: usize = 12;
/// Ratio of lengths from which the highest effort is not tried: it saves a few per cent.
const FAR_LONGER: [usize; 2] = [4, 5];
/// Largest number of rows of a page of pco.
const MOST_ROWS: usize = 1 << 24;
/// Number of rows that are read at once: pco reads whole batches of 256.
const BATCH: usize = 1 << 12;

/// The numbers in pco's wrapped form: the container has the number of rows and the type. `None` for too many rows.
pub(crate) fn to_wrapped_pco<T: Number>(
    numbers: &[T],
    delta: &DeltaSpec,
    level: usize,
) -> Result<Option<Vec<u8>>, Damaged> {
    if numbers.is_empty() || numbers.len() > MOST_ROWS {
        return Ok(None);
    }
    let config = ChunkConfig::default().with_compression_level(level);
    let config = config
        .with_delta_spec(delta.clone())
        .with_paging_spec(PagingSpec::Exact(vec![numbers.len()]));
    let file = FileCompressor::default();
    let mut bytes = Vec::new();
    file.write_header(&mut bytes).map_err(from_pco)?;
    let mut chunk = file.chunk_compressor(numbers, &config).map_err(from_pco)?;
    chunk.write_meta(&mut bytes).map_err(from_pco)?;
    chunk.write_page(0, &mut bytes).map_err(from_pco)?;
    Ok(Some(bytes))
}

/// The shortest of several codes of [`to_wrapped_pco`]. `shortest`: the length of another code. The highest effort is tried if it may be shorter.
pub(crate) fn smallest_pco<T: Number>(numbers: &[T], shortest: usize) -> Result<Option<Vec<u8>>, Damaged> {
    let mut delta = DeltaSpec::default();
    let Some(mut best) = to_wrapped_pco(numbers, &delta, LEVEL)? else {
        return Ok(None);
    };
    for order in ORDERS {
        let tried = DeltaSpec::TryConsecutive(order);
        if let Some(bytes) = to_wrapped_pco(numbers, &tried, LEVEL)?.filter(|bytes| bytes.len() < best.len()) {
            (best, delta) = (bytes, tried);
        }
    }
    if best.len() / FAR_LONGER[1] > shortest / FAR_LONGER[0] {
        return Ok(Some(best));
    }
    let most = to_wrapped_pco(numbers, &delta, MOST_LEVEL)?;
    Ok(most.filter(|bytes| bytes.len() < best.len()).or(Some(best)))
}

/// Numbers of [`to_wrapped_pco`]. Nothing may follow them.
pub(crate) fn from_wrapped_pco<T: Number + Default>(bytes: &[u8], rows: usize) -> Result<Vec<T>, Damaged> {
    ensure!(rows <= MOST_ROWS, from_pco(format!("{rows} rows")));
    let (file, rest) = wrapped::FileDecompressor::new(bytes).map_err(from_pco)?;
    let (mut chunk, rest) = file.chunk_decompressor::<T, _>(rest).map_err(from_pco)?;
    let mut page = chunk.page_decompressor(rest, rows).map_err(from_pco)?;
    let mut numbers: Vec<T> = Vec::new();
    while numbers.len() < rows {
        // Whole batches: memory grows only as far as the bytes reach.
        let start = numbers.len();
        numbers.resize(rows.min(start + BATCH), T::default());
        page.read(&mut numbers[start..]).map_err(from_pco)?;
    }
    match page.into_src().len() {
        0 => Ok(numbers),
        left => Err(from_pco(format!("{left} bytes left"))),
    }
}

pub(crate) fn raw_samples(bytes: &[u8], rows: usize) -> Result<Vec<f64>, Damaged> {
    let (samples, rest) = bytes.as_chunks::<8>();
    let given = || format!("{} bytes", bytes.len());
    ensure!(samples.len() == rows && rest.is_empty(), Damaged::new("block", given(), "8 bytes per row"));
    Ok(samples.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

/// Numbers of a standalone pco stream, which blocks had before the wrapped form. It must have as many as there are rows, and nothing after them.
pub(crate) fn from_pco_bytes<T: Number + Default>(bytes: &[u8], rows: usize) -> Result<Vec<T>, Damaged> {
    let mut numbers = Vec::new();
    let (file, mut rest) = FileDecompressor::new(bytes).map_err(from_pco)?;
    while let DecompressorItem::Chunk(mut chunk) = file.chunk_decompressor::<T, _>(rest).map_err(from_pco)? {
        let (start, count) = (numbers.len(), chunk.n());
        ensure!(count <= rows - start, from_pco(format!("{count} rows more")));
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
