//! What the blocks of one column have in common and is stored once: their grid, and where their first indices are.
//!
//! A container stores a [`Start`] where every reader has it. A block that uses it has no head and a short first index. The block is one
//! arithmetic code:
//!
//! ```text
//! with this start (255 of 256; otherwise the byte ff and a block of its own follow)   models (15 of 16) or counts
//! first index less the usual one: zigzag, its high bits by an Elias gamma code, k low bits   decisions as in other blocks
//! ```
//!
//! The start itself: grid (byte: decimals, or 13 line, 14 circle, 16 more if steps follow, 32 more if a phase does,
//! 64 more if decimals are rounded to single precision, 128 more if contexts of models have the lengths of rests), steps (unit and origin as in
//! blocks), phase (byte, as in blocks), usual index (zigzag varint), `k` (byte).

use crate::arithmetic::{Coder, Reader, Writer};
use crate::bytes::{Fields, unzigzag, zigzag};
use crate::counts::gamma;
use crate::error::{Damaged, ensure};
use crate::grid::Grid;
use crate::head::{PHASE, SINGLE, STEPS};
use crate::indices::{RESTS_ROWS, code_rest};
use crate::rows::{LARGEST, Others};
use crate::{BlockCodec, Effort, Error};

/// Probabilities, in units of `2^-16`, that a block uses the start, and that it is coded by models.
const WITH_START: u32 = 65_280;
const BY_MODELS: u32 = 61_440;
/// First byte of a block that does not use the start. No code that begins with the decision `WITH_START` begins with this byte.
const ALONE: u8 = 255;
/// Blocks of differences of more bits in the mean may be shorter otherwise; of few rows they rarely are.
const COARSE_BITS: usize = 1;
const COARSE_BITS_OF_FEW: usize = 2;
const FEW_ROWS: usize = 1024;
/// Flag beside the grid: contexts of models have the lengths of rests.
const RESTS: u8 = 128;
/// Indices are smaller than `2^47` in zigzag form.
const MOST_BITS: u8 = 47;

/// The common beginning of blocks of one column and one accuracy; made by [`BlockCodec::start`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    grid: Grid,
    /// First indices are expected about this one, in cells of `2^k`.
    usual: i64,
    k: u8,
    /// Contexts of models have the lengths of rests.
    rests: bool,
}

/// A block made with a [`Start`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StartedBlock {
    /// The block.
    pub bytes: Vec<u8>,
    /// Whether the other columns are needed to decode it. If not, none may be passed.
    pub joint: bool,
}

impl Start {
    /// The samples at these points of the grid.
    pub fn values(&self, indices: &[i64]) -> Vec<f64> {
        self.grid.values(indices)
    }

    fn first_index<C: Coder>(&self, coder: &mut C, wanted: Option<i64>) -> Result<i64, Damaged> {
        let k = u32::from(self.k);
        let z = wanted.map_or(0, |index| zigzag(index - self.usual));
        // The gamma code begins at one.
        let high = gamma(coder, (z >> k) + 1)? - 1;
        let low = coder.raw(z & ((1 << k) - 1), k);
        let offset = high.checked_mul(1 << k).map(|high| unzigzag(high | low));
        match offset.and_then(|offset| offset.checked_add(self.usual)) {
            Some(index) if index.unsigned_abs() <= LARGEST as u64 => Ok(index),
            _ => Err(Damaged::new("first index", "too large", "at most 2^46 in size")),
        }
    }
}

impl BlockCodec {
    /// The start for blocks of samples like these; `None` if no grid fits them.
    pub fn start(&self, samples: &[f64]) -> Option<Start> {
        let mut grid = self.grid(samples)?;
        if let Grid::Line { anchor, .. } = &mut grid {
            *anchor = 0.0;
        }
        let grid = grid.fitted(samples, self.effort);
        let (mut indices, _) = self.indices(&grid, samples);
        // The median has the smallest mean distance from the indices.
        indices.sort_unstable();
        let usual = indices[indices.len() / 2];
        let sizes: u128 = indices.iter().map(|index| u128::from(zigzag(index - usual))).sum();
        let mean = (sizes / indices.len() as u128) as u64;
        // On a circle all first indices are equally likely. Elsewhere the mean distance is below `2^k`, so the high bits are mostly zero.
        let (usual, k) = match grid.cells() {
            Some(cells) => (0, cells.ilog2()),
            None => (usual, (u64::BITS - mean.leading_zeros()).min(u32::from(MOST_BITS))),
        };
        let rests = samples.len() >= RESTS_ROWS;
        Some(Start {
            grid,
            usual,
            k: k as u8,
            rests,
        })
    }

    /// The fields of a start of a codec of the same accuracy; a reader has none.
    ///
    /// # Errors
    /// If a reader's bytes are not a start.
    pub fn code_start<F: Fields>(&self, fields: &mut F, own: Option<&Start>) -> Result<Start, Error> {
        let (kind, flags) = own.map_or((0, 0), |start| start.grid.form());
        let flags = (flags & STEPS) << 3 | (flags & (PHASE | SINGLE)) << 2;
        let rests = if own.is_some_and(|start| start.rests) { RESTS } else { 0 };
        let head = fields.byte(kind | flags | rests)?;
        let form = (head & 15, head >> 3 & STEPS | head >> 2 & (PHASE | SINGLE));
        let grid = self.code_grid(fields, own.map(|start| &start.grid), form)?;
        let usual = fields.signed(own.map_or(0, |start| start.usual))?;
        let k = fields.byte(own.map_or(0, |start| start.k))?;
        let is_small = usual.unsigned_abs() <= LARGEST as u64 && k <= MOST_BITS;
        ensure!(is_small, Damaged::new("usual index", usual, "at most 2^46 in size"));
        let rests = head & RESTS != 0;
        Ok(Start { grid, usual, k, rests })
    }

    /// As [`encode_with`](Self::encode_with), for a reader that has the start of a codec of the same accuracy.
    ///
    /// # Errors
    /// As [`encode_with`](Self::encode_with).
    pub fn encode_from(&self, start: &Start, samples: &[f64], others: &[&[f64]]) -> Result<StartedBlock, Error> {
        let others = Others::new(others, samples.len())?;
        let mut found: Vec<StartedBlock> = Vec::new();
        let (indices, exceptions) = self.indices(&start.grid, samples);
        let is_tabled = self.is_tabled(samples.len());
        if exceptions.is_empty() && !samples.is_empty() && !is_tabled {
            found.push(self.started(start, &indices, None)?);
            if self.effort == Effort::Thorough && others.is_some() {
                found.push(self.started(start, &indices, others.as_ref())?);
            }
        }
        // Tables are in blocks of their own only.
        let fine = match self.effort {
            Effort::Thorough => crate::encode::FINE,
            Effort::Fast => crate::fast::FINE,
        };
        let is_fine = found
            .first()
            .is_none_or(|block| block.bytes.len() > fine * samples.len() / 8);
        // If the start does not fit the block, a block of its own is shorter.
        if is_fine || !self.grid(samples).is_some_and(|grid| grid.is_like(&start.grid)) {
            let alone = self.encode_beside(samples, others.as_ref())?;
            found.push(StartedBlock {
                joint: alone.first().is_some_and(|head| head & 64 != 0),
                bytes: [&[ALONE], alone.as_slice()].concat(),
            });
        }
        let shortest = found.into_iter().min_by_key(|block| block.bytes.len());
        shortest.ok_or_else(|| Damaged::new("block", "none", "a coding that holds the samples").into())
    }

    /// The samples as indices on the start's grid, for [`code_shared`](Self::code_shared). `None` if a block of its own may be shorter: a
    /// sample is off the grid, another grid is better, or neighbours differ by many points; or if a block of its own is faster.
    pub fn indices_on(&self, start: &Start, samples: &[f64]) -> Option<Vec<i64>> {
        if self.is_tabled(samples.len()) {
            return None;
        }
        let (indices, exceptions) = self.indices(&start.grid, samples);
        let bits = |pair: &[i64]| u64::from(u64::BITS - pair[0].abs_diff(pair[1]).leading_zeros());
        let sizes: u64 = indices.windows(2).map(bits).sum();
        let few = samples.len() <= FEW_ROWS;
        let most = if few { COARSE_BITS_OF_FEW } else { COARSE_BITS };
        let is_fine = sizes > (most * samples.len()) as u64;
        if !exceptions.is_empty() || is_fine {
            return None;
        }
        let is_like = samples.is_empty() || self.grid(samples).is_some_and(|grid| grid.is_like(&start.grid));
        let begins_with_start = || Some(self.encode_from(start, samples, &[]).ok()?.bytes.first()? != &ALONE);
        (is_like || begins_with_start()?).then_some(indices)
    }

    /// Codes one column as a part of a longer arithmetic code: `wanted` at the writer, `None` at the reader. Returns the indices of
    /// `rows` rows, with `others` as regressors if there are any; [`Start::values`] converts them to samples.
    ///
    /// # Errors
    /// If a column has another number of rows, or the reader finds what no writer writes.
    pub fn code_shared<C: Coder>(
        &self,
        coder: &mut C,
        start: &Start,
        wanted: Option<&[i64]>,
        rows: usize,
        others: &[&[f64]],
    ) -> Result<Vec<i64>, Error> {
        let others = Others::new(others, rows)?;
        if rows == 0 {
            return Ok(Vec::new());
        }
        Ok(self.code(coder, start, wanted, rows, others.as_ref())?)
    }

    fn code<C: Coder>(
        &self,
        coder: &mut C,
        start: &Start,
        wanted: Option<&[i64]>,
        rows: usize,
        others: Option<&Others<'_>>,
    ) -> Result<Vec<i64>, Damaged> {
        let by_models = coder.bit(BY_MODELS, self.effort == Effort::Thorough);
        let first = start.first_index(coder, wanted.and_then(|wanted| wanted.first().copied()))?;
        code_rest(coder, by_models.then_some(start.rests), start.grid.cells(), first, wanted, rows, others)
    }

    fn started(&self, start: &Start, indices: &[i64], others: Option<&Others<'_>>) -> Result<StartedBlock, Damaged> {
        let bytes = Writer::all(Vec::with_capacity(64 + indices.len() / 2), |writer| {
            writer.bit(WITH_START, true);
            self.code(writer, start, Some(indices), indices.len(), others)
        })?;
        let joint = others.is_some();
        Ok(StartedBlock { bytes, joint })
    }

    /// The samples of a block of [`encode_from`](Self::encode_from) with the same start, and with the other columns if it is joint.
    ///
    /// # Errors
    /// As [`decode_with`](Self::decode_with).
    pub fn decode_from(&self, start: &Start, bytes: &[u8], rows: usize, others: &[&[f64]]) -> Result<Vec<f64>, Error> {
        if rows == 0 || bytes.first() == Some(&ALONE) {
            return self.decode_with(bytes.get(1..).unwrap_or_default(), rows, others);
        }
        let others = Others::new(others, rows)?;
        let indices = Reader::all(bytes, |reader| {
            reader.bit(WITH_START, true);
            self.code(reader, start, None, rows, others.as_ref())
        })?;
        Ok(start.values(&indices))
    }
}
