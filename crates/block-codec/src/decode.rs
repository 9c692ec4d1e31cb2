//! Decoding of blocks.

use crate::bytes::{Bytes, unzigzag};
use crate::error::Damaged;
use crate::grid::{DECIMALS, Grid, PHASES};
use crate::head::{CIRCLE, CODINGS, CODINGS_OF_SAMPLES, Coding, Head, LINE, SAMPLES, SINGLE, STORED, TABLED, WRAPPED};
use crate::indices::{from_pco_bytes, from_wrapped_pco, raw_samples, read_block};
use crate::rows::Others;
use crate::sections::SECTIONS;
use crate::{BlockCodec, Error, check_rows, learned, levels, stored};

impl BlockCodec {
    /// The samples of a block of `rows` rows.
    ///
    /// # Errors
    /// If it is detectable that no writer of this accuracy and number of rows wrote the bytes.
    pub fn decode(&self, bytes: &[u8], rows: usize) -> Result<Vec<f64>, Error> {
        self.decode_with(bytes, rows, &[])
    }

    /// As [`decode`](Self::decode), for a block of [`encode_with`](Self::encode_with) with the same other columns.
    ///
    /// # Errors
    /// As [`decode`](Self::decode), or if a column has another number of rows.
    pub fn decode_with(&self, bytes: &[u8], rows: usize, others: &[&[f64]]) -> Result<Vec<f64>, Error> {
        check_rows(rows, others)?;
        if rows == 0 {
            return match bytes.len() {
                0 => Ok(Vec::new()),
                left => Err(Damaged::new("block", format!("{left} bytes"), "none for no rows").into()),
            };
        }
        match bytes.strip_prefix(&SECTIONS) {
            Some(sections) => self.decode_sections(sections, rows),
            None => self.decode_section(bytes, rows, others),
        }
    }

    /// The samples of a block without sections, of at least one row.
    pub(crate) fn decode_section(&self, bytes: &[u8], rows: usize, others: &[&[f64]]) -> Result<Vec<f64>, Error> {
        let mut bytes = Bytes(bytes);
        let head = self.read_head(&mut bytes, rows)?;
        let rest = bytes.0;
        let others = joint_columns(&head, others)?;
        let keys = match head.coding {
            Coding::Levels => Some(levels::read(rest, rows, others.as_ref())?),
            Coding::TabledLevels => Some(levels::read_tabled(rest, rows, learned::read)?),
            Coding::StoredLevels => Some(levels::read_tabled(rest, rows, stored::read)?),
            _ => None,
        };
        let Some(grid) = head.grid else {
            return Ok(match (keys, head.coding) {
                (Some(keys), _) => keys.into_iter().map(levels::sample_of_key).collect(),
                (_, Coding::Raw) => raw_samples(rest, rows)?,
                (_, Coding::Wrapped) => from_wrapped_pco::<f64>(rest, rows)?,
                _ => from_pco_bytes::<f64>(rest, rows)?,
            });
        };
        let indices = match head.coding {
            Coding::Models => read_block(rest, true, &grid, rows, others.as_ref())?,
            Coding::Wrapped => from_wrapped_pco::<i64>(rest, rows)?,
            Coding::Counts => read_block(rest, false, &grid, rows, None)?,
            Coding::Tables => learned::read(rest, rows)?,
            Coding::Stored => stored::read(rest, rows)?,
            _ => match keys {
                Some(keys) => keys.into_iter().map(levels::index_of_key).collect(),
                None => from_pco_bytes::<i64>(rest, rows)?,
            },
        };
        let mut samples = grid.values(&indices);
        for (row, sample) in head.exceptions {
            samples[row] = sample;
        }
        Ok(samples)
    }

    /// The grid of samples with `decimals` decimals; its steps are read if `stepped`.
    pub(crate) fn decimal_grid(
        &self,
        decimals: u8,
        stepped: bool,
        is_single: bool,
        bytes: &mut Bytes<'_>,
    ) -> Result<Grid, Damaged> {
        if stepped {
            return Ok(Grid::Stepped {
                decimals,
                unit: match i64::try_from(bytes.varint()?) {
                    Ok(unit @ 1..) => unit,
                    _ => return Err(Damaged::new("unit", "too large", "1 to 2^63")),
                },
                origin: unzigzag(bytes.varint()?),
                is_single,
            });
        }
        let width = Grid::width(self.delta, fewbits_node::adaptive::TENS[usize::from(decimals)]);
        let width = width.ok_or_else(|| Damaged::new("decimals", decimals, "a grid not finer than the samples"))?;
        Ok(Grid::Decimal {
            decimals,
            width,
            phase: 0,
        })
    }

    pub(crate) fn circle(&self) -> Result<Grid, Damaged> {
        let circle = self.period.map(|period| Grid::circle(self.delta, period));
        circle.ok_or_else(|| Damaged::new("grid", "circle", "the grid of a line"))
    }

    fn read_head(&self, bytes: &mut Bytes<'_>, rows: usize) -> Result<Head, Damaged> {
        let [head] = bytes.array()?;
        let kind = head & 15;
        let [second] = if head & 128 == 0 { [0] } else { bytes.array()? };
        let (is_single, is_joint, form) = (second & SINGLE != 0, head & 64 != 0, second & (WRAPPED | TABLED | STORED));
        let codings: &[(Coding, u8, u8)] = if kind == SAMPLES { &CODINGS_OF_SAMPLES } else { &CODINGS };
        let found = codings
            .iter()
            .find(|(_, bits, own)| (head >> 4 & 3, form) == (*bits, *own));
        let Some((coding, ..)) = found.copied() else {
            return Err(Damaged::new("head", format!("{head}, {second}"), "a grid and a coding that belong together"));
        };
        if (head & 128 != 0 && second == 0)
            || (kind == SAMPLES && (second != form || (is_joint && coding != Coding::Levels)))
            || (is_single && (second & 2 == 0 || kind >= DECIMALS))
            || (is_joint && form & (TABLED | STORED) != 0)
        {
            return Err(Damaged::new(
                "second byte",
                second,
                "exceptions, steps, an anchor or a phase, and a grid or coding that has them",
            ));
        }
        let grid = match kind {
            SAMPLES => None,
            0..DECIMALS => Some(self.decimal_grid(kind, second & 2 != 0, is_single, bytes)?),
            LINE if !self.is_lossless() => {
                let anchor = if second & 4 == 0 {
                    0.0
                } else {
                    f64::from_le_bytes(bytes.array()?)
                };
                if !anchor.is_finite() {
                    return Err(Damaged::new("anchor", anchor, "a finite number"));
                }
                Some(Grid::line(self.delta, anchor))
            }
            CIRCLE => Some(self.circle()?),
            _ => return Err(Damaged::new("grid", kind, "one of the agreed accuracy")),
        };
        let grid = match grid {
            Some(grid) if second & 8 != 0 => Some(read_phase(grid, bytes)?),
            grid => grid,
        };
        let mut exceptions = Vec::new();
        if second & 1 == 1 {
            let count = bytes.varint()?;
            let mut row = 0_u64;
            for i in 0..count {
                row = row.saturating_add(bytes.varint()?).saturating_add(u64::from(i > 0));
                if row >= rows as u64 {
                    return Err(Damaged::new("exception", row, "a row of the block"));
                }
                exceptions.push((row as usize, f64::from_le_bytes(bytes.array()?)));
            }
        }
        Ok(Head {
            grid,
            coding,
            joint: is_joint,
            exceptions,
        })
    }
}

/// The other columns of a joint block.
fn joint_columns<'a>(head: &Head, others: &[&'a [f64]]) -> Result<Option<Others<'a>>, Damaged> {
    if head.joint && others.is_empty() {
        return Err(Damaged::new("block", "joint", "the other columns that it was written with"));
    }
    Ok(head.joint.then(|| Others::new(others)))
}

/// The grid moved by the phase in the next byte.
pub(crate) fn read_phase(grid: Grid, bytes: &mut Bytes<'_>) -> Result<Grid, Damaged> {
    let [phase] = bytes.array()?;
    match grid {
        Grid::Decimal { .. } | Grid::Line { .. } if (1..PHASES).contains(&phase) => Ok(grid.with_phase(phase)),
        _ => Err(Damaged::new("phase", phase, "1 to 15, of a grid of cells on a line")),
    }
}
