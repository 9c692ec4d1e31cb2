//! The head of a block, before the indices.

use crate::BlockCodec;
use crate::bytes::{Bytes, Fields};
use crate::error::{Damaged, ensure};
use crate::grid::{DECIMALS, Grid, PHASES};
use std::borrow::Cow;

/// Code of the line in the head; smaller codes are numbers of decimals.
pub(crate) const LINE: u8 = 13;
pub(crate) const CIRCLE: u8 = 14;
pub(crate) const SAMPLES: u8 = 15;

/// Flags of the second byte: exceptions; steps; an anchor; a phase; decimals are rounded to single precision; pco is in its wrapped form; tables
/// that learn follow the counts, or the list of levels; stored tables are in place of the counts, or follow the list of levels.
const EXCEPTIONS: u8 = 1;
pub(crate) const STEPS: u8 = 2;
const ANCHOR: u8 = 4;
pub(crate) const PHASE: u8 = 8;
pub(crate) const SINGLE: u8 = 16;
const WRAPPED: u8 = 32;
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

/// Of each coding its bits in the first byte, of indices and of samples, and its flag in the second one. `NONE`: there is none.
const CODINGS: &[(Coding, [u8; 2], u8)] = &[
    (Coding::Models, [0, NONE], 0),
    (Coding::Pco, [1, 1], 0),
    (Coding::Wrapped, [1, NONE], WRAPPED),
    (Coding::Wrapped, [NONE, 3], 0),
    (Coding::Levels, [2, 0], 0),
    (Coding::TabledLevels, [2, 0], TABLED),
    (Coding::StoredLevels, [2, 0], STORED),
    (Coding::Counts, [3, NONE], 0),
    (Coding::Tables, [3, NONE], TABLED),
    (Coding::Stored, [3, NONE], STORED),
    (Coding::Raw, [NONE, 2], 0),
];
const NONE: u8 = 255;

/// The head of a block.
pub(crate) struct Head<'a> {
    pub(crate) grid: Option<Grid>,
    pub(crate) coding: Coding,
    pub(crate) joint: bool,
    pub(crate) exceptions: Cow<'a, [(usize, f64)]>,
}

impl Grid {
    /// Its number of decimals, or its code in the head, and its flags of the second byte.
    pub(crate) fn form(&self) -> (u8, u8) {
        let (kind, flags) = match self {
            Self::Decimal { decimals, .. } => (*decimals, 0),
            Self::Stepped {
                decimals, is_single, ..
            } => (*decimals, STEPS | if *is_single { SINGLE } else { 0 }),
            Self::Line { anchor, .. } => (LINE, if *anchor == 0.0 { 0 } else { ANCHOR }),
            Self::Circle { .. } => (CIRCLE, 0),
        };
        (kind, flags | if self.phase() == 0 { 0 } else { PHASE })
    }
}

impl BlockCodec {
    /// What is stored of a grid of this form; a reader has none.
    pub(crate) fn code_grid<F: Fields>(
        &self,
        fields: &mut F,
        own: Option<&Grid>,
        (kind, flags): (u8, u8),
    ) -> Result<Grid, Damaged> {
        let form = flags & (STEPS | SINGLE);
        ensure!(form == 0 || (kind < DECIMALS && form != SINGLE), Damaged::new("grid", kind, "decimals with steps"));
        let grid = match (kind, self.period) {
            (0..DECIMALS, _) if form != 0 => {
                let (unit, origin) = match own {
                    Some(Grid::Stepped { unit, origin, .. }) => (*unit, *origin),
                    _ => (0, 0),
                };
                let unit = i64::try_from(fields.varint(unit as u64)?).ok().filter(|unit| *unit > 0);
                Grid::Stepped {
                    decimals: kind,
                    unit: unit.ok_or_else(|| Damaged::new("unit", "too large", "1 to 2^63"))?,
                    origin: fields.signed(origin)?,
                    is_single: flags & SINGLE != 0,
                }
            }
            (0..DECIMALS, _) => {
                let width = Grid::width(self.delta, fewbits_node::adaptive::TENS[usize::from(kind)]);
                Grid::Decimal {
                    decimals: kind,
                    width: width.ok_or_else(|| Damaged::new("decimals", kind, "a grid not finer than the samples"))?,
                    phase: 0,
                }
            }
            (LINE, _) if !self.is_lossless() => {
                let mut anchor = match own {
                    Some(Grid::Line { anchor, .. }) => *anchor,
                    _ => 0.0,
                };
                if flags & ANCHOR != 0 {
                    anchor = fields.f64(anchor)?;
                }
                ensure!(anchor.is_finite(), Damaged::new("anchor", anchor, "a finite number"));
                Grid::line(self.delta, anchor)
            }
            (CIRCLE, Some(period)) => Grid::circle(self.delta, period),
            _ => return Err(Damaged::new("grid", kind, "one of the agreed accuracy")),
        };
        if flags & PHASE == 0 {
            return Ok(grid);
        }
        let phase = fields.byte(own.map_or(0, Grid::phase))?;
        match grid {
            Grid::Decimal { .. } | Grid::Line { .. } if (1..PHASES).contains(&phase) => Ok(grid.with_phase(phase)),
            _ => Err(Damaged::new("phase", phase, "1 to 15, of a grid of cells on a line")),
        }
    }

    /// The head of a block of so many rows; a reader may be given any other one.
    fn code_head<F: Fields>(&self, fields: &mut F, own: &Head<'_>, rows: usize) -> Result<Head<'static>, Damaged> {
        let (kind, flags) = own.grid.as_ref().map_or((SAMPLES, 0), Grid::form);
        // The bits in the first byte, and the flag in the second one, of codings of this kind.
        let codings = |kind| {
            let of_kind =
                move |(coding, bits, form): &(_, [u8; 2], _)| (*coding, bits[usize::from(kind == SAMPLES)], *form);
            CODINGS.iter().map(of_kind).filter(|(_, bits, _)| *bits != NONE)
        };
        let written = codings(kind).find(|(coding, ..)| *coding == own.coding);
        let (_, bits, form) = written.unwrap_or((own.coding, 0, 0));
        let second = flags | form | u8::from(!own.exceptions.is_empty());
        let head = fields.byte(kind | bits << 4 | u8::from(own.joint) << 6 | u8::from(second != 0) << 7)?;
        let second = if head & 128 == 0 { 0 } else { fields.byte(second)? };
        let (kind, joint, form) = (head & 15, head & 64 != 0, second & (WRAPPED | TABLED | STORED));
        let found = codings(kind).find(|(_, bits, own)| (head >> 4 & 3, form) == (*bits, *own));
        let expected = "a grid and a coding that belong together";
        let (coding, ..) = found.ok_or_else(|| Damaged::new("head", format!("{head}, {second}"), expected))?;
        let is_usual = (head & 128 == 0 || second != 0)
            && (kind != SAMPLES || (second == form && (!joint || coding == Coding::Levels)))
            && (!joint || form & (TABLED | STORED) == 0);
        let expected = "exceptions, steps, an anchor or a phase, and a grid or coding that has them";
        ensure!(is_usual, Damaged::new("second byte", second, expected));
        let grid = match kind {
            SAMPLES => None,
            kind => Some(self.code_grid(fields, own.grid.as_ref(), (kind, second))?),
        };
        let mut exceptions = Vec::new();
        if second & EXCEPTIONS != 0 {
            let (count, mut next) = (fields.varint(own.exceptions.len() as u64)?, 0);
            for i in 0..count as usize {
                let (row, sample) = own.exceptions.get(i).copied().unwrap_or((next, 0.0));
                let row = fields.count(row - next, usize::MAX, "exception")?.saturating_add(next);
                ensure!(row < rows, Damaged::new("exception", row, "a row of the block"));
                exceptions.push((row, fields.f64(sample)?));
                next = row + 1;
            }
        }
        Ok(Head {
            grid,
            coding,
            joint,
            exceptions: exceptions.into(),
        })
    }

    /// The first bytes of a block of this coding, on a grid if the samples have one.
    pub(crate) fn head(
        &self,
        grid: Option<&Grid>,
        coding: Coding,
        joint: bool,
        exceptions: &[(usize, f64)],
    ) -> Vec<u8> {
        let head = Head {
            grid: grid.copied(),
            coding,
            joint,
            exceptions: exceptions.into(),
        };
        let mut bytes = Vec::new();
        // Only a reader can fail here.
        let _ = self.code_head(&mut bytes, &head, usize::MAX);
        bytes
    }

    pub(crate) fn read_head(&self, bytes: &mut Bytes<'_>, rows: usize) -> Result<Head<'static>, Damaged> {
        let any = Head {
            grid: None,
            coding: Coding::Raw,
            joint: false,
            exceptions: Cow::default(),
        };
        self.code_head(bytes, &any, rows)
    }
}
