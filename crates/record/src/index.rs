//! The index: offset, times and ranges of values of each block. A recording can be read without it, but more slowly.
//!
//! `docs/record.md` describes each byte. A segment of the index follows every 1024 blocks and the last one, so a recorder holds at most
//! that many entries. A footer lists the segments; a single segment takes the place of the footer. An entry without rows stands for damaged
//! bytes that `resume` left in place.

use crate::aggregate::{self, Aggregate};
use crate::block::Cells;
use crate::error::{Damage, ensure};
use crate::header::{Header, VERSION_5};
use crate::wire::{Bytes, Fields, checked, read, read_checked, unzigzag, zigzag};

/// Least number of rows per block with which the index has aggregates: those of a column take 25 bytes per block, of smaller blocks a larger part.
const AGGREGATED_ROWS: usize = 4096;

/// Whether the index of a recording has the aggregates of blocks; otherwise it has bounds of their values.
fn has_aggregates(header: &Header) -> bool {
    header.version != VERSION_5 && header.schema.rows_per_block >= AGGREGATED_ROWS
}

/// Number of blocks per segment.
pub(crate) const BLOCKS_PER_SEGMENT: usize = 1024;
pub(crate) const SEGMENT: u8 = b'I';
pub(crate) const FOOTER: u8 = b'F';
/// Kind of a segment that is the only one of a finished recording.
pub(crate) const ONLY: u8 = b'O';
/// The last bytes of a finished recording.
pub(crate) const END: [u8; 4] = *b"fEnd";
/// Bytes after the footer's checksum.
pub(crate) const TRAILER_BYTES: usize = 8;
/// Largest length of a footer in bytes.
const MAX_FOOTER: usize = 1 << 22;

/// What the index says of one block.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BlockInfo {
    /// Offset of the first byte.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u64,
    /// Number of rows.
    pub rows: u64,
    /// Smallest and largest tick.
    pub ticks: (i64, i64),
    /// Lower and upper bound of each column's values (they exceed them by at most a 15th of the column's range in 1024 blocks); `None`
    /// without values.
    pub ends: Vec<Option<(f64, f64)>>,
    /// Aggregates of each column. The index has them if blocks have 4096 rows or more; then [`ends`](Self::ends) are exact.
    pub aggregates: Option<Vec<Aggregate>>,
}

impl BlockInfo {
    /// So many damaged bytes, which have no rows.
    pub(crate) fn damaged(offset: u64, bytes: u64, columns: usize) -> Self {
        Self {
            offset,
            bytes,
            rows: 0,
            ticks: (0, 0),
            ends: vec![None; columns],
            aggregates: None,
        }
    }

    pub(crate) fn of(offset: u64, bytes: u64, ticks: &[i64], columns: &[Cells]) -> Self {
        let aggregates = aggregate::of_columns(columns);
        Self {
            offset,
            bytes,
            rows: ticks.len() as u64,
            ticks: ends_of(ticks).unwrap_or((0, 0)),
            ends: aggregates.iter().map(Aggregate::ends).collect(),
            aggregates: Some(aggregates),
        }
    }

    /// Whether these may be the ticks of the block that this entry describes.
    pub(crate) fn describes(&self, ticks: &[i64], header: &Header) -> bool {
        let tolerance = header.schema.time.tolerance();
        let is_near = |(first, last): (i64, i64)| {
            first.abs_diff(self.ticks.0) <= tolerance && last.abs_diff(self.ticks.1) <= tolerance
        };
        ticks.len() as u64 == self.rows && ends_of(ticks).is_some_and(is_near)
    }
}

/// The smallest and the largest of pairs of these.
pub(crate) fn ends(pairs: impl Iterator<Item = (i64, i64)>) -> Option<(i64, i64)> {
    pairs.reduce(|(low, high), (first, last)| (low.min(first), high.max(last)))
}

/// The smallest and the largest tick.
pub(crate) fn ends_of(ticks: &[i64]) -> Option<(i64, i64)> {
    ends(ticks.iter().map(|tick| (*tick, *tick)))
}

/// Entry of one segment in the footer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Segment {
    /// Offset of its first block.
    pub(crate) start: u64,
    /// Total length of its blocks in bytes; the segment follows them.
    pub(crate) blocks: u64,
    /// Length of the segment itself in bytes.
    pub(crate) length: u64,
    pub(crate) rows: u64,
    pub(crate) ticks: (i64, i64),
}

impl Segment {
    /// Of these entries, of which there must be some.
    pub(crate) fn new(length: u64, entries: &[BlockInfo]) -> Self {
        let filled = entries.iter().filter(|entry| entry.rows > 0);
        let sum = |of: fn(&BlockInfo) -> u64| entries.iter().map(of).fold(0, u64::saturating_add);
        Self {
            start: entries.first().map_or(0, |entry| entry.offset),
            blocks: sum(|entry| entry.bytes),
            length,
            rows: sum(|entry| entry.rows),
            ticks: ends(filled.map(|entry| entry.ticks)).unwrap_or((0, 0)),
        }
    }

    /// Offset of the next segment's first block.
    pub(crate) fn end(&self) -> u64 {
        self.start.saturating_add(self.blocks).saturating_add(self.length)
    }
}

/// A special record: mark, kind, length, content, checksum.
pub(crate) fn special(check: u32, kind: u8, content: &[u8]) -> Vec<u8> {
    checked(check, &[0, kind], content)
}

/// The longest content of a special record of a recording.
pub(crate) fn max_content(kind: u8, header: &Header) -> usize {
    let columns = header.schema.columns.len();
    let of_column = if has_aggregates(header) {
        aggregate::MAX_BYTES
    } else {
        1
    };
    match kind {
        SEGMENT | ONLY => 16 + 8 * columns + BLOCKS_PER_SEGMENT * (40 + of_column * columns),
        FOOTER => MAX_FOOTER,
        _ => 0,
    }
}

/// Kind, content and whole length of the special record at the front, which begins with 0. `sum` gives the checksum of the first bytes.
pub(crate) fn read_special<'a>(
    header: &Header,
    bytes: &'a [u8],
    sum: impl FnOnce(&[u8]) -> u32,
) -> Result<(u8, &'a [u8], usize), Damage> {
    let [mark, kind] = Bytes(bytes).array()?;
    ensure!(mark == 0, Damage::NoBlock);
    let limit = max_content(kind, header);
    let (content, whole) = read_checked(bytes, 2, 0..=limit, sum)?;
    Ok((kind, content, whole))
}

/// Entries and whole length of the segment of the index at the front, whose first block is at `offset`. `None` if it is none, or damaged.
pub(crate) fn listed(header: &Header, bytes: &[u8], offset: u64) -> Option<(Vec<BlockInfo>, u64)> {
    let special = read_special(header, bytes, |bytes| header.sum(bytes)).ok();
    let (_, content, whole) = special.filter(|(kind, ..)| matches!(*kind, SEGMENT | ONLY))?;
    let entries = read(content, |fields| segment(fields, header, offset, &[])).ok()?;
    Some((entries, whole as u64))
}

/// The largest `f32` that does not exceed `value`.
fn f32_below(value: f64) -> f32 {
    let near = value as f32;
    let is_larger = f64::from(near) > value;
    if is_larger { near.next_down() } else { near }
}

/// The largest number of three bytes, the first ones of a big-endian `f32`, that does not exceed `value`.
fn short_below(value: f64) -> f32 {
    let near = f32_below(value).to_bits();
    // Dropping the last byte makes a negative number larger.
    let cut = near & !0xff;
    let is_larger = near >> 31 == 1 && cut != near;
    f32::from_bits(if is_larger { cut + 0x100 } else { cut })
}

fn short_above(value: f64) -> f32 {
    -short_below(-value)
}

fn short<F: Fields>(fields: &mut F, own: f32) -> Result<f64, Damage> {
    let [a, b, c, _] = own.to_be_bytes();
    let [a, b, c] = fields.bytes([a, b, c])?;
    Ok(f64::from(f32::from_be_bytes([a, b, c, 0])))
}

/// Number of levels between a column's bounds.
const MOST: u8 = 15;
const LEVELS: f64 = MOST as f64;
/// Levels of a column without values: the lower exceeds the upper.
const NO_VALUES: [u8; 2] = [1, 0];

/// The level of a value between two bounds, in 15ths, rounded down; `ends` may be infinite.
fn level_below(value: f64, ends: (f64, f64)) -> u8 {
    let share = (value - ends.0) / (ends.1 - ends.0);
    let level = (LEVELS * share).floor().clamp(0.0, LEVELS) as u8;
    // Rounding may put the level above the value.
    level - u8::from(level > 0 && level_value(level, ends) > value)
}

fn level_above(value: f64, ends: (f64, f64)) -> u8 {
    let level = level_below(value, ends);
    (level + u8::from(level_value(level, ends) < value)).min(MOST)
}

fn level_value(level: u8, ends: (f64, f64)) -> f64 {
    match level {
        0 => ends.0,
        MOST.. => ends.1,
        // Bounds that exceed an `f32` are infinite: there are no levels between them.
        _ if !(ends.1 - ends.0).is_finite() => ends.1,
        level => ends.0 + (ends.1 - ends.0) * (f64::from(level) / LEVELS),
    }
}

/// The fields of a segment of these entries, of which a reader has none. The first block is at `offset`.
pub(crate) fn segment<F: Fields>(
    fields: &mut F,
    header: &Header,
    mut offset: u64,
    own: &[BlockInfo],
) -> Result<Vec<BlockInfo>, Damage> {
    let columns = header.schema.columns.len();
    let count = fields.count(own.len(), BLOCKS_PER_SEGMENT, "number of blocks")?;
    let is_aggregated = has_aggregates(header);
    let mut scales = Vec::with_capacity(columns);
    for column in 0..if is_aggregated { 0 } else { columns } {
        let ends = own.iter().filter_map(|entry| entry.ends[column]);
        let all = ends.reduce(|(l, h), (low, high)| (l.min(low), h.max(high)));
        // Without values the lower bound is stored above the upper one.
        let (low, high) = all.map_or((1.0, 0.0), |(low, high)| (short_below(low), short_above(high)));
        scales.push((short(fields, low)?, short(fields, high)?));
    }
    let blank = BlockInfo::damaged(0, 0, columns);
    let (mut entries, mut last, mut before) = (Vec::with_capacity(count), header.origin, None);
    let mut length = 0_u64;
    for i in 0..count {
        let own = own.get(i).unwrap_or(&blank);
        let (rows, ticks) = (own.rows, own.ticks);
        let (distance, span) = (ticks.0.wrapping_sub(last), ticks.1.wrapping_sub(ticks.0));
        let is_same = before == Some((rows, distance, span));
        // Blocks with equal numbers of rows have similar lengths: the difference mostly fits into a byte.
        let longer = zigzag(own.bytes.wrapping_sub(length) as i64);
        let head = fields.varint(longer << 1 | u64::from(is_same))?;
        // Any lengths can stand here: `playback::entries` compares their sum with the footer.
        length = length.wrapping_add(unzigzag(head >> 1) as u64);
        let mut entry = BlockInfo::damaged(offset, length, columns);
        offset = offset.saturating_add(length);
        let shape = if head & 1 == 1 {
            before.ok_or(Damage::Content("block like the one before"))?
        } else {
            match fields.varint(rows)? {
                0 => (0, 0, 0),
                rows => (rows, fields.signed(distance)?, fields.varint(span as u64)? as i64),
            }
        };
        entry.rows = shape.0;
        if entry.rows > 0 {
            let first = last.wrapping_add(shape.1);
            entry.ticks = (first, first.wrapping_add(shape.2));
            (last, before) = (entry.ticks.1, Some(shape));
            if is_aggregated {
                let known = own.aggregates.as_deref().unwrap_or_default();
                let code = |i| Aggregate::code(fields, known.get(i).copied().unwrap_or_default(), entry.rows);
                let aggregates: Vec<Aggregate> = (0..columns).map(code).collect::<Result<_, _>>()?;
                entry.ends = aggregates.iter().map(Aggregate::ends).collect();
                entry.aggregates = Some(aggregates);
            }
            for ((ends, own), scale) in entry.ends.iter_mut().zip(&own.ends).zip(&scales) {
                let levels = own.map(|(low, high)| [level_below(low, *scale), level_above(high, *scale)]);
                let [low, high] = levels.unwrap_or(NO_VALUES);
                let byte = fields.byte(low << 4 | high)?;
                let (low, high) = (byte >> 4, byte & 15);
                *ends = (low <= high).then(|| (level_value(low, *scale), level_value(high, *scale)));
            }
        }
        entries.push(entry);
    }
    Ok(entries)
}

/// The fields of a footer of these segments, of which a reader has none.
pub(crate) fn footer<F: Fields>(fields: &mut F, header: &Header, own: &[Segment]) -> Result<Vec<Segment>, Damage> {
    let count = fields.count(own.len(), usize::MAX, "number of segments")?;
    let (mut segments, mut start) = (Vec::new(), header.length as u64);
    for i in 0..count {
        let own = own.get(i).copied().unwrap_or_default();
        let (blocks, length, rows) = (fields.varint(own.blocks)?, fields.varint(own.length)?, fields.varint(own.rows)?);
        let distance = fields.signed(own.ticks.0.wrapping_sub(header.origin))?;
        let first = header.origin.wrapping_add(distance);
        let span = fields.varint(own.ticks.1.wrapping_sub(own.ticks.0) as u64)?;
        let segment = Segment {
            start,
            blocks,
            length,
            rows,
            ticks: (first, first.wrapping_add(span as i64)),
        };
        start = segment.end();
        segments.push(segment);
    }
    Ok(segments)
}

/// The last bytes of a recording, after its footer.
pub(crate) fn trailer(footer: u64) -> Vec<u8> {
    [&(footer as u32).to_le_bytes()[..], &END].concat()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::wire::written;
    use crate::{Bound, Column, Schema, TimeBase};

    #[test]
    fn ends_are_outside_the_values() {
        let values = [(-3.7, 12.25), (0.1, 0.3), (1e-9, 1e300), (-1e308, 1.6e308), (5.0, 5.0)];
        let entries: Vec<BlockInfo> = values
            .iter()
            .map(|ends| BlockInfo {
                offset: 0,
                bytes: 9,
                rows: 4,
                ticks: (-5, 7),
                ends: vec![Some(*ends), None, Some((0.3, 0.3))],
                aggregates: None,
            })
            .collect();
        let columns = ["a", "b", "c"].map(|name| Column::new(name, Bound::Lossless).unwrap());
        let schema = Schema::new(columns.to_vec(), TimeBase::Numbered).unwrap();
        let schema = schema.with_rows_per_block(512).unwrap();
        let header = Header::new(schema, &[3], vec![0.0; 3]);
        let bytes = written(|fields| segment(fields, &header, 0, &entries));
        let read = read(&bytes, |fields| segment(fields, &header, 0, &[])).unwrap();
        for (entry, (low, high)) in read.iter().zip(values) {
            let (l, h) = entry.ends[0].unwrap();
            assert!(l <= low && h >= high, "{l} {low} {high} {h}");
            let (l, h) = entry.ends[2].unwrap();
            assert!(l <= 0.3 && h >= 0.3 && h - l < 1e-4);
            assert_eq!((entry.ends[1], entry.ticks), (None, (-5, 7)));
        }
    }
}
