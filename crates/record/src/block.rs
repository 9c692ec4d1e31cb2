//! Blocks: rows that are decoded alone, with nothing but the header.
//!
//! ```text
//! block     := length varint, body, CRC-32 (little-endian) of header's checksum, length and body
//! body      := varint 2 b                            a plain block: all rows, on the grid, all columns plain
//!            | varint 2 flags + 1, [rows varint], time, [descriptors], [specials]
//!              then columns
//! flags     := time kind (2 bits), rows follow (1), descriptors follow (1), specials follow (1)
//! descriptors := a bit per column, the first one lowest: whether it is plain (0) or has a descriptor (1); then those
//! descriptor:= codec id (4 bits), a bound of its own follows (bit 5), others follow (bit 6)       plain: codec 2, nothing follows
//! specials  := length varint, bytes (module `specials`)
//! column    := [bound, 3 bytes] [others] [length varint, but for the last column] bytes
//! others    := number - 1 (byte), how many columns before this one each stands (varints)
//!
//! `others` are columns whose restored cells the codec used for the prediction; their rows are those in which this column has values.
//! ```

use crate::bound::Bound;
use crate::codec::{self, CodecId, JOINT_COLUMNS};
use crate::error::Damage;
use crate::header::Header;
use crate::related;
use crate::specials::{self, Special, Specials};
use crate::time::{self, TimeKind};
use crate::wire::{Bytes, CHECK_BYTES, checksum, push_varint};
use fewbits_adaptive::Effort;

/// The cells of one column; `None` is a gap.
pub type Cells = Vec<Option<f64>>;

/// Rows as they were restored, or are to be stored.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Block {
    /// The tick of each row.
    pub ticks: Vec<i64>,
    /// One list of cells per column; `None` is a gap. A column that was not asked for is empty.
    pub columns: Vec<Cells>,
    /// For columns with a share of the range: the bound in this block in units of the column; 0 means lossless. `None` for others.
    pub share_bounds: Vec<Option<f64>>,
}

impl Block {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.ticks.len()
    }
}

const ROWS_FOLLOW: u64 = 4;
const DESCRIPTORS_FOLLOW: u64 = 8;
const SPECIALS_FOLLOW: u64 = 16;
const BOUND_FOLLOWS: u8 = 0x20;
const OTHERS_FOLLOW: u8 = 0x40;
const DESCRIPTOR_BITS: u8 = 15 | BOUND_FOLLOWS | OTHERS_FOLLOW;
const PLAIN: u8 = CodecId::Adaptive as u8;

struct CodedColumn {
    descriptor: u8,
    /// Bound and others.
    head: Vec<u8>,
    bytes: Vec<u8>,
    specials: Specials,
    restored: Cells,
}

/// The cells of another column in the rows in which a column has values; NaN for gaps.
fn aligned(cells: &[Option<f64>], has_value: &[bool]) -> Vec<f64> {
    let kept = cells.iter().zip(has_value).filter(|(_, kept)| **kept);
    kept.map(|(cell, _)| cell.unwrap_or(f64::NAN)).collect()
}

/// One column of a block. `before` are the columns before it as a reader will restore them.
fn encode_column(
    header: &Header,
    cells: &[Option<f64>],
    own: Option<f64>,
    before: &[Cells],
    effort: Effort,
) -> CodedColumn {
    let column = before.len();
    let target = header.target(column, own);
    let start = header.start(column, own);
    let mut specials: Specials = cells.iter().map(|cell| Special::of(*cell)).collect();
    let has_value: Vec<bool> = specials.iter().map(Option::is_none).collect();
    let samples = aligned(cells, &has_value);
    let mut others = match effort {
        Effort::Thorough => related::columns(cells, before),
        _ => Vec::new(),
    };
    let values: Vec<Vec<f64>> = others.iter().map(|i| aligned(&before[*i], &has_value)).collect();
    let values: Vec<&[f64]> = values.iter().map(Vec::as_slice).collect();
    let coded = codec::encode(&samples, &target, start.as_ref(), &values, effort);
    if !coded.uses_others {
        others.clear();
    }
    // Samples whose restored value breaks the promise are stored whole.
    let mut values = samples.iter().zip(&coded.restored);
    for special in specials.iter_mut().filter(|special| special.is_none()) {
        if let Some((sample, value)) = values.next()
            && !target.holds(*sample, *value)
        {
            *special = Some(Special::Whole(sample.to_bits()));
        }
    }
    let mut descriptor = coded.id as u8;
    let mut head = Vec::new();
    if let Some(bound) = own {
        descriptor |= BOUND_FOLLOWS;
        head.extend_from_slice(&bound.to_be_bytes()[..3]);
    }
    if !others.is_empty() {
        descriptor |= OTHERS_FOLLOW;
        head.push((others.len() - 1) as u8);
        others
            .iter()
            .for_each(|other| push_varint(&mut head, (column - other) as u64));
    }
    CodedColumn {
        descriptor,
        head,
        bytes: coded.bytes,
        restored: specials::merged(&specials, &coded.restored),
        specials,
    }
}

/// A block's bytes, and the cells as a reader will restore them.
pub(crate) fn encode(
    header: &Header,
    ticks: &[i64],
    columns: &[Cells],
    own_bounds: &[Option<f64>],
    effort: Effort,
) -> (Vec<u8>, Vec<Cells>) {
    let (mut coded, mut restored) = (Vec::with_capacity(columns.len()), Vec::with_capacity(columns.len()));
    for (cells, own) in columns.iter().zip(own_bounds) {
        let mut column = encode_column(header, cells, *own, &restored, effort);
        restored.push(std::mem::take(&mut column.restored));
        coded.push(column);
    }
    let (kind, time) = time::encode(ticks, &header.grid());
    let mut body = Vec::new();
    let plain = coded.iter().all(|column| column.descriptor == PLAIN);
    let whole = ticks.len() == header.schema.rows_per_block;
    let specials: Vec<Specials> = coded
        .iter_mut()
        .map(|column| std::mem::take(&mut column.specials))
        .collect();
    let ordinary = specials.iter().flatten().all(Option::is_none);
    match (kind, Bytes(&time).varint()) {
        (TimeKind::Grid, Ok(block)) if plain && whole && ordinary => push_varint(&mut body, 2 * block),
        _ => {
            let rows = if whole { 0 } else { ROWS_FOLLOW };
            let descriptors = if plain { 0 } else { DESCRIPTORS_FOLLOW };
            let follow = if ordinary { 0 } else { SPECIALS_FOLLOW };
            push_varint(&mut body, 2 * (kind as u64 | rows | descriptors | follow) + 1);
            if !whole {
                push_varint(&mut body, ticks.len() as u64);
            }
            body.extend_from_slice(&time);
            if !plain {
                let has_own: Vec<bool> = coded.iter().map(|column| column.descriptor != PLAIN).collect();
                body.extend(has_own.chunks(8).map(|eight| {
                    let bits = eight.iter().enumerate();
                    bits.fold(0, |byte, (i, own)| byte | u8::from(*own) << i)
                }));
                body.extend(coded.iter().map(|column| column.descriptor).filter(|d| *d != PLAIN));
            }
            if !ordinary {
                let bytes = specials::encode(&specials, ticks.len());
                push_varint(&mut body, bytes.len() as u64);
                body.extend(bytes);
            }
        }
    }
    let last = coded.len() - 1;
    for (i, column) in coded.into_iter().enumerate() {
        body.extend(column.head);
        if i < last {
            push_varint(&mut body, column.bytes.len() as u64);
        }
        body.extend(column.bytes);
    }
    (framed(header, body), restored)
}

/// Length, body, checksum.
fn framed(header: &Header, body: Vec<u8>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(body.len() + 9);
    push_varint(&mut bytes, body.len() as u64);
    bytes.extend(body);
    let check = checksum(&[&header.check.to_le_bytes(), &bytes]);
    bytes.extend(check.to_le_bytes());
    bytes
}

/// The most bytes that a block of a recording may have: twice what raw samples take. A longer one is not a block.
pub(crate) fn max_bytes(header: &Header) -> usize {
    let cells = (header.schema.columns.len() + 1) * header.schema.rows_per_block;
    64 + 32 * header.schema.columns.len() + 24 * cells
}

/// The length in bytes of the block that begins here.
///
/// # Errors
/// [`Damage::CutOff`] if the slice ends before the block does, others if no block begins here.
pub(crate) fn length(header: &Header, bytes: &[u8]) -> Result<usize, Damage> {
    let mut reader = Bytes(bytes);
    let length = reader.varint().map_err(|damage| match damage {
        Damage::CutOff => damage,
        _ => Damage::NoBlock,
    })?;
    let limit = max_bytes(header) as u64;
    if length == 0 || length > limit {
        return Err(Damage::NoBlock);
    }
    let body = reader.take(length as usize)?;
    let end = bytes.len() - reader.0.len();
    debug_assert_eq!(body.len() as u64, length);
    let check = u32::from_le_bytes(reader.array::<CHECK_BYTES>()?);
    if check != checksum(&[&header.check.to_le_bytes(), &bytes[..end]]) {
        return Err(Damage::Checksum);
    }
    Ok(end + CHECK_BYTES)
}

/// Decodes one block whose checksum was found right; columns that are not `wanted` stay empty.
pub(crate) fn decode(header: &Header, bytes: &[u8], wanted: impl Fn(usize) -> bool) -> Result<Block, Damage> {
    let mut reader = Bytes(bytes);
    let length = reader.count(bytes.len(), "length")?;
    let mut body = Bytes(reader.take(length)?);
    let (grid, columns) = (header.grid(), header.schema.columns.len());
    let mut rows = header.schema.rows_per_block;
    let mut descriptors = vec![PLAIN; columns];
    let mut specials = Vec::new();
    let head = body.varint()?;
    let ticks = if head & 1 == 0 {
        let mut block = Vec::new();
        push_varint(&mut block, head >> 1);
        time::decode(TimeKind::Grid, &mut Bytes(&block), rows, &grid)?
    } else {
        let flags = head >> 1;
        if flags > 31 {
            return Err(Damage::Content("flags"));
        }
        if flags & ROWS_FOLLOW != 0 {
            rows = body.count(rows, "number of rows")?;
        }
        if rows == 0 {
            return Err(Damage::Content("number of rows"));
        }
        let ticks = time::decode(TimeKind::from_bits(flags), &mut body, rows, &grid)?;
        if flags & DESCRIPTORS_FOLLOW != 0 {
            let has_own = body.take(columns.div_ceil(8))?;
            for (i, descriptor) in descriptors.iter_mut().enumerate() {
                if has_own[i / 8] >> (i % 8) & 1 == 1 {
                    *descriptor = body.byte()?;
                }
            }
        }
        if flags & SPECIALS_FOLLOW != 0 {
            let length = body.count(body.0.len(), "length of special cells")?;
            specials = specials::decode(body.take(length)?, columns, rows)?;
        }
        ticks
    };
    specials.resize(columns, Specials::new());
    let mut sections = Vec::with_capacity(columns);
    for (i, (descriptor, specials)) in descriptors.into_iter().zip(specials).enumerate() {
        sections.push(read_section(header, &mut body, i, descriptor, specials)?);
    }
    // Columns that a wanted one was predicted from are decoded too; they stand before it.
    let mut needed: Vec<bool> = (0..columns).map(&wanted).collect();
    for i in (0..columns).rev() {
        if needed[i] {
            sections[i].others.iter().for_each(|other| needed[*other] = true);
        }
    }
    let mut decoded: Vec<Cells> = Vec::with_capacity(columns);
    for (i, section) in sections.iter().enumerate() {
        let cells = if needed[i] {
            section.cells(header, &decoded, rows)?
        } else {
            Cells::new()
        };
        decoded.push(cells);
    }
    for (_, cells) in decoded.iter_mut().enumerate().filter(|(i, _)| !wanted(*i)) {
        *cells = Cells::new();
    }
    Ok(Block {
        ticks,
        columns: decoded,
        share_bounds: sections
            .iter()
            .enumerate()
            .map(|(i, section)| section.share_bound(header, i))
            .collect(),
    })
}

/// The bytes of one column, taken apart.
struct Section<'a> {
    id: CodecId,
    own: Option<f64>,
    specials: Specials,
    others: Vec<usize>,
    bytes: &'a [u8],
}

fn read_section<'a>(
    header: &Header,
    body: &mut Bytes<'a>,
    column: usize,
    descriptor: u8,
    specials: Specials,
) -> Result<Section<'a>, Damage> {
    if descriptor & !DESCRIPTOR_BITS != 0 {
        return Err(Damage::Content("descriptor"));
    }
    let id = CodecId::from_byte(descriptor & 15)?;
    let own = if descriptor & BOUND_FOLLOWS != 0 {
        Some(read_bound(body)?)
    } else {
        None
    };
    let mut others = Vec::new();
    if descriptor & OTHERS_FOLLOW != 0 {
        let count = usize::from(body.byte()?) + 1;
        if count > JOINT_COLUMNS {
            return Err(Damage::Content("number of other columns"));
        }
        for _ in 0..count {
            let back = body.count(column, "another column")?;
            others.push(
                column
                    .checked_sub(back)
                    .filter(|_| back > 0)
                    .ok_or(Damage::Content("another column"))?,
            );
        }
    }
    let is_last = column + 1 == header.schema.columns.len();
    let length = if is_last {
        body.0.len()
    } else {
        body.count(body.0.len(), "length of a column")?
    };
    Ok(Section {
        id,
        own,
        specials,
        others,
        bytes: body.take(length)?,
    })
}

impl Section<'_> {
    fn cells(&self, header: &Header, before: &[Cells], rows: usize) -> Result<Cells, Damage> {
        let mut has_value = vec![true; rows];
        for (has_value, special) in has_value.iter_mut().zip(&self.specials) {
            *has_value = special.is_none_or(Special::has_value);
        }
        let count = has_value.iter().filter(|has| **has).count();
        let others: Vec<Vec<f64>> = self.others.iter().map(|i| aligned(&before[*i], &has_value)).collect();
        let others: Vec<&[f64]> = others.iter().map(Vec::as_slice).collect();
        let target = header.target(before.len(), self.own);
        let start = header.start(before.len(), self.own);
        let values = codec::decode(self.id, self.bytes, count, &target, start.as_ref(), &others)?;
        Ok(specials::merged(&self.specials, &values))
    }

    fn share_bound(&self, header: &Header, column: usize) -> Option<f64> {
        let shared = matches!(header.schema.columns[column].bound, Bound::ShareOfRange(_));
        shared.then(|| self.own.unwrap_or(header.share_bounds[column]))
    }
}

fn read_bound(body: &mut Bytes<'_>) -> Result<f64, Damage> {
    let [a, b, c] = body.array()?;
    let bound = f64::from_be_bytes([a, b, c, 0, 0, 0, 0, 0]);
    if bound > 0.0 && (2.0 * bound).is_finite() {
        Ok(bound)
    } else {
        Err(Damage::Content("bound"))
    }
}
