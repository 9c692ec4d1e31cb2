//! Cells that the codec of values does not hold: gaps, NaN, infinities, and samples stored whole.
//!
//! They are runs: how many cells lie between the end of the last run and this one, the kind, the length. Distances are Rice codes
//! (quotient by `2^k` in unary, `k` bits of remainder) with one `k` for the column, lengths are Elias gamma codes, a kind that is
//! the last one again is one bit. A lone gap in a hundred cells so costs 10 bits, where its distance alone is worth 8.

use crate::error::Damage;
use crate::wire::{Bytes, push_varint};
use fewbits_core::{BitReader, BitString, BitWriter, CodecError};

/// What a cell is, if it is not the codec's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Special {
    /// No sample.
    Gap,
    /// Not a number, with these bits.
    Nan(u64),
    Infinity,
    NegativeInfinity,
    /// A sample stored whole; the codec has a value for this cell, which is not used.
    Whole(u64),
}

/// The bits of the usual NaN, which are not stored.
const USUAL_NAN: u64 = 0x7ff8_0000_0000_0000;
const KIND_BITS: u32 = 3;
const MAX_RICE: u32 = 24;

impl Special {
    /// The special kind of a cell before coding; `None` for finite samples.
    pub(crate) fn of(cell: Option<f64>) -> Option<Self> {
        match cell {
            None => Some(Self::Gap),
            Some(value) if value.is_nan() => Some(Self::Nan(value.to_bits())),
            Some(f64::INFINITY) => Some(Self::Infinity),
            Some(f64::NEG_INFINITY) => Some(Self::NegativeInfinity),
            Some(_) => None,
        }
    }

    /// The cell that it stands for.
    pub(crate) fn cell(self) -> Option<f64> {
        match self {
            Self::Gap => None,
            Self::Nan(bits) | Self::Whole(bits) => Some(f64::from_bits(bits)),
            Self::Infinity => Some(f64::INFINITY),
            Self::NegativeInfinity => Some(f64::NEG_INFINITY),
        }
    }

    /// Whether the codec holds a value for this cell too.
    pub(crate) fn has_value(self) -> bool {
        matches!(self, Self::Whole(_))
    }

    fn kind(self) -> u64 {
        match self {
            Self::Gap => 0,
            Self::Nan(USUAL_NAN) => 1,
            Self::Infinity => 2,
            Self::NegativeInfinity => 3,
            Self::Nan(_) => 4,
            Self::Whole(_) => 5,
        }
    }

    fn bits(self) -> Option<u64> {
        match self {
            Self::Nan(bits) if bits != USUAL_NAN => Some(bits),
            Self::Whole(bits) => Some(bits),
            _ => None,
        }
    }
}

/// Cells alike, one behind the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) start: usize,
    pub(crate) length: usize,
    pub(crate) special: Special,
}

/// The runs of a column.
pub(crate) fn runs(specials: &[Option<Special>]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (start, special) in specials.iter().enumerate() {
        let Some(special) = *special else { continue };
        match runs.last_mut() {
            Some(run) if run.start + run.length == start && run.special == special => run.length += 1,
            _ => runs.push(Run {
                start,
                length: 1,
                special,
            }),
        }
    }
    runs
}

/// Appends the runs, at least one.
pub(crate) fn push(runs: &[Run], bytes: &mut Vec<u8>) -> Result<(), CodecError> {
    push_varint(bytes, runs.len() as u64);
    let ends = runs.iter().map(|run| run.start + run.length);
    let distances: Vec<u64> = runs
        .iter()
        .zip(std::iter::once(0).chain(ends))
        .map(|(run, end)| (run.start - end) as u64)
        .collect();
    let cost = |k: u32| distances.iter().map(|d| (d >> k) + 1 + u64::from(k)).sum::<u64>();
    let rice = (0..=MAX_RICE).min_by_key(|k| cost(*k)).unwrap_or(0);
    let mut writer = BitWriter::new();
    writer.write(u64::from(rice), 5)?;
    let mut last = 0;
    for (run, distance) in runs.iter().zip(&distances) {
        for _ in 0..distance >> rice {
            writer.write_bit(true);
        }
        writer.write_bit(false);
        writer.write(distance & ((1 << rice) - 1), rice)?;
        let kind = run.special.kind();
        writer.write_bit(kind != last);
        if kind != last {
            writer.write(kind, KIND_BITS)?;
        }
        last = kind;
        let length = run.length as u64;
        let width = length.ilog2();
        writer.write(0, width)?;
        writer.write(length, width + 1)?;
        if let Some(bits) = run.special.bits() {
            writer.write(bits, 64)?;
        }
    }
    bytes.extend_from_slice(writer.finish().bytes());
    Ok(())
}

/// Reads the runs of a column of `rows` cells, at least one.
pub(crate) fn read(bytes: &mut Bytes<'_>, rows: usize) -> Result<Vec<Run>, Damage> {
    let count = bytes.count(rows, "number of runs")?;
    let all = BitString::from_bytes(bytes.0.to_vec(), 8 * bytes.0.len()).map_err(|_| Damage::CutOff)?;
    let mut reader = BitReader::new(&all);
    let runs = read_bits(&mut reader, count, rows)?;
    let used = all.bits() - reader.remaining();
    bytes.take(used.div_ceil(8))?;
    Ok(runs)
}

fn read_bits(reader: &mut BitReader<'_>, count: usize, rows: usize) -> Result<Vec<Run>, Damage> {
    let end = |_| Damage::CutOff;
    let rice = reader.read(5).map_err(end)? as u32;
    if rice > MAX_RICE {
        return Err(Damage::Content("code of runs"));
    }
    let (mut runs, mut position, mut last) = (Vec::new(), 0_u64, 0);
    for _ in 0..count {
        let mut quotient = 0;
        while reader.read_bit().map_err(end)? {
            quotient += 1;
            if quotient > rows as u64 >> rice {
                return Err(Damage::Content("distance of runs"));
            }
        }
        let distance = (quotient << rice) | reader.read(rice).map_err(end)?;
        if reader.read_bit().map_err(end)? {
            last = reader.read(KIND_BITS).map_err(end)?;
        }
        let mut width = 0;
        while !reader.read_bit().map_err(end)? {
            width += 1;
            if width > 32 {
                return Err(Damage::Content("length of a run"));
            }
        }
        let length = (1_u64 << width) | reader.read(width).map_err(end)?;
        let special = match last {
            0 => Special::Gap,
            1 => Special::Nan(USUAL_NAN),
            2 => Special::Infinity,
            3 => Special::NegativeInfinity,
            4 => Special::Nan(reader.read(64).map_err(end)?),
            5 => Special::Whole(reader.read(64).map_err(end)?),
            _ => return Err(Damage::Content("kind of a run")),
        };
        if matches!(special, Special::Nan(bits) if !f64::from_bits(bits).is_nan()) {
            return Err(Damage::Content("bits of a NaN"));
        }
        let start = position + distance;
        position = start + length;
        if position > rows as u64 {
            return Err(Damage::Content("length of a run"));
        }
        runs.push(Run {
            start: start as usize,
            length: length as usize,
            special,
        });
    }
    Ok(runs)
}
