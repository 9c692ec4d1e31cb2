//! The header: what every block of a recording is decoded with.

use crate::bound::Bound;
use crate::codec::Target;
use crate::error::{Damage, Error};
use crate::schema::{Column, Schema, TimeBase, TimeFormat};
use crate::time::Grid;
use crate::wire::{Bytes, CHECK_BYTES, checksum, push_text, push_varint, zigzag};

/// The first bytes. Like PNG's they contain a byte above 127 and a line end, so that text transfers are noticed.
const MAGIC: [u8; 7] = *b"\x8bfewb\r\n";
/// The version of the format.
pub(crate) const VERSION: u8 = 1;
/// No header is longer: 4096 columns with names and units.
pub(crate) const MAX_HEADER: usize = 1 << 24;

/// The header as it is used.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    pub(crate) schema: Schema,
    pub(crate) origin: i64,
    pub(crate) step: i64,
    /// For columns with a share: the bound of blocks that have none of their own; 0 means lossless.
    pub(crate) share_bounds: Vec<f64>,
    /// The header's checksum. The checksums of all blocks begin with it, so a block of another recording is refused.
    pub(crate) check: u32,
}

impl Header {
    /// The header of a recording whose first rows are known.
    pub(crate) fn new(schema: Schema, ticks: &[i64], share_bounds: Vec<f64>) -> Self {
        let grid = match schema.time {
            TimeBase::Numbered => Grid {
                origin: ticks.first().copied().unwrap_or(0),
                step: 1,
                rows_per_block: schema.rows_per_block,
                tolerance: 0,
            },
            TimeBase::Clock { tolerance, .. } => Grid::of(ticks, schema.rows_per_block, tolerance),
        };
        let mut header = Self {
            schema,
            origin: grid.origin,
            step: grid.step,
            share_bounds,
            check: 0,
        };
        let bytes = header.to_bytes();
        header.check = bytes.last_chunk::<4>().map_or(0, |check| u32::from_le_bytes(*check));
        header
    }

    pub(crate) fn grid(&self) -> Grid {
        Grid {
            origin: self.origin,
            step: self.step,
            rows_per_block: self.schema.rows_per_block,
            tolerance: self.schema.time.tolerance(),
        }
    }

    /// The promise of a column in a block, whose own bound counts if it has one.
    pub(crate) fn target(&self, column: usize, own: Option<f64>) -> Target {
        let spec = &self.schema.columns[column];
        Target {
            promise: spec.promise(own.unwrap_or(self.share_bounds[column])),
            period: spec.period,
        }
    }

    /// Magic, version, length, content, checksum.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut body = Vec::new();
        push_varint(&mut body, self.schema.rows_per_block as u64);
        match self.schema.time {
            TimeBase::Numbered => body.push(0),
            TimeBase::Clock {
                decimals,
                tolerance,
                format,
            } => {
                body.push(match format {
                    TimeFormat::Seconds => 1,
                    TimeFormat::Utc => 2,
                });
                body.push(decimals);
                push_varint(&mut body, tolerance);
            }
        }
        push_varint(&mut body, zigzag(self.origin));
        push_varint(&mut body, zigzag(self.step));
        push_varint(&mut body, self.schema.columns.len() as u64);
        for (column, share_bound) in self.schema.columns.iter().zip(&self.share_bounds) {
            push_column(&mut body, column, *share_bound);
        }
        let mut bytes = MAGIC.to_vec();
        bytes.push(VERSION);
        push_varint(&mut bytes, body.len() as u64);
        bytes.extend(body);
        let check = checksum(&[&bytes]);
        bytes.extend(check.to_le_bytes());
        bytes
    }

    /// Reads a header from the front; `None` if more bytes are needed. Returns its length too.
    pub(crate) fn read(bytes: &[u8]) -> Result<Option<(Self, usize)>, Error> {
        let known = bytes.len().min(MAGIC.len());
        if bytes[..known] != MAGIC[..known] {
            return Err(Error::NotARecording);
        }
        let mut reader = Bytes(&bytes[known..]);
        let Ok(found) = reader.byte() else { return Ok(None) };
        if found != VERSION {
            return Err(Error::Version {
                found,
                supported: VERSION,
            });
        }
        let length = match reader.count(MAX_HEADER, "length of the header") {
            Ok(length) => length,
            Err(Damage::CutOff) => return Ok(None),
            Err(damage) => return Err(Error::Header(damage)),
        };
        let Ok(body) = reader.take(length) else { return Ok(None) };
        let end = bytes.len() - reader.0.len();
        let Ok(check) = reader.array::<CHECK_BYTES>().map(u32::from_le_bytes) else {
            return Ok(None);
        };
        if check != checksum(&[&bytes[..end]]) {
            return Err(Error::Header(Damage::Checksum));
        }
        let header = Self::read_body(Bytes(body), check)?;
        Ok(Some((header, end + CHECK_BYTES)))
    }

    fn read_body(mut body: Bytes<'_>, check: u32) -> Result<Self, Error> {
        let damaged = Error::Header;
        let rows = body.count(usize::MAX, "rows per block").map_err(damaged)?;
        let format = match body.byte().map_err(damaged)? {
            0 => None,
            1 => Some(TimeFormat::Seconds),
            2 => Some(TimeFormat::Utc),
            _ => return Err(damaged(Damage::Content("time base"))),
        };
        let time = match format {
            None => TimeBase::Numbered,
            Some(format) => TimeBase::Clock {
                decimals: body.byte().map_err(damaged)?,
                tolerance: body.varint().map_err(damaged)?,
                format,
            },
        };
        let origin = body.signed().map_err(damaged)?;
        let step = body.signed().map_err(damaged)?;
        let count = body.count(body.0.len(), "number of columns").map_err(damaged)?;
        let (mut columns, mut share_bounds) = (Vec::new(), Vec::new());
        for _ in 0..count {
            let (column, share_bound) = read_column(&mut body)?;
            columns.push(column);
            share_bounds.push(share_bound);
        }
        body.finish().map_err(damaged)?;
        Ok(Self {
            schema: Schema::new(columns, time)?.with_rows_per_block(rows)?,
            origin,
            step,
            share_bounds,
            check,
        })
    }
}

/// Flag beside the kind of a bound: a period follows.
const HAS_PERIOD: u8 = 0x10;

fn push_column(body: &mut Vec<u8>, column: &Column, share_bound: f64) {
    push_text(body, &column.name);
    push_text(body, &column.unit);
    let flag = if column.period.is_some() { HAS_PERIOD } else { 0 };
    match column.bound {
        Bound::Lossless => body.push(flag),
        Bound::Absolute(delta) => {
            body.push(1 | flag);
            body.extend(delta.to_le_bytes());
        }
        Bound::ShareOfRange(share) => {
            body.push(2 | flag);
            body.extend(share.to_le_bytes());
            body.extend(share_bound.to_le_bytes());
        }
        Bound::Decimals(places) => {
            body.push(3 | flag);
            body.push(places);
        }
    }
    if let Some(period) = column.period {
        body.extend(period.to_le_bytes());
    }
}

fn read_column(body: &mut Bytes<'_>) -> Result<(Column, f64), Error> {
    let damaged = Error::Header;
    let name = body.text().map_err(damaged)?;
    let unit = body.text().map_err(damaged)?;
    let kind = body.byte().map_err(damaged)?;
    let mut share_bound = 0.0;
    let bound = match kind & !HAS_PERIOD {
        0 => Bound::Lossless,
        1 => Bound::Absolute(body.f64().map_err(damaged)?),
        2 => {
            let share = body.f64().map_err(damaged)?;
            share_bound = body.f64().map_err(damaged)?;
            if !(share_bound >= 0.0 && (2.0 * share_bound).is_finite()) {
                return Err(damaged(Damage::Content("bound of a share")));
            }
            Bound::ShareOfRange(share)
        }
        3 => Bound::Decimals(body.byte().map_err(damaged)?),
        _ => return Err(damaged(Damage::Content("bound"))),
    };
    let mut column = Column::new(name, bound)?.with_unit(unit)?;
    if kind & HAS_PERIOD != 0 {
        column = column.with_period(body.f64().map_err(damaged)?)?;
    }
    Ok((column, share_bound))
}
