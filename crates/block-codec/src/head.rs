//! The head of a block, before the indices.

use crate::bytes::push_varint;
use crate::grid::Grid;

/// Code of the line in the head; smaller codes are numbers of decimals.
pub(crate) const LINE: u8 = 13;
pub(crate) const CIRCLE: u8 = 14;
pub(crate) const SAMPLES: u8 = 15;

/// Flags of the second byte: decimals are rounded to single precision; pco is in its wrapped form; tables that learn follow the counts, or the list
/// of levels; stored tables are in place of the counts, or follow the list of levels.
pub(crate) const SINGLE: u8 = 16;
pub(crate) const WRAPPED: u8 = 32;
pub(crate) const TABLED: u8 = 64;
pub(crate) const STORED: u8 = 128;

/// How the indices are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coding {
    Models,
    Pco,
    Raw,
    Counts,
    /// Counts, then tables of symbols that learn. Not written.
    Tables,
    /// A list of levels, and their numbers.
    Levels,
    /// A list of levels, and tables that learn for their numbers. Not written.
    TabledLevels,
    /// Tables of symbols that the block stores.
    Stored,
    /// A list of levels, and stored tables for their numbers.
    StoredLevels,
    /// pco in its wrapped form.
    Wrapped,
}

/// Of each coding of indices its bits in the first byte, and its flag in the second one.
pub(crate) const CODINGS: [(Coding, u8, u8); 9] = [
    (Coding::Models, 0, 0),
    (Coding::Pco, 1, 0),
    (Coding::Wrapped, 1, WRAPPED),
    (Coding::Levels, 2, 0),
    (Coding::TabledLevels, 2, TABLED),
    (Coding::StoredLevels, 2, STORED),
    (Coding::Counts, 3, 0),
    (Coding::Tables, 3, TABLED),
    (Coding::Stored, 3, STORED),
];

/// The same of samples.
pub(crate) const CODINGS_OF_SAMPLES: [(Coding, u8, u8); 6] = [
    (Coding::Levels, 0, 0),
    (Coding::TabledLevels, 0, TABLED),
    (Coding::StoredLevels, 0, STORED),
    (Coding::Pco, 1, 0),
    (Coding::Raw, 2, 0),
    (Coding::Wrapped, 3, 0),
];

/// The head as it was read.
pub(crate) struct Head {
    pub(crate) grid: Option<Grid>,
    pub(crate) coding: Coding,
    pub(crate) joint: bool,
    pub(crate) exceptions: Vec<(usize, f64)>,
}

pub(crate) fn write_head(grid: &Grid, coding: Coding, joint: bool, exceptions: &[(usize, f64)], bytes: &mut Vec<u8>) {
    let (kind, own) = match grid {
        Grid::Decimal { decimals, .. } => (*decimals, 0),
        Grid::Stepped {
            decimals, is_single, ..
        } => (*decimals, 2 | if *is_single { SINGLE } else { 0 }),
        Grid::Line { anchor, .. } => (LINE, if *anchor == 0.0 { 0 } else { 4 }),
        Grid::Circle { .. } => (CIRCLE, 0),
    };
    let written = CODINGS.iter().find(|(own, ..)| *own == coding);
    let (coding, form) = written.map_or((0, 0), |(_, bits, form)| (*bits, *form));
    let moved = if grid.phase() == 0 { 0 } else { 8 };
    let second = own | moved | form | u8::from(!exceptions.is_empty());
    bytes.push(kind | coding << 4 | u8::from(joint) << 6 | u8::from(second != 0) << 7);
    if second != 0 {
        bytes.push(second);
    }
    grid.write(bytes);
    if !exceptions.is_empty() {
        push_varint(bytes, exceptions.len() as u64);
        let mut next = 0;
        for (row, sample) in exceptions {
            push_varint(bytes, (row - next) as u64);
            bytes.extend_from_slice(&sample.to_le_bytes());
            next = row + 1;
        }
    }
}
