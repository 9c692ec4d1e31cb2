//! Blocks: rows that are decoded alone, with nothing but the header.
//!
//! ```text
//! block     := length varint, body, CRC-32 (little-endian) of header's checksum, length and body
//! body      := varint 2 b                            a plain block: all rows, on the grid, all columns plain
//!            | varint 2 flags + 1, [rows varint], time, [descriptor per column]
//!              then columns
//! flags     := time kind (2 bits), rows follow (1), descriptors follow (1)
//! descriptor:= codec id (4 bits), runs follow (1), a bound of its own follows (1)        plain: codec 2, nothing follows
//! column    := [bound, 3 bytes] [runs] [length varint, but for the last column] bytes
//! ```

use crate::codec::{self, CodecId};
use crate::error::{Damage, Error};
use crate::header::Header;
use crate::runs::{self, Special};
use crate::time::{self, TimeKind};
use crate::wire::{Bytes, CHECK_BYTES, checksum, push_varint};

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
const RUNS_FOLLOW: u8 = 0x10;
const BOUND_FOLLOWS: u8 = 0x20;
const PLAIN: u8 = CodecId::Adaptive as u8;

/// The next smaller double of 12 bits of mantissa, as stored in three bytes.
pub(crate) fn rounded_down(bound: f64) -> f64 {
    f64::from_bits(bound.to_bits() & !0xff_ffff_ffff)
}

struct CodedColumn {
    descriptor: u8,
    /// Bound and runs.
    head: Vec<u8>,
    bytes: Vec<u8>,
    restored: Vec<Option<f64>>,
}

fn encode_column(
    header: &Header,
    column: usize,
    cells: &[Option<f64>],
    own: Option<f64>,
) -> Result<CodedColumn, Error> {
    let target = header.target(column, own);
    let mut specials: Vec<Option<Special>> = cells.iter().map(|cell| Special::of(*cell)).collect();
    let finite = cells.iter().zip(&specials).filter(|(_, special)| special.is_none());
    let samples: Vec<f64> = finite.filter_map(|(cell, _)| *cell).collect();
    let coded = codec::encode(&samples, &target);
    // Samples whose restored value breaks the promise are stored whole.
    let mut values = samples.iter().zip(&coded.restored);
    for special in specials.iter_mut().filter(|special| special.is_none()) {
        if let Some((sample, value)) = values.next()
            && !target.holds(*sample, *value)
        {
            *special = Some(Special::Whole(sample.to_bits()));
        }
    }
    let mut restored = coded.restored.iter();
    let restored = specials.iter().map(|special| match special {
        None => restored.next().copied(),
        Some(special) => {
            if special.has_value() {
                restored.next();
            }
            special.cell()
        }
    });
    let restored = restored.collect();
    let mut descriptor = coded.id as u8;
    let mut head = Vec::new();
    if let Some(bound) = own {
        descriptor |= BOUND_FOLLOWS;
        head.extend_from_slice(&bound.to_be_bytes()[..3]);
    }
    let runs = runs::runs(&specials);
    if !runs.is_empty() {
        descriptor |= RUNS_FOLLOW;
        runs::push(&runs, &mut head).map_err(|error| Error::Codec {
            column: header.schema.columns[column].name.clone(),
            source: error.into(),
        })?;
    }
    Ok(CodedColumn {
        descriptor,
        head,
        bytes: coded.bytes,
        restored,
    })
}

/// A block's bytes, and the cells as a reader will restore them.
pub(crate) fn encode(
    header: &Header,
    ticks: &[i64],
    columns: &[Cells],
    own_bounds: &[Option<f64>],
) -> Result<(Vec<u8>, Vec<Cells>), Error> {
    let coded: Vec<CodedColumn> = columns
        .iter()
        .enumerate()
        .map(|(i, cells)| encode_column(header, i, cells, own_bounds[i]))
        .collect::<Result<_, _>>()?;
    let (kind, time) = time::encode(ticks, &header.grid());
    let mut body = Vec::new();
    let plain = coded.iter().all(|column| column.descriptor == PLAIN);
    let whole = ticks.len() == header.schema.rows_per_block;
    match (kind, Bytes(&time).varint()) {
        (TimeKind::Grid, Ok(block)) if plain && whole => push_varint(&mut body, 2 * block),
        _ => {
            let rows = if whole { 0 } else { ROWS_FOLLOW };
            let descriptors = if plain { 0 } else { DESCRIPTORS_FOLLOW };
            push_varint(&mut body, 2 * (kind as u64 | rows | descriptors) + 1);
            if !whole {
                push_varint(&mut body, ticks.len() as u64);
            }
            body.extend_from_slice(&time);
            if !plain {
                body.extend(coded.iter().map(|column| column.descriptor));
            }
        }
    }
    let last = coded.len() - 1;
    let mut restored = Vec::with_capacity(coded.len());
    for (i, column) in coded.into_iter().enumerate() {
        body.extend(column.head);
        if i < last {
            push_varint(&mut body, column.bytes.len() as u64);
        }
        body.extend(column.bytes);
        restored.push(column.restored);
    }
    Ok((framed(header, body), restored))
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
    let head = body.varint()?;
    let ticks = if head & 1 == 0 {
        let mut block = Vec::new();
        push_varint(&mut block, head >> 1);
        time::decode(TimeKind::Grid, &mut Bytes(&block), rows, &grid)?
    } else {
        let flags = head >> 1;
        if flags > 15 {
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
            descriptors.copy_from_slice(body.take(columns)?);
        }
        ticks
    };
    let mut block = Block {
        ticks,
        columns: Vec::with_capacity(columns),
        share_bounds: Vec::with_capacity(columns),
    };
    for (i, descriptor) in descriptors.into_iter().enumerate() {
        let own = if descriptor & BOUND_FOLLOWS != 0 {
            Some(read_bound(&mut body)?)
        } else {
            None
        };
        let runs = if descriptor & RUNS_FOLLOW != 0 {
            runs::read(&mut body, rows)?
        } else {
            Vec::new()
        };
        let id = CodecId::from_byte(descriptor & 15)?;
        let length = if i + 1 < columns {
            body.count(body.0.len(), "length of a column")?
        } else {
            body.0.len()
        };
        let bytes = body.take(length)?;
        let shared = matches!(header.schema.columns[i].bound, crate::Bound::ShareOfRange(_));
        block
            .share_bounds
            .push(shared.then(|| own.unwrap_or(header.share_bounds[i])));
        let mut cells = Vec::new();
        if wanted(i) {
            let without: usize = runs
                .iter()
                .filter(|run| !run.special.has_value())
                .map(|run| run.length)
                .sum();
            let values = codec::decode(id, bytes, rows - without, &header.target(i, own))?;
            cells = merged(&runs, &values, rows);
        }
        block.columns.push(cells);
    }
    Ok(block)
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

/// Values with the special cells between them.
fn merged(runs: &[runs::Run], values: &[f64], rows: usize) -> Vec<Option<f64>> {
    let mut cells = Vec::with_capacity(rows);
    let mut values = values.iter().copied();
    for run in runs {
        cells.extend(values.by_ref().take(run.start - cells.len()).map(Some));
        if run.special.has_value() {
            values.by_ref().take(run.length).for_each(drop);
        }
        cells.extend(std::iter::repeat_n(run.special.cell(), run.length));
    }
    cells.extend(values.map(Some));
    cells
}
