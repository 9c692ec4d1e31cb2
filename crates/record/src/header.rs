//! The header: everything that is needed to decode any block of a recording.

use crate::bound::Bound;
use crate::codec::{Target, adaptive};
use crate::header_column::{push_column, shortened};
use crate::schema::{Schema, TimeBase, TimeFormat, default_rows};
use crate::time::Grid;
pub(crate) use crate::wire::VERSION_5;
use crate::wire::{checksum, push_text, push_varint, zigzag};
use fewbits_block_codec::Start;
use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::time::{SystemTime, UNIX_EPOCH};

/// The first bytes of a recording: a byte above 127 reveals a conversion as text.
pub(crate) const MAGIC: [u8; 4] = *b"\x8bfew";
/// What followed the first bytes in version 5.
pub(crate) const MAGIC_5: [u8; 4] = *b"b\r\n\x05";
/// Version of the format.
pub(crate) const VERSION: u8 = 6;
/// Bytes of a recording's identity.
pub(crate) const IDENTITY_BYTES: usize = 4;

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
    pub(crate) identity: u32,
    /// Number of rows of the only block.
    pub(crate) only: Option<usize>,
    pub(crate) schema: Schema,
    pub(crate) origin: i64,
    pub(crate) step: i64,
    /// For columns with a share: the bound of blocks that do not state their own; 0 means lossless.
    pub(crate) share_bounds: Vec<f64>,
    /// The start of each column, for blocks that do not state their own bound.
    pub(crate) starts: Vec<Option<Start>>,
    /// Its length in bytes.
    pub(crate) length: usize,
    /// The header's checksum. The checksums of all blocks include it, so a block of another recording is refused.
    pub(crate) check: u32,
}

impl Header {
    /// The header of a recording whose first rows are known.
    pub(crate) fn new(mut schema: Schema, ticks: &[i64], share_bounds: Vec<f64>) -> Self {
        for column in &mut schema.columns {
            if let Bound::Absolute(delta) = &mut column.bound {
                *delta = shortened(*delta);
            }
        }
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
            length: 0,
            check: 0,
        };
        header.checked()
    }

    /// The same header for a recording of this identity.
    pub(crate) fn with_identity(self, identity: u32) -> Self {
        Self { identity, ..self }.checked()
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
        self.length = bytes.len();
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
            tolerance: if self.schema.keeps_ticks {
                0
            } else {
                self.schema.time.tolerance()
            },
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

    /// The encoded header, of this version: magic bytes, version, length, identity, content, checksum. That of a single block has neither length nor
    /// identity nor checksum.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let body = self.body();
        let mut bytes = MAGIC.to_vec();
        if self.form == Form::Single {
            bytes.push(VERSION | SINGLE);
            bytes.extend(body);
            return bytes;
        }
        bytes.push(VERSION);
        push_varint(&mut bytes, body.len() as u64);
        bytes.extend(self.identity.to_le_bytes());
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
        let flag = |given: bool, flag: u8| if given { flag } else { 0 };
        let count = self.schema.columns.len();
        let flags = flag(self.form == Form::Stream, STREAM)
            | flag(self.origin != 0, ORIGIN)
            | flag(count > 1, COLUMNS)
            | flag(!self.schema.time_name.is_empty(), NAMED);
        match self.schema.time {
            TimeBase::Numbered => body.push(flags),
            TimeBase::Clock {
                decimals,
                tolerance,
                format,
            } => {
                body.push(match format {
                    TimeFormat::Seconds => 1 | flags,
                    TimeFormat::Utc => 2 | flags,
                    TimeFormat::Local => 3 | flags,
                });
                body.push(decimals);
                push_varint(&mut body, tolerance);
                if flags & NAMED != 0 {
                    push_text(&mut body, &self.schema.time_name);
                }
            }
        }
        if self.origin != 0 {
            push_varint(&mut body, zigzag(self.origin));
        }
        if self.schema.time != TimeBase::Numbered {
            push_varint(&mut body, zigzag(self.step));
        }
        if count > 1 {
            push_varint(&mut body, count as u64);
        }
        let columns = self.schema.columns.iter().zip(&self.share_bounds).zip(&self.starts);
        for ((column, share_bound), start) in columns {
            push_column(&mut body, column, *share_bound, start.as_ref());
        }
        body
    }

    /// A recording of a single block with this content.
    pub(crate) fn single(&self, content: &[u8]) -> Vec<u8> {
        let mut bytes = self.to_bytes();
        bytes.extend_from_slice(content);
        let check = checksum(&[&bytes]);
        bytes.extend(check.to_le_bytes());
        bytes
    }
}

/// Flags beside the time base: blocks over a link, which have no end; an origin follows; a number of columns follows (else one).
pub(crate) const STREAM: u8 = 0x10;
pub(crate) const ORIGIN: u8 = 0x20;
pub(crate) const COLUMNS: u8 = 0x40;
/// Flag beside the time base: the name of the times follows (else `time`).
pub(crate) const NAMED: u8 = 0x80;
/// Flag beside the version: the only block follows.
pub(crate) const SINGLE: u8 = 0x80;

/// Random bits from the standard library's keys for hash tables, which differ from call to call and from process to process. WebAssembly
/// without a system has neither keys nor a clock: there they differ from call to call only.
fn random() -> u32 {
    let mut hasher = RandomState::new().build_hasher();
    if cfg!(not(all(target_family = "wasm", target_os = "unknown"))) {
        let time = SystemTime::now().duration_since(UNIX_EPOCH);
        hasher.write_u128(time.map_or(0, |time| time.as_nanos()));
    }
    hasher.finish() as u32
}

/// The largest double with 12 bits of mantissa that does not exceed `bound`; it is stored in three bytes.
pub(crate) fn rounded_down(bound: f64) -> f64 {
    f64::from_bits(bound.to_bits() & !0xff_ffff_ffff)
}
