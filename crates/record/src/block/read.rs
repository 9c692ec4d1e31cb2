//! Decoding of a block.

use super::{
    APART, BOUND_FOLLOWS, Block, Cells, DESCRIPTOR_BITS, DESCRIPTORS_FOLLOW, NUMBERS, OTHERS_FOLLOW, ROWS_FOLLOW,
    SPECIALS_FOLLOW, aligned, plain, shared,
};
use crate::bound::Bound;
use crate::codec::{self, CodecId, Context, JOINT_COLUMNS};
use crate::error::{Damage, Error, ensure};
use crate::header::{Header, VERSION_5};
use crate::specials::{self, Specials};
use crate::time::{self, TimeKind};
use crate::wire::{Bytes, Fields, push_varint, short_bound};
use fewbits_block_codec::arithmetic::Reader;

/// Decodes one block whose checksum was verified. Columns that are not `wanted` stay empty.
pub(crate) fn decode(header: &Header, bytes: &[u8], wanted: impl Fn(usize) -> bool) -> Result<Block, Damage> {
    decode_content(header, content_of(bytes)?, wanted)
}

/// The first numbers of a block's content.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Head {
    pub(super) number: Option<u64>,
    /// The number on the grid, if all rows are there, on the grid, and every column is usual.
    pub(super) usual: Option<u64>,
    pub(super) flags: u64,
}

impl Head {
    /// Writes these numbers, or reads others; those of version 5 are only read.
    pub(super) fn code<F: Fields>(self, fields: &mut F, is_old: bool) -> Result<Self, Damage> {
        let apart = u64::from(self.flags & APART != 0);
        let own = 4 * self.number.unwrap_or(0) + 2 * apart + u64::from(self.usual.is_none());
        let head = fields.varint(own)?;
        ensure!(is_old || head >> 2 < NUMBERS, Damage::Content("number of a block"));
        let apart = (head >> 1 & 1) * APART;
        let has_flags = head & 1 == 1;
        let flags = match (has_flags, is_old) {
            (false, _) => apart,
            (true, true) => head >> 1,
            (true, false) => {
                let flags = fields.varint(self.flags & !APART)?;
                ensure!(flags & APART == 0, Damage::Content("flags"));
                flags | apart
            }
        };
        Ok(Self {
            number: (!is_old).then_some(head >> 2),
            usual: (!has_flags).then_some(head >> 2),
            flags,
        })
    }
}

/// The content of a block.
pub(crate) fn content_of(bytes: &[u8]) -> Result<&[u8], Damage> {
    let mut reader = Bytes(bytes);
    let length = reader.count(bytes.len(), "length")?;
    Ok(reader.take(length)?)
}

/// The content of a block of version 5, or of an only block, as a block of this version and number: only the first numbers differ.
pub(crate) fn renewed(header: &Header, content: &[u8], number: u64) -> Result<Vec<u8>, Damage> {
    let mut body = Bytes(content);
    let Head { usual, flags, .. } = Head::default().code(&mut body, header.version == VERSION_5)?;
    let rows =
        Some(header.block_rows()).filter(|rows| *rows != header.schema.rows_per_block && flags & ROWS_FOLLOW == 0);
    let own = Head {
        number: Some(number),
        usual: usual.filter(|on_grid| *on_grid == number && rows.is_none()),
        flags: flags | if rows.is_some() { ROWS_FOLLOW } else { 0 },
    };
    let mut content = Vec::new();
    own.code(&mut content, false)?;
    if own.usual.is_none() {
        rows.into_iter().for_each(|rows| push_varint(&mut content, rows as u64));
        usual.into_iter().for_each(|on_grid| push_varint(&mut content, on_grid));
    }
    content.extend_from_slice(body.0);
    Ok(content)
}

/// Decodes the only block of a recording of so many bytes.
///
/// # Errors
/// If no recorder wrote it.
pub(crate) fn only(
    header: &Header,
    content: &[u8],
    bytes: u64,
    wanted: impl Fn(usize) -> bool,
) -> Result<Block, Error> {
    decode_content(header, content, wanted).map_err(|damage| Error::block(0, bytes, damage))
}

/// Decodes the content of a block.
pub(crate) fn decode_content(header: &Header, content: &[u8], wanted: impl Fn(usize) -> bool) -> Result<Block, Damage> {
    let mut body = Bytes(content);
    let (grid, columns) = (header.grid(), header.schema.columns.len());
    let mut rows = header.block_rows();
    let mut descriptors: Vec<u8> = (0..columns).map(|i| plain(header, false, i)).collect();
    let mut specials = Vec::new();
    let Head { number, usual, flags } = Head::default().code(&mut body, header.version == VERSION_5)?;
    ensure!(flags <= 63, Damage::Content("flags"));
    // Without stored descriptors, columns have those of `plain`; apart, none is shared.
    if flags & APART != 0 {
        descriptors.fill(CodecId::Adaptive as u8);
    }
    let ticks = if let Some(on_grid) = usual {
        grid.ticks(on_grid, rows)?
    } else {
        if flags & ROWS_FOLLOW != 0 {
            rows = body.count(rows, "number of rows")?;
        }
        ensure!(rows > 0, Damage::Content("number of rows"));
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
    let is_shared = |descriptor: &u8| *descriptor == CodecId::Shared as u8;
    let shares = descriptors.iter().any(is_shared);
    let mut sections = Vec::with_capacity(columns);
    for (i, descriptor) in descriptors.iter().enumerate() {
        let has_length = shares || i + 1 < columns;
        sections.push(read_section(header, &mut body, i, *descriptor, has_length)?);
    }
    let mut shared = Reader::new(body.0);
    if shares {
        specials = shared::specials(&mut shared, None, columns, rows)?;
    } else {
        body.finish()?;
    }
    specials.resize(columns, Specials::new());
    // The columns that a wanted one was predicted from must be decoded too; they are before it. In a shared code, all columns before it.
    let mut needed: Vec<bool> = (0..columns).map(&wanted).collect();
    for i in (0..columns).rev() {
        if needed[i] {
            sections[i].others.iter().for_each(|other| needed[*other] = true);
            let before = if shares { i } else { 0 };
            needed[..before].fill(true);
        }
    }
    let mut decoded: Vec<Cells> = Vec::with_capacity(columns);
    for (i, (section, specials)) in sections.iter().zip(&specials).enumerate() {
        decoded.push(match section.id {
            _ if !needed[i] => Cells::new(),
            CodecId::Shared => shared::decode(header, &mut shared, &decoded, specials, rows)?,
            _ => section.cells(header, &decoded, specials, rows)?,
        });
    }
    if shares && !needed.contains(&false) {
        shared.finish().map_err(|_| Damage::Content("shared code"))?;
    }
    for (_, cells) in decoded.iter_mut().enumerate().filter(|(i, _)| !wanted(*i)) {
        *cells = Cells::new();
    }
    let share_bound = |(i, section): (usize, &Section<'_>)| match header.schema.columns[i].bound {
        Bound::ShareOfRange(_) => Some(section.own.unwrap_or(header.share_bounds[i])),
        _ => None,
    };
    Ok(Block {
        number,
        ticks,
        columns: decoded,
        share_bounds: sections.iter().enumerate().map(share_bound).collect(),
    })
}

/// The parts of the bytes of one column.
struct Section<'a> {
    id: CodecId,
    own: Option<f64>,
    others: Vec<usize>,
    bytes: &'a [u8],
}

fn read_section<'a>(
    header: &Header,
    body: &mut Bytes<'a>,
    column: usize,
    descriptor: u8,
    has_length: bool,
) -> Result<Section<'a>, Damage> {
    ensure!(descriptor & !DESCRIPTOR_BITS == 0, Damage::Content("descriptor"));
    let id = CodecId::from_byte(descriptor & 15)?;
    if id == CodecId::Shared {
        ensure!(descriptor & !15 == 0 && header.start(column, None).is_some(), Damage::Content("descriptor"));
        let (own, others, bytes) = (None, Vec::new(), &body.0[..0]);
        return Ok(Section { id, own, others, bytes });
    }
    let (own, others) = front(body, column, descriptor, None, &[])?;
    let length = match has_length {
        true => body.count(body.0.len(), "length of a column")?,
        false => body.0.len(),
    };
    let bytes = body.take(length)?;
    Ok(Section { id, own, others, bytes })
}

/// What stands in front of a column's bytes, as its descriptor says: its own bound, and the columns that it was predicted from.
pub(super) fn front<F: Fields>(
    fields: &mut F,
    column: usize,
    descriptor: u8,
    own: Option<f64>,
    others: &[usize],
) -> Result<(Option<f64>, Vec<usize>), Damage> {
    let (mut bound, mut found) = (None, Vec::new());
    if descriptor & BOUND_FOLLOWS != 0 {
        bound = Some(short_bound(fields, own.unwrap_or(0.0))?);
        ensure!(bound != Some(0.0), Damage::Content("bound"));
    }
    if descriptor & OTHERS_FOLLOW != 0 {
        let count = usize::from(fields.byte(others.len().saturating_sub(1) as u8)?) + 1;
        ensure!(count <= JOINT_COLUMNS, Damage::Content("number of other columns"));
        for i in 0..count {
            let back = others.get(i).map_or(0, |other| column - other);
            let back = fields.count(back, column, "another column")?;
            let other = column.checked_sub(back).filter(|_| back > 0);
            found.push(other.ok_or(Damage::Content("another column"))?);
        }
    }
    Ok((bound, found))
}

impl Section<'_> {
    fn cells(&self, header: &Header, before: &[Cells], specials: &Specials, rows: usize) -> Result<Cells, Damage> {
        let has_value = specials::has_value(specials, rows);
        let count = has_value.iter().filter(|has| **has).count();
        let others: Vec<Vec<f64>> = self.others.iter().map(|i| aligned(&before[*i], &has_value)).collect();
        let others: Vec<&[f64]> = others.iter().map(Vec::as_slice).collect();
        let target = header.target(before.len(), self.own);
        let start = header.start(before.len(), self.own);
        let context = Context {
            target: &target,
            start: start.as_ref(),
            others: &others,
        };
        let values = codec::decode(self.id, self.bytes, count, context)?;
        Ok(specials::merged(specials, &values))
    }
}
