//! The head of a block, before the indices.

use super::grid::{Grid, push_varint};

/// Code of the line in the head; smaller codes are numbers of decimals.
pub(super) const LINE: u8 = 13;
pub(super) const CIRCLE: u8 = 14;
pub(super) const SAMPLES: u8 = 15;

/// How the indices are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    Models,
    Pco,
    Raw,
    Counts,
}

/// The head as it was read.
pub(super) struct Head {
    pub(super) grid: Option<Grid>,
    pub(super) coding: Coding,
    pub(super) joint: bool,
    pub(super) exceptions: Vec<(usize, f64)>,
}

pub(super) fn write_head(grid: &Grid, coding: Coding, joint: bool, exceptions: &[(usize, f64)], bytes: &mut Vec<u8>) {
    let (kind, own) = match grid {
        Grid::Decimal { decimals, .. } => (*decimals, 0),
        Grid::Stepped { decimals, .. } => (*decimals, 2),
        Grid::Line { anchor, .. } => (LINE, if *anchor == 0.0 { 0 } else { 4 }),
        Grid::Circle { .. } => (CIRCLE, 0),
    };
    let coding = match coding {
        Coding::Models => 0,
        Coding::Pco => 1,
        Coding::Raw => 2,
        Coding::Counts => 3,
    };
    let moved = if grid.phase() == 0 { 0 } else { 8 };
    let second = own | moved | u8::from(!exceptions.is_empty());
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
