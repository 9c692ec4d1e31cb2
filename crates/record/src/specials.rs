//! Special cells, which the codec does not restore: gaps, NaN, infinities, and samples stored in full.
//!
//! One arithmetic code has the special cells of all columns of a block, row by row. First it says whether a cell is special, given the cell
//! above and how many cells before it in its row are special; so a row without any sample costs little more than one cell. Then it says
//! which special cell it is, unless it equals the one above: the same as the last one of the block, or three bits and for some kinds 64
//! more.

use crate::error::{Damage, ensure};
use fewbits_block_codec::arithmetic::{Coder, Reader, Writer};

/// Kind of a special cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Special {
    /// No sample.
    Gap,
    /// NaN with these bits.
    Nan(u64),
    Infinity,
    NegativeInfinity,
    /// A sample stored in full. The codec has a value for this cell too, which is not used.
    Whole(u64),
}

/// The special cells of one column. An empty list means none.
pub(crate) type Specials = Vec<Option<Special>>;

/// The bits of the usual NaN; they are not stored.
const USUAL_NAN: u64 = 0x7ff8_0000_0000_0000;
const KIND_BITS: u32 = 3;
/// An even probability.
const EVEN: u32 = 1 << 15;

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

    /// The cell that is restored.
    pub(crate) fn cell(self) -> Option<f64> {
        match self {
            Self::Gap => None,
            Self::Nan(bits) | Self::Whole(bits) => Some(f64::from_bits(bits)),
            Self::Infinity => Some(f64::INFINITY),
            Self::NegativeInfinity => Some(f64::NEG_INFINITY),
        }
    }

    /// Whether the codec has a value for this cell too.
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

    /// Codes a kind and, if it has any, its bits.
    fn code<C: Coder>(coder: &mut C, wanted: Option<Self>) -> Result<Self, Damage> {
        let kind = coder.raw(wanted.map_or(0, Self::kind), KIND_BITS);
        let bits = match wanted {
            Some(Self::Nan(bits) | Self::Whole(bits)) => bits,
            _ => 0,
        };
        Ok(match kind {
            0 => Self::Gap,
            1 => Self::Nan(USUAL_NAN),
            2 => Self::Infinity,
            3 => Self::NegativeInfinity,
            4 => match coder.raw(bits, 64) {
                bits if f64::from_bits(bits).is_nan() => Self::Nan(bits),
                _ => return Err(Damage::Content("bits of a NaN")),
            },
            5 => Self::Whole(coder.raw(bits, 64)),
            _ => return Err(Damage::Content("kind of a special cell")),
        })
    }
}

/// Number of decisions for yes and for no, in halves.
#[derive(Debug, Clone, Copy)]
struct Count {
    yes: u32,
    no: u32,
}

impl Count {
    fn decide<C: Coder>(&mut self, coder: &mut C, wanted: bool) -> bool {
        // Counts stay below 2^28, those of 2^24 cells of a block.
        let one = (u64::from(self.yes) << 16) / u64::from(self.yes + self.no);
        let bit = coder.bit((one as u32).clamp(1, 65_535), wanted);
        // A decision counts 2, so that a count of 1 before the first one is a half.
        *(if bit { &mut self.yes } else { &mut self.no }) += 2;
        bit
    }
}

/// Number of states of the cells before this one in its row, among columns with special cells: none is special, some are, all are.
const LEFT: usize = 3;

/// Codes the special cells of all columns: `wanted` at the writer, `None` at the reader.
pub(crate) fn code<C: Coder>(
    coder: &mut C,
    wanted: Option<&[Specials]>,
    columns: usize,
    rows: usize,
) -> Result<Vec<Specials>, Damage> {
    let mut all: Vec<Specials> = vec![Vec::new(); columns];
    let mut present = Vec::new();
    for column in 0..columns {
        let has = wanted.is_some_and(|wanted| wanted[column].iter().any(Option::is_some));
        if coder.bit(EVEN, has) {
            present.push(column);
            all[column].reserve(rows);
        }
    }
    let mut begins = [Count { yes: 1, no: 64 }; LEFT];
    let mut goes_on = [[Count { yes: 1, no: 3 }; LEFT], [Count { yes: 8, no: 1 }; LEFT]];
    let mut all_above = false;
    let (mut same, mut like_last) = (Count { yes: 8, no: 1 }, Count { yes: 8, no: 1 });
    let mut last = Special::Gap;
    for row in 0..rows {
        let mut found = 0;
        for (before, column) in present.iter().enumerate() {
            let above = row.checked_sub(1).and_then(|above| all[*column][above]);
            let left = usize::from(found > 0) + usize::from(found > 0 && found == before);
            let special = wanted.and_then(|wanted| wanted[*column][row]);
            let counts = match above {
                Some(_) => &mut goes_on[usize::from(all_above)],
                None => &mut begins,
            };
            if !counts[left].decide(coder, special.is_some()) {
                all[*column].push(None);
                continue;
            }
            found += 1;
            let special = match above {
                Some(above) if same.decide(coder, special == Some(above)) => above,
                _ if like_last.decide(coder, special == Some(last)) => last,
                _ => Special::code(coder, special)?,
            };
            last = special;
            all[*column].push(Some(special));
            // Damaged bytes may be too few: stop here instead of inventing the remaining rows.
            ensure!(!coder.overran(), Damage::Content("special cells"));
        }
        // A row in which all of several columns are special is probably part of an outage, which goes on in the next row.
        all_above = found > 1 && found == present.len();
    }
    Ok(all)
}

/// The coded special cells of all columns. A column without any has `None` for every row.
pub(crate) fn encode(specials: &[Specials], rows: usize) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new());
    // Only a reader can fail here.
    let _ = code(&mut writer, Some(specials), specials.len(), rows);
    writer.finish()
}

/// Reads what [`encode`] wrote; columns without special cells are empty.
pub(crate) fn decode(bytes: &[u8], columns: usize, rows: usize) -> Result<Vec<Specials>, Damage> {
    let mut reader = Reader::new(bytes);
    let specials = code(&mut reader, None, columns, rows)?;
    reader.finish().map_err(|_| Damage::Content("special cells"))?;
    Ok(specials)
}

/// The special cells of a column before coding.
pub(crate) fn of(cells: &[Option<f64>]) -> Specials {
    if cells.iter().all(|cell| cell.is_some_and(f64::is_finite)) {
        return Specials::new();
    }
    cells.iter().map(|cell| Special::of(*cell)).collect()
}

/// For which rows the codec has a value.
pub(crate) fn has_value(specials: &[Option<Special>], rows: usize) -> Vec<bool> {
    let own = specials.iter().map(|special| special.is_none_or(Special::has_value));
    let mut has_value: Vec<bool> = own.collect();
    has_value.resize(rows, true);
    has_value
}

/// The cells of a column: values with the special cells inserted.
pub(crate) fn merged(specials: &[Option<Special>], values: &[f64]) -> Vec<Option<f64>> {
    if specials.is_empty() {
        return values.iter().copied().map(Some).collect();
    }
    let mut values = values.iter().copied();
    let cell = |special: &Option<Special>| match special {
        Some(special) => {
            if special.has_value() {
                values.next();
            }
            special.cell()
        }
        None => values.next(),
    };
    specials.iter().map(cell).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn special_cells_return_and_rows_without_samples_cost_little() {
        let rows = 500;
        let cell = |column: usize, row: usize| match (row, column) {
            (100..160, _) => Some(Special::Gap),
            (200..210, 1) => Some(Special::Nan(USUAL_NAN)),
            (300, 2) => Some(Special::Nan(USUAL_NAN | 7)),
            (301..303, 2) => Some(Special::Infinity),
            (303, 2) => Some(Special::NegativeInfinity),
            (499, 3) => Some(Special::Whole(1.5_f64.to_bits())),
            _ => None,
        };
        let columns = |used: &[usize]| -> Vec<Specials> {
            used.iter()
                .map(|column| (0..rows).map(|row| cell(*column, row)).collect())
                .collect()
        };
        for used in [&[0, 1, 2, 3][..], &[0], &[4, 4]] {
            let specials = columns(used);
            let bytes = encode(&specials, rows);
            assert_eq!(decode(&bytes, used.len(), rows).unwrap(), specials);
            assert!(decode(&[bytes.as_slice(), &[0]].concat(), used.len(), rows).is_err());
        }
        let plain = vec![vec![None; rows]; 2];
        assert_eq!(decode(&encode(&plain, rows), 2, rows).unwrap(), vec![Specials::new(); 2]);
        let (one, five) = (encode(&columns(&[4]), rows), encode(&columns(&[4; 5]), rows));
        assert!(five.len() < one.len() + 10, "{} {}", five.len(), one.len());
    }
}
