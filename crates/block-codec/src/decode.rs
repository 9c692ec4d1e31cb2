//! Decoding of blocks.

use crate::arithmetic::Reader;
use crate::bytes::Bytes;
use crate::error::{Damaged, ensure};
use crate::head::Coding;
use crate::indices::{code_block, from_pco_bytes, from_wrapped_pco, raw_samples};
use crate::rows::Others;
use crate::sections::SECTIONS;
use crate::{BlockCodec, Error, learned, levels, stored};

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
        let others = Others::new(others, rows)?;
        if rows == 0 {
            return match bytes.len() {
                0 => Ok(Vec::new()),
                left => Err(Damaged::new("block", format!("{left} bytes"), "none for no rows").into()),
            };
        }
        match bytes.strip_prefix(&SECTIONS) {
            Some(sections) => self.decode_sections(sections, rows),
            None => self.decode_section(bytes, rows, others.as_ref()),
        }
    }

    /// The samples of a block without sections, of at least one row.
    pub(crate) fn decode_section(
        &self,
        bytes: &[u8],
        rows: usize,
        others: Option<&Others<'_>>,
    ) -> Result<Vec<f64>, Error> {
        let mut bytes = Bytes(bytes);
        let head = self.read_head(&mut bytes, rows)?;
        let rest = bytes.0;
        let expected = "the other columns that it was written with";
        ensure!(!head.joint || others.is_some(), Damaged::new("block", "joint", expected));
        let others = others.filter(|_| head.joint);
        let keys = match head.coding {
            Coding::Levels => Some(Reader::all(rest, |coder| levels::code(coder, true, None, rows, others))?),
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
            Coding::Models | Coding::Counts => {
                let by_models = head.coding == Coding::Models;
                Reader::all(rest, |coder| code_block(coder, by_models, &grid, None, rows, others))?
            }
            Coding::Wrapped => from_wrapped_pco::<i64>(rest, rows)?,
            Coding::Tables => learned::read(rest, rows)?,
            Coding::Stored => stored::read(rest, rows)?,
            _ => match keys {
                Some(keys) => keys.into_iter().map(levels::index_of_key).collect(),
                None => from_pco_bytes::<i64>(rest, rows)?,
            },
        };
        let mut samples = grid.values(&indices);
        for (row, sample) in head.exceptions.iter() {
            samples[*row] = *sample;
        }
        Ok(samples)
    }
}
