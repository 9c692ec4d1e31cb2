//! Headers as bytes.

use crate::bound::Bound;
use crate::column::Column;
use crate::error::{Damage, Error, ensure};
use crate::header::{BLANK, Form, Header, IDENTITY_BYTES, MAGIC, MAGIC_5, MAX_HEADER, VERSION, VERSION_5};
use crate::header_column::{column, refused};
use crate::schema::{MAX_COLUMNS, Schema, TIME_NAME, TimeBase, TimeFormat, default_rows};
use crate::wire::{Bytes, CHECK_BYTES, Fields, checksum, flag, push_varint, with_checksum, written};
use fewbits_block_codec::bytes::Unread;

impl Header {
    /// Reads a header from the front of `bytes`.
    ///
    /// # Errors
    /// If the bytes are no header.
    pub(crate) fn read(bytes: &[u8]) -> Result<Known, Error> {
        match Self::whole(bytes) {
            Err(Error::Header(Damage::CutOff)) => Ok(Known::More),
            found => found,
        }
    }

    fn whole(bytes: &[u8]) -> Result<Known, Error> {
        let known = bytes.len().min(MAGIC.len());
        ensure!(bytes[..known] == MAGIC[..known], Error::NotARecording);
        let mut reader = Bytes(&bytes[known..]);
        let damaged = |unread: Unread| Error::Header(unread.into());
        let layout = match reader.byte().map_err(damaged)? {
            VERSION => Layout::Known,
            first if first == VERSION | SINGLE => return Ok(Known::Single),
            first if first == MAGIC_5[0] => match reader.array().map_err(damaged)? {
                [b'\r', b'\n', VERSION_5] => Layout::Version5,
                [b'\r', b'\n', found] => return Err(unknown(found)),
                _ => return Err(Error::NotARecording),
            },
            found => return Err(unknown(found)),
        };
        let length = reader.count(MAX_HEADER, "length of the header").map_err(damaged)?;
        let (version, identity) = match layout {
            Layout::Version5 => (VERSION_5, [0; IDENTITY_BYTES]),
            _ => (VERSION, reader.array().map_err(damaged)?),
        };
        let mut body = Bytes(reader.take(length).map_err(damaged)?);
        let end = bytes.len() - reader.0.len();
        let check = u32::from_le_bytes(reader.array().map_err(damaged)?);
        ensure!(check == checksum(&[&bytes[..end]]), Error::Header(Damage::Checksum));
        let header = BLANK.body(&mut body, layout);
        let header = header.and_then(|header| Ok(body.finish().map(|()| header)?));
        Ok(Known::Header(Box::new(Self {
            version,
            identity: u32::from_le_bytes(identity),
            length: end + CHECK_BYTES,
            check,
            ..header.map_err(Error::Header)?
        })))
    }

    /// Reads a whole recording of a single block: its header, and the block's content.
    ///
    /// # Errors
    /// If the bytes are not a whole recording of a single block.
    pub(crate) fn read_single(bytes: &[u8]) -> Result<(Self, &[u8]), Error> {
        let (content, check) = bytes
            .split_last_chunk::<CHECK_BYTES>()
            .ok_or(Error::Header(Damage::CutOff))?;
        ensure!(u32::from_le_bytes(*check) == checksum(&[content]), Error::Single);
        // Magic bytes and version.
        let mut body = Bytes(content.get(MAGIC.len() + 1..).ok_or(Error::Header(Damage::CutOff))?);
        let header = BLANK.body(&mut body, Layout::Single).map_err(Error::Header)?;
        Ok((header, body.0))
    }

    /// The encoded header, of this version: magic bytes, version, length, identity, content, checksum. That of a single block has neither length nor
    /// identity nor checksum.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        if let Form::Single(_) = self.form {
            bytes.push(VERSION | SINGLE);
            bytes.extend(written(|body| self.body(body, Layout::Single)));
            return bytes;
        }
        let body = written(|body| self.body(body, Layout::Known));
        bytes.push(VERSION);
        push_varint(&mut bytes, body.len() as u64);
        bytes.extend(self.identity.to_le_bytes());
        bytes.extend(body);
        with_checksum(bytes)
    }

    /// A recording of a single block with this content.
    pub(crate) fn single(&self, content: &[u8]) -> Vec<u8> {
        with_checksum([&self.to_bytes(), content].concat())
    }

    /// The fields between identity and checksum; `self` is [`BLANK`] at the reader.
    fn body<F: Fields>(&self, fields: &mut F, layout: Layout) -> Result<Self, Damage> {
        let own = &self.schema;
        let default = default_rows(own.columns.len());
        let mut told = self.block_rows();
        let mut rows_per_block = Some(own.rows_per_block);
        if layout == Layout::Single {
            // The default needs no telling.
            told = fields.count(2 * told + usize::from(own.rows_per_block != default), usize::MAX, "rows")?;
            rows_per_block = rows_per_block.filter(|_| told & 1 == 1);
        }
        if let Some(rows) = &mut rows_per_block {
            *rows = fields.count(*rows, usize::MAX, "rows per block")?;
        }
        let (format, decimals, tolerance) = match own.time {
            TimeBase::Numbered => (0, 0, 0),
            TimeBase::Clock {
                decimals,
                tolerance,
                format,
            } => (1 + format as u8, decimals, tolerance),
        };
        let flags = flag(self.form == Form::Stream, STREAM)
            | flag(self.origin != 0, ORIGIN)
            | flag(own.columns.len() > 1, COLUMNS)
            | flag(!own.time_name.is_empty(), NAMED);
        let mut kind = fields.byte(format | flags)?;
        let is_old = layout == Layout::Version5;
        if is_old {
            // Version 5 has no flags: origin and columns always follow.
            kind = if kind < STREAM {
                kind | ORIGIN | COLUMNS
            } else {
                STREAM - 1
            };
        }
        let time = match kind & !(STREAM | ORIGIN | COLUMNS | NAMED) {
            0 => TimeBase::Numbered,
            format @ 1..=3 => TimeBase::Clock {
                decimals: fields.byte(decimals)?,
                tolerance: fields.varint(tolerance)?,
                format: [TimeFormat::Seconds, TimeFormat::Utc, TimeFormat::Local][usize::from(format) - 1],
            },
            _ => return Err(Damage::Content("time base")),
        };
        let mut time_name = String::new();
        if kind & NAMED != 0 {
            if time != TimeBase::Numbered {
                time_name = fields.text(&own.time_name)?;
            }
            // What a writer leaves out.
            ensure!(!time_name.is_empty() && time_name != TIME_NAME, Damage::Content("name of the times"));
        }
        let (mut origin, mut step, mut count) = (0, 1, 1);
        if kind & ORIGIN != 0 {
            origin = fields.signed(self.origin)?;
        }
        if is_old || time != TimeBase::Numbered {
            step = fields.signed(self.step)?;
        }
        if kind & COLUMNS != 0 {
            count = fields.count(own.columns.len(), MAX_COLUMNS, "number of columns")?;
        }
        let blank = Column::new("", Bound::Lossless).map_err(refused)?;
        let (mut columns, mut share_bounds, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..count {
            let share_bound = self.share_bounds.get(i).copied().unwrap_or(0.0);
            let start = self.starts.get(i).and_then(Option::as_ref);
            let (column, share_bound, start) =
                column(fields, own.columns.get(i).unwrap_or(&blank), share_bound, start)?;
            columns.push(column);
            share_bounds.push(share_bound);
            starts.push(start);
        }
        let rows_per_block = rows_per_block.unwrap_or(default_rows(columns.len()));
        let schema = Schema::new(columns, time)
            .and_then(|schema| schema.with_exact_rows(rows_per_block)?.with_time_name(time_name))
            .map_err(refused)?;
        let form = match (layout, kind & STREAM) {
            (Layout::Single, 0) if (1..=rows_per_block).contains(&(told / 2)) => Form::Single(told / 2),
            (Layout::Single, 0) => return Err(Damage::Content("number of rows")),
            (Layout::Single, _) => return Err(Damage::Content("time base")),
            (_, 0) => Form::File,
            _ => Form::Stream,
        };
        Ok(Self {
            form,
            schema,
            origin,
            step,
            share_bounds,
            starts,
            ..BLANK
        })
    }
}

/// Which fields a body has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    Known,
    /// The block follows it.
    Single,
    /// As known, with the step of numbered rows.
    Version5,
}

/// Flags beside the time base: blocks over a link, which have no end; an origin follows; a number of columns follows (else one); the name of the
/// times follows (else `time`).
const STREAM: u8 = 0x10;
const ORIGIN: u8 = 0x20;
const COLUMNS: u8 = 0x40;
const NAMED: u8 = 0x80;
/// Flag beside the version: the only block follows.
const SINGLE: u8 = 0x80;

/// What the first bytes of a recording are.
pub(crate) enum Known {
    /// A header.
    Header(Box<Header>),
    /// The beginning of a recording of a single block.
    Single,
    /// Too few bytes.
    More,
}

fn unknown(found: u8) -> Error {
    Error::Version {
        found,
        supported: VERSION,
    }
}
