//! The header: everything that is needed to decode any block of a recording.

use crate::bound::Bound;
use crate::codec::{Target, adaptive};
use crate::column::check_circle;
use crate::header_column::shortened;
use crate::schema::{Schema, TimeBase};
use crate::time::{self, Grid};
pub(crate) use crate::wire::VERSION_5;
use crate::wire::{checksum, written};
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
    /// The only block, of so many rows, follows the header, up to a checksum of the whole recording.
    Single(usize),
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

/// A header before anything is known of it.
pub(crate) const BLANK: Header = Header {
    version: VERSION,
    form: Form::File,
    identity: 0,
    schema: Schema {
        columns: Vec::new(),
        time: TimeBase::Numbered,
        rows_per_block: 0,
        keeps_ticks: false,
        time_name: String::new(),
    },
    origin: 0,
    step: 1,
    share_bounds: Vec::new(),
    starts: Vec::new(),
    length: 0,
    check: 0,
};

impl Header {
    /// The header of a recording whose first rows are known.
    pub(crate) fn new(mut schema: Schema, ticks: &[i64], share_bounds: Vec<f64>) -> Self {
        for column in &mut schema.columns {
            if let Bound::Absolute(delta) = column.bound {
                let bound = Bound::Absolute(shortened(delta));
                // A circle may have too many cells of the shorter one.
                if column.period.is_none_or(|period| check_circle(bound, period).is_ok()) {
                    column.bound = bound;
                }
            }
        }
        let step = match schema.time {
            TimeBase::Numbered => 1,
            TimeBase::Clock { tolerance, .. } => time::step(ticks, tolerance),
        };
        let header = Self {
            identity: random(),
            starts: vec![None; schema.columns.len()],
            schema,
            origin: ticks.first().copied().unwrap_or(0),
            step,
            share_bounds: share_bounds.into_iter().map(rounded_down).collect(),
            ..BLANK
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
            let target = self.target(column, None);
            let start = adaptive::start(&finite, &target)?;
            let bytes = written(|fields| adaptive::code_start(fields, Some(&start), &target));
            (bytes.len() <= MAX_START).then_some(start)
        };
        self.starts = columns.iter().enumerate().map(start).collect();
        self.checked()
    }

    /// The same header for blocks that follow in another form.
    pub(crate) fn with_form(self, form: Form) -> Self {
        Self { form, ..self }.checked()
    }

    /// Number of rows of a block that does not state it.
    pub(crate) fn block_rows(&self) -> usize {
        match self.form {
            Form::Single(rows) => rows,
            _ => self.schema.rows_per_block,
        }
    }

    /// The header of a recording of this version with the same columns.
    pub(crate) fn renewed(mut self) -> Self {
        self.version = VERSION;
        self.with_identity(random())
    }

    /// Whether the index of a finished recording must follow.
    pub(crate) fn has_end(&self) -> bool {
        self.form == Form::File
    }

    fn checked(mut self) -> Self {
        let bytes = self.to_bytes();
        self.length = bytes.len();
        self.check = match self.form {
            Form::Single(_) => 0,
            _ => bytes.last_chunk::<4>().map_or(0, |check| u32::from_le_bytes(*check)),
        };
        self
    }

    /// The checksum of a record of this recording.
    pub(crate) fn sum(&self, bytes: &[u8]) -> u32 {
        checksum(&[&self.check.to_le_bytes(), bytes])
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
            tolerance: match self.schema.keeps_ticks {
                true => 0,
                false => self.schema.time.tolerance(),
            },
        }
    }

    /// The bound of a column in a block; `own` is the block's own one.
    pub(crate) fn target(&self, column: usize, own: Option<f64>) -> Target {
        Target::of(&self.schema.columns[column], own.unwrap_or(self.share_bounds[column]))
    }
}

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
