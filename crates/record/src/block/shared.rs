//! One arithmetic code for special cells and columns of a block.
//!
//! ```text
//! any special cells? (even odds)   if so: module `specials`   then column by column:
//! predicted from other columns? (1 in 8; never the first)   if so: their number - 1 (2 bits), how far before this one each stands, less 1 (4 bits)
//! indices behind the column's start (module `block::start` of fewbits-block-codec)
//! ```

use super::{Cells, aligned};
use crate::codec::{JOINT_COLUMNS, adaptive};
use crate::error::{Damage, ensure};
use crate::header::Header;
use crate::related;
use crate::specials::{self, Specials};
use fewbits_block_codec::Effort;
use fewbits_block_codec::arithmetic::{Coder, Reader, Writer};

/// Probabilities, in units of `2^-16`: that a block has special cells, and (`OTHERS`) that a column is predicted from others.
const SPECIALS: u32 = 1 << 15;
const OTHERS: u32 = 1 << 13;
/// Bits of the number of other columns, and of the distance to each.
const NUMBER_BITS: u32 = 2;
const DISTANCE_BITS: u32 = 4;

/// The samples of a column as indices on its start's grid, and the samples; `None` if it needs bytes of its own.
pub(super) fn indices(
    header: &Header,
    column: usize,
    cells: &[Option<f64>],
    own: Option<f64>,
    effort: Effort,
) -> Option<(Vec<i64>, Vec<f64>)> {
    let (start, target) = (header.start(column, own)?, header.target(column, own));
    let samples: Vec<f64> = cells.iter().flatten().copied().filter(|x| x.is_finite()).collect();
    let codec = adaptive::codec(&target)?.with_effort(effort);
    let indices = codec.indices_on(&start, &adaptive::prepared(&samples, &target))?;
    let values = adaptive::restored(start.values(&indices), &target);
    let mut pairs = samples.iter().zip(&values);
    let holds = pairs.all(|(sample, value)| target.holds(*sample, *value));
    holds.then_some((indices, values))
}

/// Special cells of all columns: `wanted` at the writer, `None` at the reader.
pub(super) fn specials<C: Coder>(
    coder: &mut C,
    wanted: Option<&[Specials]>,
    columns: usize,
    rows: usize,
) -> Result<Vec<Specials>, Damage> {
    let any = wanted.is_some_and(|wanted| wanted.iter().flatten().any(Option::is_some));
    if coder.bit(SPECIALS, any) {
        specials::code(coder, wanted, columns, rows)
    } else {
        Ok(Vec::new())
    }
}

/// The columns that one is predicted from.
fn others<C: Coder>(coder: &mut C, column: usize, wanted: &[usize]) -> Result<Vec<usize>, Damage> {
    if column == 0 || !coder.bit(OTHERS, !wanted.is_empty()) {
        return Ok(Vec::new());
    }
    let count = coder.raw((wanted.len() as u64).saturating_sub(1), NUMBER_BITS) as usize + 1;
    ensure!(count <= JOINT_COLUMNS, Damage::Content("number of other columns"));
    let other = |i: usize| {
        let distance = wanted.get(i).map_or(0, |other| (column - other - 1) as u64);
        let distance = coder.raw(distance, DISTANCE_BITS) as usize + 1;
        column.checked_sub(distance).ok_or(Damage::Content("another column"))
    };
    (0..count).map(other).collect()
}

/// The arithmetic code of all columns that have indices.
pub(super) fn encode(
    header: &Header,
    cells: &[&[Option<f64>]],
    specials: &[Specials],
    indices: &[Option<Vec<i64>>],
    restored: &[Cells],
    effort: Effort,
) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new());
    // Only a reader can fail here.
    let _ = self::specials(&mut writer, Some(specials), cells.len(), cells[0].len());
    for (column, wanted) in indices.iter().enumerate() {
        let codec = adaptive::codec(&header.target(column, None));
        let (Some(wanted), Some(start), Some(codec)) = (wanted, header.start(column, None), codec) else {
            continue;
        };
        let codec = codec.with_effort(effort);
        let has_value = specials::has_value(&specials[column], cells[column].len());
        let written = |related: &[usize]| {
            let mut writer = writer.clone();
            let _ = others(&mut writer, column, related);
            let values: Vec<Vec<f64>> = related.iter().map(|i| aligned(&restored[*i], &has_value)).collect();
            let values: Vec<&[f64]> = values.iter().map(Vec::as_slice).collect();
            let _ = codec.code_shared(&mut writer, &start, Some(wanted), wanted.len(), &values);
            writer
        };
        // The code goes on from the shorter of two versions. A reader is told which, so the choice may be any.
        let alone = written(&[]);
        let related = related::columns(cells[column], &restored[..column], effort);
        let joint = (!related.is_empty()).then(|| written(&related));
        writer = joint.filter(|joint| joint.bits() < alone.bits()).unwrap_or(alone);
    }
    writer.finish()
}

/// Decodes the next column of a shared code. `before` are the cells of all columns before it.
pub(super) fn decode(
    header: &Header,
    reader: &mut Reader<'_>,
    before: &[Cells],
    specials: &Specials,
    rows: usize,
) -> Result<Cells, Damage> {
    let column = before.len();
    let damaged = Damage::Content("shared code");
    let target = header.target(column, None);
    let (start, codec) = header
        .start(column, None)
        .zip(adaptive::codec(&target))
        .ok_or(damaged)?;
    let has_value = specials::has_value(specials, rows);
    let count = has_value.iter().filter(|has| **has).count();
    let others = others(reader, column, &[])?;
    let values: Vec<Vec<f64>> = others.iter().map(|i| aligned(&before[*i], &has_value)).collect();
    let values: Vec<&[f64]> = values.iter().map(Vec::as_slice).collect();
    let indices = codec
        .code_shared(reader, &start, None, count, &values)
        .map_err(|_| damaged)?;
    ensure!(!reader.overran(), damaged);
    Ok(specials::merged(specials, &adaptive::restored(start.values(&indices), &target)))
}
