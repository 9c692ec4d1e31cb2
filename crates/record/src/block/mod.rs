//! Blocks: groups of rows that can be decoded with nothing but the header.
//!
//! `docs/record.md` describes each byte. A block has one section of bytes per column that is coded alone. Then follows one arithmetic code
//! for special cells and all columns that use their starts: one code has one end and needs no lengths.

mod read;
mod shared;
mod write;

use crate::codec::CodecId;
use crate::error::Damage;
use crate::header::Header;
use crate::wire::read_checked;
pub(crate) use read::{content_of, decode, only, renewed};
pub(crate) use write::Rows;

/// The cells of one column; `None` is a gap.
pub type Cells = Vec<Option<f64>>;

/// Rows of a recording, restored or to be stored.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Block {
    /// Which block of the recording it is, from 0 on; `None` in recordings of version 5.
    pub number: Option<u64>,
    /// The tick of each row.
    pub ticks: Vec<i64>,
    /// One list of cells per column; `None` is a gap. The list of a column that was not requested is empty.
    pub columns: Vec<Cells>,
    /// For columns with a share of the range, the bound in this block in units of the column; 0 means lossless. `None` for others.
    pub share_bounds: Vec<Option<f64>>,
}

impl Block {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.ticks.len()
    }
}

/// Blocks have smaller numbers.
pub(crate) const NUMBERS: u64 = 1 << 60;

const ROWS_FOLLOW: u64 = 4;
const DESCRIPTORS_FOLLOW: u64 = 8;
const SPECIALS_FOLLOW: u64 = 16;
const BOUND_FOLLOWS: u8 = 0x20;
const OTHERS_FOLLOW: u8 = 0x40;
const DESCRIPTOR_BITS: u8 = 15 | BOUND_FOLLOWS | OTHERS_FOLLOW;
/// Flag of a block: columns with starts have bytes of their own, and there is no shared code.
const APART: u64 = 32;
/// Largest number of columns of a shared code. To read one column, all columns before it must be decoded, so wide tables have none.
const SHARED_COLUMNS: usize = 16;

/// The descriptor that applies to a column if none is stored.
fn plain(header: &Header, apart: bool, column: usize) -> u8 {
    match header.start(column, None) {
        Some(_) if !apart => CodecId::Shared as u8,
        _ => CodecId::Adaptive as u8,
    }
}

/// The cells of another column in the rows in which a column has values; NaN for gaps.
pub(crate) fn aligned(cells: &[Option<f64>], has_value: &[bool]) -> Vec<f64> {
    if has_value.iter().all(|has| *has) {
        return cells.iter().map(|cell| cell.unwrap_or(f64::NAN)).collect();
    }
    let mut values = Vec::with_capacity(cells.len());
    let kept = cells.iter().zip(has_value).filter(|(_, kept)| **kept);
    values.extend(kept.map(|(cell, _)| cell.unwrap_or(f64::NAN)));
    values
}

/// Largest length of a block in bytes: twice that of raw samples. Anything longer is not a block.
pub(crate) fn max_bytes(header: &Header) -> usize {
    let cells = (header.schema.columns.len() + 1) * header.schema.rows_per_block;
    64 + 32 * header.schema.columns.len() + 24 * cells
}

/// The length in bytes of the block that begins here. `sum` gives the checksum of the first bytes.
///
/// # Errors
/// [`Damage::CutOff`] if the slice ends before the block does; others if no block begins here.
pub(crate) fn length(header: &Header, bytes: &[u8], sum: impl FnOnce(&[u8]) -> u32) -> Result<usize, Damage> {
    Ok(read_checked(bytes, 0, 1..=max_bytes(header), sum)?.1)
}
