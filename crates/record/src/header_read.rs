//! Reading of headers.

use crate::error::{Damage, Error};
use crate::header::{
    COLUMNS, Form, Header, IDENTITY_BYTES, MAGIC, MAGIC_5, MAX_HEADER, NAMED, ORIGIN, SINGLE, STREAM, VERSION,
    VERSION_5,
};
use crate::header_column::read_column;
use crate::schema::{Schema, TIME_NAME, TimeBase, TimeFormat, default_rows};
use crate::wire::{Bytes, CHECK_BYTES, checksum, text};
use fewbits_block_codec::bytes::Unread;
use std::ops::Range;

impl Header {
    /// Reads a header from the front of `bytes`.
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
            first if first == VERSION | SINGLE => return Ok(Known::Single),
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
        body.finish().map_err(Error::header)?;
        (header.version, header.identity) = (version, u32::from_le_bytes(identity));
        header.length = end + CHECK_BYTES;
        // Streams of version 5 are not marked.
        Ok(Known::Header(Box::new(header)))
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
        // Magic bytes and version.
        let mut body = Bytes(content.get(MAGIC.len() + 1..).ok_or(Error::Header(Damage::CutOff))?);
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

    fn read_body(body: &mut Bytes<'_>, length: Length, check: u32) -> Result<Self, Error> {
        let mut rows = body.count(usize::MAX, "rows per block").map_err(Error::header)?;
        let mut rows_per_block = Some(rows);
        if length == Length::Single {
            let own = rows & 1 == 1;
            rows_per_block = own
                .then(|| body.count(usize::MAX, "rows per block"))
                .transpose()
                .map_err(Error::header)?;
            rows /= 2;
        }
        let kind = body.byte().map_err(Error::header)?;
        let form = if kind & STREAM == 0 || length == Length::Version5 {
            Form::File
        } else {
            Form::Stream
        };
        let is_old = length == Length::Version5;
        let flags = if is_old { 0 } else { STREAM | ORIGIN | COLUMNS | NAMED };
        let follows = |flag: u8| is_old || kind & flag != 0;
        let format = match kind & !flags {
            0 => None,
            1 => Some(TimeFormat::Seconds),
            2 => Some(TimeFormat::Utc),
            3 => Some(TimeFormat::Local),
            _ => return Err(Error::Header(Damage::Content("time base"))),
        };
        let time = match format {
            None => TimeBase::Numbered,
            Some(format) => TimeBase::Clock {
                decimals: body.byte().map_err(Error::header)?,
                tolerance: body.varint().map_err(Error::header)?,
                format,
            },
        };
        let is_named = !is_old && kind & NAMED != 0;
        let time_name = match (is_named, time) {
            (false, _) => "",
            (true, TimeBase::Numbered) => return Err(Error::Header(Damage::Content("name of the times"))),
            (true, _) => match text(body).map_err(Error::header)? {
                // What a writer leaves out.
                "" | TIME_NAME => return Err(Error::Header(Damage::Content("name of the times"))),
                name => name,
            },
        };
        let origin = if follows(ORIGIN) {
            body.signed().map_err(Error::header)?
        } else {
            0
        };
        let step = match time {
            TimeBase::Numbered if !is_old => 1,
            _ => body.signed().map_err(Error::header)?,
        };
        let count = if follows(COLUMNS) {
            body.count(body.0.len(), "number of columns").map_err(Error::header)?
        } else {
            1
        };
        let (mut columns, mut share_bounds, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..count {
            let (column, share_bound, start) = read_column(body)?;
            columns.push(column);
            share_bounds.push(share_bound);
            starts.push(start);
        }
        let rows_per_block = rows_per_block.unwrap_or(default_rows(columns.len()));
        let schema = Schema::new(columns, time)?
            .with_exact_rows(rows_per_block)?
            .with_time_name(time_name)?;
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
            length: 0,
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
    /// A header.
    Header(Box<Header>),
    /// The beginning of a recording of a single block.
    Single,
    /// Too few bytes.
    More,
}

fn version_error(found: u8) -> Error {
    Error::Version {
        found,
        supported: VERSION,
    }
}
