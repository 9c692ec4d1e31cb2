//! Blocks whose signal changes its kind: sections with a grid and a coding of their own.
//!
//! ```text
//! number of sections less 1 (varint)
//! each section                         its number of rows, its length in bytes (varints; the last one has what is left of both), a block without sections
//! ```

use crate::bytes::{Bytes, push_varint};
use crate::groups::{joined, sums};
use crate::head::{SAMPLES, STORED, TABLED};
use crate::vectors::narrow;
use crate::{BlockCodec, Error};
use fewbits_node::elementary::log2;

/// The first bytes of a block of sections.
pub(crate) const SECTIONS: [u8; 2] = [SAMPLES | 128, TABLED | STORED];

/// Rows of a piece, at whose ends sections may end.
const PIECE: usize = 2048;
/// Smallest number of rows of a block that may have sections.
pub(crate) const LEAST_ROWS: usize = 4 * PIECE;
/// Differences of a piece that are counted: runs of so many rows, a run in so many rows.
const RUN: usize = 64;
const EVERY: usize = 256;
/// Classes of differences.
const CLASSES: usize = 64;
/// Bits that a section costs in addition to its rows.
const BITS_OF_SECTION: f32 = 1200.0;

/// How often each class of differences occurs in the runs of a piece that are counted.
#[inline(always)]
fn counts(piece: &[i64]) -> [u32; CLASSES] {
    let mut counts = [0; CLASSES];
    for run in piece.chunks(EVERY) {
        for pair in run[..run.len().min(RUN)].windows(2) {
            counts[class(pair[1].wrapping_sub(pair[0]))] += 1;
        }
    }
    counts
}

/// The bits of all rows, of which some are counted.
#[inline(always)]
fn bits(rows: usize, counts: &[u32; CLASSES]) -> f32 {
    let (sum, logs) = sums(counts);
    let sum = sum.max(1.0);
    rows as f32 * (log2(sum) - logs / sum)
}

/// A class of differences: small ones have their own, of larger ones those of one length in bits share one.
#[inline(always)]
fn class(step: i64) -> usize {
    let size = step.unsigned_abs();
    if size < 4 {
        2 * size as usize + usize::from(step < 0)
    } else {
        (6 + size.ilog2() as usize).min(CLASSES - 1)
    }
}

/// The rows of each section; one section if the signal is of one kind.
pub(crate) fn sections(numbers: &[i64]) -> Vec<usize> {
    narrow!({
        let pieces = numbers.chunks(PIECE).map(|piece| (piece.len(), counts(piece)));
        let groups = joined(pieces, bits, -BITS_OF_SECTION);
        groups.iter().map(|group| group.size).collect()
    })
}

impl BlockCodec {
    /// A block of sections of so many rows each.
    pub(crate) fn encode_sections(&self, mut samples: &[f64], sections: &[usize]) -> Result<Vec<u8>, Error> {
        let mut bytes = SECTIONS.to_vec();
        push_varint(&mut bytes, sections.len() as u64 - 1);
        for (place, rows) in sections.iter().enumerate() {
            let (section, others) = samples.split_at(*rows);
            let block = self.encode_fast(section, false)?;
            if place + 1 < sections.len() {
                push_varint(&mut bytes, *rows as u64);
                push_varint(&mut bytes, block.len() as u64);
            }
            bytes.extend(block);
            samples = others;
        }
        Ok(bytes)
    }

    /// The samples of a block of sections, behind its first bytes.
    pub(crate) fn decode_sections(&self, bytes: &[u8], rows: usize) -> Result<Vec<f64>, Error> {
        let mut bytes = Bytes(bytes);
        let mut samples = Vec::new();
        for _ in 0..bytes.count(rows - 1, "number of sections")? {
            let left = rows - samples.len();
            let own = bytes.count(left.saturating_sub(1), "rows of a section")?.max(1);
            let length = bytes.count(usize::MAX, "length of a section")?;
            samples.extend(self.decode_section(bytes.take(length)?, own, None)?);
        }
        samples.extend(self.decode_section(bytes.0, rows - samples.len(), None)?);
        Ok(samples)
    }
}
