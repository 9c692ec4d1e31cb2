//! The header: everything that is needed to decode any block of a recording.

use crate::bound::{Bound, TENS};
use crate::codec::{Target, adaptive};
use crate::error::{Damage, Error};
use crate::schema::{Column, Schema, TimeBase, TimeFormat, default_rows};
use crate::time::Grid;
use crate::wire::{Bytes, CHECK_BYTES, checksum, push_text, push_varint, text, zigzag};
use fewbits_block_codec::Start;
use fewbits_block_codec::bytes::Unread;
use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::ops::Range;
use std::time::{SystemTime, UNIX_EPOCH};

/// The first bytes of a recording: a byte above 127 reveals a conversion as text.
const MAGIC: [u8; 4] = *b"\x8bfew";
/// What followed the first bytes in version 5.
const MAGIC_5: [u8; 4] = *b"b\r\n\x05";
/// Version of the format.
pub(crate) const VERSION: u8 = 6;
pub(crate) const VERSION_5: u8 = 5;
/// Bytes of a recording's identity.
const IDENTITY_BYTES: usize = 4;

/// How the blocks follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// The only block follows the header, up to a checksum of the whole recording.
    Single,
    /// Blocks, segments of the index, and an end.
    File,
    /// Blocks over a link. There is no end.
    Stream,
}
/// Largest length of a header in bytes: 4096 columns with names and units.
pub(crate) const MAX_HEADER: usize = 1 << 24;

/// Largest length of the start of a column in bytes.
pub(crate) const MAX_START: usize = 32;

/// The decoded header.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    pub(crate) version: u8,
    pub(crate) form: Form,
    /// Random: the headers of two recordings differ even if their columns are the same. Zero in version 5.
    identity: u32,
    /// Number of rows of the only block.
    only: Option<usize>,
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
            version: VERSION,
            form: Form::File,
            identity: random(),
            only: None,
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

    /// The same header for blocks that follow in another form.
    pub(crate) fn with_form(self, form: Form) -> Self {
        let only = self.only.filter(|_| form == Form::Single);
        Self { form, only, ..self }.checked()
    }

    /// The same header for a recording of a single block of so many rows.
    pub(crate) fn of_single(self, rows: usize) -> Self {
        let only = Some(rows);
        Self { only, ..self }.with_form(Form::Single)
    }

    /// Number of rows of a block that does not state it.
    pub(crate) fn block_rows(&self) -> usize {
        self.only.unwrap_or(self.schema.rows_per_block)
    }

    /// Number of rows of the only block, if a block elsewhere must state it.
    pub(crate) fn odd_rows(&self) -> Option<usize> {
        self.only.filter(|rows| *rows != self.schema.rows_per_block)
    }

    /// The header of a recording of this version with the same columns.
    pub(crate) fn renewed(self) -> Self {
        Self {
            version: VERSION,
            identity: random(),
            ..self
        }
        .checked()
    }

    /// Whether the index of a finished recording must follow.
    pub(crate) fn has_end(&self) -> bool {
        self.form == Form::File
    }

    fn checked(mut self) -> Self {
        let bytes = self.to_bytes();
        self.check = match self.form {
            Form::Single => 0,
            _ => bytes.last_chunk::<4>().map_or(0, |check| u32::from_le_bytes(*check)),
        };
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

    /// The encoded header: magic bytes, version, length, identity, content, checksum. That of a single block has neither length nor
    /// identity nor checksum.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let body = self.body();
        let mut bytes = MAGIC.to_vec();
        match (self.version, self.form) {
            (VERSION_5, _) => {
                bytes.extend(MAGIC_5);
                push_varint(&mut bytes, body.len() as u64);
            }
            (_, Form::Single) => {
                bytes.extend([VERSION, 0]);
                bytes.extend(body);
                return bytes;
            }
            _ => {
                bytes.push(VERSION);
                push_varint(&mut bytes, body.len() as u64);
                bytes.extend(self.identity.to_le_bytes());
            }
        }
        bytes.extend(body);
        let check = checksum(&[&bytes]);
        bytes.extend(check.to_le_bytes());
        bytes
    }

    fn body(&self) -> Vec<u8> {
        let mut body = Vec::new();
        let rows_per_block = self.schema.rows_per_block;
        match self.only {
            Some(rows) => {
                // The default needs no telling.
                let own = rows_per_block != default_rows(self.schema.columns.len());
                push_varint(&mut body, 2 * rows as u64 + u64::from(own));
                if own {
                    push_varint(&mut body, rows_per_block as u64);
                }
            }
            None => push_varint(&mut body, rows_per_block as u64),
        }
        let stream = if self.form == Form::Stream { STREAM } else { 0 };
        match self.schema.time {
            TimeBase::Numbered => body.push(stream),
            TimeBase::Clock {
                decimals,
                tolerance,
                format,
            } => {
                body.push(match format {
                    TimeFormat::Seconds => 1 | stream,
                    TimeFormat::Utc => 2 | stream,
                });
                body.push(decimals);
                push_varint(&mut body, tolerance);
            }
        }
        push_varint(&mut body, zigzag(self.origin));
        if self.version == VERSION_5 || self.schema.time != TimeBase::Numbered {
            push_varint(&mut body, zigzag(self.step));
        }
        push_varint(&mut body, self.schema.columns.len() as u64);
        let columns = self.schema.columns.iter().zip(&self.share_bounds).zip(&self.starts);
        for ((column, share_bound), start) in columns {
            push_column(&mut body, column, *share_bound, start.as_ref());
        }
        body
    }

    /// Reads a header from the front of `bytes`, with its length.
    ///
    /// # Errors
    /// If the bytes are no header.
    pub(crate) fn read(bytes: &[u8]) -> Result<Known, Error> {
        let known = bytes.len().min(MAGIC.len());
        if bytes[..known] != MAGIC[..known] {
            return Err(Error::NotARecording);
        }
        let mut reader = Bytes(&bytes[known..]);
        let Ok(version) = reader.byte() else {
            return Ok(Known::More);
        };
        let version = match version {
            VERSION => VERSION,
            first if first == MAGIC_5[0] => {
                let Ok(rest) = reader.array::<3>() else {
                    return Ok(Known::More);
                };
                match rest {
                    [b'\r', b'\n', VERSION_5] => VERSION_5,
                    [b'\r', b'\n', found] => return Err(version_error(found)),
                    _ => return Err(Error::NotARecording),
                }
            }
            found => return Err(version_error(found)),
        };
        let length = match reader.count(MAX_HEADER, "length of the header") {
            Ok(0) if version == VERSION => return Ok(Known::Single),
            Ok(length) => length,
            Err(Unread::CutOff) => return Ok(Known::More),
            Err(unread) => return Err(Error::Header(unread.into())),
        };
        let mut identity = [0; IDENTITY_BYTES];
        if version == VERSION {
            let Ok(found) = reader.array() else {
                return Ok(Known::More);
            };
            identity = found;
        }
        let Ok(body) = reader.take(length) else {
            return Ok(Known::More);
        };
        let end = bytes.len() - reader.0.len();
        let Ok(check) = reader.array::<CHECK_BYTES>().map(u32::from_le_bytes) else {
            return Ok(Known::More);
        };
        if check != checksum(&[&bytes[..end]]) {
            return Err(Error::Header(Damage::Checksum));
        }
        let mut body = Bytes(body);
        let length = if version == VERSION {
            Length::Known
        } else {
            Length::Version5
        };
        let mut header = Self::read_body(&mut body, length, check)?;
        body.finish().map_err(damaged)?;
        (header.version, header.identity) = (version, u32::from_le_bytes(identity));
        if version == VERSION_5 && header.form == Form::Stream {
            return Err(Error::Header(Damage::Content("time base")));
        }
        // Streams of version 5 are not marked.
        Ok(Known::Header(Box::new(header), end + CHECK_BYTES))
    }

    /// Reads a whole recording of a single block: its header, and where the block's content stands.
    ///
    /// # Errors
    /// If the bytes are not a whole recording of a single block.
    pub(crate) fn read_single(bytes: &[u8]) -> Result<(Self, Range<usize>), Error> {
        let (content, check) = bytes
            .split_last_chunk::<CHECK_BYTES>()
            .ok_or(Error::Header(Damage::CutOff))?;
        if u32::from_le_bytes(*check) != checksum(&[content]) {
            return Err(Error::Header(Damage::Checksum));
        }
        // Magic bytes, version, and a length of zero.
        let mut body = Bytes(content.get(MAGIC.len() + 2..).ok_or(Error::Header(Damage::CutOff))?);
        let header = Self::read_body(&mut body, Length::Single, 0)?;
        if header.form == Form::Stream {
            return Err(Error::Header(Damage::Content("time base")));
        }
        let start = content.len() - body.0.len();
        let header = Self {
            form: Form::Single,
            ..header
        };
        Ok((header, start..content.len()))
    }

    /// A recording of a single block with this content.
    pub(crate) fn single(&self, content: &[u8]) -> Vec<u8> {
        let mut bytes = self.to_bytes();
        bytes.extend_from_slice(content);
        let check = checksum(&[&bytes]);
        bytes.extend(check.to_le_bytes());
        bytes
    }

    fn read_body(body: &mut Bytes<'_>, length: Length, check: u32) -> Result<Self, Error> {
        let mut rows = body.count(usize::MAX, "rows per block").map_err(damaged)?;
        let mut rows_per_block = Some(rows);
        if length == Length::Single {
            let own = rows & 1 == 1;
            rows_per_block = own
                .then(|| body.count(usize::MAX, "rows per block"))
                .transpose()
                .map_err(damaged)?;
            rows /= 2;
        }
        let kind = body.byte().map_err(damaged)?;
        let form = if kind & STREAM == 0 { Form::File } else { Form::Stream };
        let format = match kind & !STREAM {
            0 => None,
            1 => Some(TimeFormat::Seconds),
            2 => Some(TimeFormat::Utc),
            _ => return Err(Error::Header(Damage::Content("time base"))),
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
        let step = match time {
            TimeBase::Numbered if length != Length::Version5 => 1,
            _ => body.signed().map_err(damaged)?,
        };
        let count = body.count(body.0.len(), "number of columns").map_err(damaged)?;
        let (mut columns, mut share_bounds, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..count {
            let (column, share_bound, start) = read_column(body)?;
            columns.push(column);
            share_bounds.push(share_bound);
            starts.push(start);
        }
        let rows_per_block = rows_per_block.unwrap_or(default_rows(columns.len()));
        let schema = Schema::new(columns, time)?.with_exact_rows(rows_per_block)?;
        if length == Length::Single && !(1..=rows_per_block).contains(&rows) {
            return Err(Error::Header(Damage::Content("number of rows")));
        }
        Ok(Self {
            version: VERSION,
            form,
            identity: 0,
            only: (length == Length::Single).then_some(rows),
            schema,
            origin,
            step,
            share_bounds,
            starts,
            check,
        })
    }
}

/// What is known of a body before it is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Length {
    Known,
    /// The block follows it.
    Single,
    /// As known, with the step of numbered rows.
    Version5,
}

/// What the first bytes of a recording are.
pub(crate) enum Known {
    /// A header, with its length.
    Header(Box<Header>, usize),
    /// The beginning of a recording of a single block.
    Single,
    /// Too few bytes.
    More,
}

fn damaged(damage: impl Into<Damage>) -> Error {
    Error::Header(damage.into())
}

fn version_error(found: u8) -> Error {
    Error::Version {
        found,
        supported: VERSION,
    }
}

/// Random bits from the standard library's keys for hash tables, which differ from call to call and from process to process.
fn random() -> u32 {
    let mut hasher = RandomState::new().build_hasher();
    hasher.write_u128(
        SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |time| time.as_nanos()),
    );
    hasher.finish() as u32
}

/// The largest double with 12 bits of mantissa that does not exceed `bound`; it is stored in three bytes.
pub(crate) fn rounded_down(bound: f64) -> f64 {
    f64::from_bits(bound.to_bits() & !0xff_ffff_ffff)
}

/// Flag beside the time base: blocks over a link, which have no end.
const STREAM: u8 = 0x10;
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
        DOUBLE => Ok(body.f64()?),
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
    let name = text(body).map_err(damaged)?;
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
                return Err(Error::Header(Damage::Content("bound of a share")));
            }
            Bound::ShareOfRange(share)
        }
        3 => Bound::Decimals(body.byte().map_err(damaged)?),
        _ => return Err(Error::Header(Damage::Content("bound"))),
    };
    let mut column = Column::new(name, bound)?;
    if kind & HAS_UNIT != 0 {
        column = column.with_unit(text(body).map_err(damaged)?)?;
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
