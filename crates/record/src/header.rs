//! The header: everything that is needed to decode any block of a recording.

use crate::bound::{Bound, TENS};
use crate::codec::{Target, adaptive};
use crate::error::{Damage, Error};
use crate::schema::{Column, Schema, TimeBase, TimeFormat};
use crate::time::Grid;
use crate::wire::{Bytes, CHECK_BYTES, checksum, push_text, push_varint, zigzag};
use fewbits_adaptive::Start;

/// The first bytes of a recording. As in PNG, a byte above 127 and a line end reveal a conversion as text.
const MAGIC: [u8; 7] = *b"\x8bfewb\r\n";
/// Version of the format.
pub(crate) const VERSION: u8 = 5;
/// Largest length of a header in bytes: 4096 columns with names and units.
pub(crate) const MAX_HEADER: usize = 1 << 24;

/// Largest length of the start of a column in bytes.
pub(crate) const MAX_START: usize = 32;

/// The decoded header.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    pub(crate) schema: Schema,
    pub(crate) origin: i64,
    pub(crate) step: i64,
    /// For columns with a share: the bound of blocks that do not state their own; 0 means lossless.
    pub(crate) share_bounds: Vec<f64>,
    /// The start of each column, for blocks that do not state their own bound.
    starts: Vec<Option<Start>>,
    /// The header's checksum. The checksums of all blocks include it, so a block of another recording is refused.
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
        let header = Self {
            starts: vec![None; schema.columns.len()],
            schema,
            origin: grid.origin,
            step: grid.step,
            share_bounds: share_bounds.into_iter().map(rounded_down).collect(),
            check: 0,
        };
        header.checked()
    }

    /// The same header with starts for columns like these.
    pub(crate) fn with_starts(mut self, columns: &[Vec<Option<f64>>]) -> Self {
        let start = |(column, cells): (usize, &Vec<Option<f64>>)| {
            let finite: Vec<f64> = cells.iter().flatten().copied().filter(|x| x.is_finite()).collect();
            let start = adaptive::start(&finite, &self.target(column, None))?;
            (start.to_bytes().len() <= MAX_START).then_some(start)
        };
        self.starts = columns.iter().enumerate().map(start).collect();
        self.checked()
    }

    fn checked(mut self) -> Self {
        let bytes = self.to_bytes();
        self.check = bytes.last_chunk::<4>().map_or(0, |check| u32::from_le_bytes(*check));
        self
    }

    /// The start of a column for a block. A block with a bound of its own has another grid and no start.
    pub(crate) fn start(&self, column: usize, own: Option<f64>) -> Option<Start> {
        self.starts[column].filter(|_| own.is_none())
    }

    pub(crate) fn has_starts(&self) -> bool {
        self.starts.iter().any(Option::is_some)
    }

    pub(crate) fn grid(&self) -> Grid {
        Grid {
            origin: self.origin,
            step: self.step,
            rows_per_block: self.schema.rows_per_block,
            tolerance: self.schema.time.tolerance(),
        }
    }

    /// The bound of a column in a block; `own` is the block's own one.
    pub(crate) fn target(&self, column: usize, own: Option<f64>) -> Target {
        let spec = &self.schema.columns[column];
        Target {
            promise: spec.promise(own.unwrap_or(self.share_bounds[column])),
            period: spec.period,
        }
    }

    /// The encoded header: magic bytes, version, length, content, checksum.
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
                    TimeFormat::Local => 3,
                });
                body.push(decimals);
                push_varint(&mut body, tolerance);
            }
        }
        push_varint(&mut body, zigzag(self.origin));
        push_varint(&mut body, zigzag(self.step));
        push_varint(&mut body, self.schema.columns.len() as u64);
        let columns = self.schema.columns.iter().zip(&self.share_bounds).zip(&self.starts);
        for ((column, share_bound), start) in columns {
            push_column(&mut body, column, *share_bound, start.as_ref());
        }
        let mut bytes = MAGIC.to_vec();
        bytes.push(VERSION);
        push_varint(&mut bytes, body.len() as u64);
        bytes.extend(body);
        let check = checksum(&[&bytes]);
        bytes.extend(check.to_le_bytes());
        bytes
    }

    /// Reads a header from the front of `bytes`. Returns it with its length; `None` if more bytes are needed.
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
            3 => Some(TimeFormat::Local),
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
        let (mut columns, mut share_bounds, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..count {
            let (column, share_bound, start) = read_column(&mut body)?;
            columns.push(column);
            share_bounds.push(share_bound);
            starts.push(start);
        }
        body.finish().map_err(damaged)?;
        Ok(Self {
            schema: Schema::new(columns, time)?.with_rows_per_block(rows)?,
            origin,
            step,
            share_bounds,
            starts,
            check,
        })
    }
}

/// The largest double with 12 bits of mantissa that does not exceed `bound`; it is stored in three bytes.
pub(crate) fn rounded_down(bound: f64) -> f64 {
    f64::from_bits(bound.to_bits() & !0xff_ffff_ffff)
}

/// Flags beside the kind of a bound: a period follows, a start follows, a unit follows.
const HAS_PERIOD: u8 = 0x10;
const HAS_START: u8 = 0x20;
const HAS_UNIT: u8 = 0x40;
/// Stored in place of the number of decimals: the double itself follows.
const DOUBLE: u8 = 0xff;

/// Appends a non-negative number: decimals and digits if these are exact, otherwise its bits.
fn push_number(body: &mut Vec<u8>, number: f64) {
    let digits = (0_u8..).zip(TENS).find_map(|(decimals, ten)| {
        let digits = (number * ten).round();
        // Such digits take at most 6 bytes, the double itself 8.
        (digits < 2f64.powi(42) && digits / ten == number).then_some((decimals, digits as u64))
    });
    match digits {
        Some((decimals, digits)) => {
            body.push(decimals);
            push_varint(body, digits);
        }
        None => {
            body.push(DOUBLE);
            body.extend(number.to_le_bytes());
        }
    }
}

fn read_number(body: &mut Bytes<'_>) -> Result<f64, Damage> {
    match body.byte()? {
        DOUBLE => body.f64(),
        decimals => {
            let ten = TENS
                .get(usize::from(decimals))
                .ok_or(Damage::Content("decimals of a number"))?;
            Ok(body.varint()? as f64 / ten)
        }
    }
}

fn push_column(body: &mut Vec<u8>, column: &Column, share_bound: f64, start: Option<&Start>) {
    push_text(body, &column.name);
    let flag = |given: bool, flag: u8| if given { flag } else { 0 };
    let flags = flag(column.period.is_some(), HAS_PERIOD)
        | flag(start.is_some(), HAS_START)
        | flag(!column.unit.is_empty(), HAS_UNIT);
    match column.bound {
        Bound::Lossless => body.push(flags),
        Bound::Absolute(delta) => {
            body.push(1 | flags);
            push_number(body, delta);
        }
        Bound::ShareOfRange(share) => {
            body.push(2 | flags);
            push_number(body, share);
            body.extend_from_slice(&share_bound.to_be_bytes()[..3]);
        }
        Bound::Decimals(places) => {
            body.push(3 | flags);
            body.push(places);
        }
    }
    if !column.unit.is_empty() {
        push_text(body, &column.unit);
    }
    if let Some(period) = column.period {
        push_number(body, period);
    }
    if let Some(start) = start {
        body.extend(start.to_bytes());
    }
}

fn read_column(body: &mut Bytes<'_>) -> Result<(Column, f64, Option<Start>), Error> {
    let damaged = Error::Header;
    let name = body.text().map_err(damaged)?;
    let kind = body.byte().map_err(damaged)?;
    let mut share_bound = 0.0;
    let bound = match kind & !(HAS_PERIOD | HAS_START | HAS_UNIT) {
        0 => Bound::Lossless,
        1 => Bound::Absolute(read_number(body).map_err(damaged)?),
        2 => {
            let share = read_number(body).map_err(damaged)?;
            let [a, b, c] = body.array().map_err(damaged)?;
            share_bound = f64::from_be_bytes([a, b, c, 0, 0, 0, 0, 0]);
            if !(share_bound >= 0.0 && (2.0 * share_bound).is_finite()) {
                return Err(damaged(Damage::Content("bound of a share")));
            }
            Bound::ShareOfRange(share)
        }
        3 => Bound::Decimals(body.byte().map_err(damaged)?),
        _ => return Err(damaged(Damage::Content("bound"))),
    };
    let mut column = Column::new(name, bound)?;
    if kind & HAS_UNIT != 0 {
        column = column.with_unit(body.text().map_err(damaged)?)?;
    }
    if kind & HAS_PERIOD != 0 {
        column = column.with_period(read_number(body).map_err(damaged)?)?;
    }
    let mut start = None;
    if kind & HAS_START != 0 {
        let target = Target {
            promise: column.promise(share_bound),
            period: column.period,
        };
        start = Some(adaptive::read_start(&mut body.0, &target).map_err(damaged)?);
    }
    Ok((column, share_bound, start))
}
