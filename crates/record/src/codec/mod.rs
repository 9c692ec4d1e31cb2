//! Interface between the container and the codecs: finite numbers in; bytes, and the numbers that they decode to, out.
//!
//! A new codec is a new id and a pair of functions in its own file. The container stores the id beside the bytes. It stores samples in full
//! that a codec does not restore within the bound (see [`Coded::restored`]), and depends on nothing else of the codec.
//!
//! | id | bytes | used for |
//! |---|---|---|
//! | 0 | doubles, little-endian | samples that no codec makes smaller |
//! | 1 | the first bytes of one double, highest first | samples that are all within the bound of one number |
//! | 2 | a block of `fewbits-block-codec` | everything else |
//! | 3 | none: the column is in the block's shared code | samples on the grid of the column's start |

pub(crate) mod adaptive;
mod plain;
mod relative;

use crate::bound::Bound;
use crate::column::Column;
use crate::error::{Damage, ensure};
use fewbits_block_codec::{Effort, Start};

pub(crate) use fewbits_block_codec::JOINT_COLUMNS;

/// Which codec wrote the bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CodecId {
    Raw = 0,
    Constant = 1,
    Adaptive = 2,
    Shared = 3,
}

impl CodecId {
    pub(crate) fn from_byte(byte: u8) -> Result<Self, Damage> {
        let all = [Self::Raw, Self::Constant, Self::Adaptive, Self::Shared];
        all.get(usize::from(byte)).copied().ok_or(Damage::Content("codec"))
    }
}

/// The bound of a column in one block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Target {
    pub(crate) bound: Bound,
    pub(crate) period: Option<f64>,
}

impl Target {
    /// That of a column where its share is worth this bound.
    pub(crate) fn of(column: &Column, share_bound: f64) -> Self {
        let (bound, period) = (column.bound_in(share_bound), column.period);
        Self { bound, period }
    }

    pub(crate) fn holds(&self, sample: f64, restored: f64) -> bool {
        self.bound.holds(sample, restored, self.period)
    }

    /// How many samples are not held.
    fn broken(&self, samples: &[f64], restored: &[f64]) -> usize {
        let pairs = samples.iter().zip(restored);
        // A loop without branches: nearer than the bound is within it, whatever was rounded.
        if let (Bound::Absolute(delta), None) = (self.bound, self.period)
            && pairs
                .clone()
                .fold(true, |all, (sample, value)| all & ((sample - value).abs() < delta))
        {
            return 0;
        }
        pairs.filter(|(sample, value)| !self.holds(**sample, **value)).count()
    }
}

/// What writer and reader of a block's column know beside its bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Context<'a> {
    pub(crate) target: &'a Target,
    /// What the header says of the column's blocks.
    pub(crate) start: Option<&'a Start>,
    /// The same rows of other columns, as a reader has restored them; NaN where they have no value.
    pub(crate) others: &'a [&'a [f64]],
}

impl<'a> Context<'a> {
    /// Of a column that is coded by itself.
    pub(crate) fn alone(target: &'a Target) -> Self {
        Self {
            target,
            start: None,
            others: &[],
        }
    }
}

/// Coded values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Coded {
    pub(crate) id: CodecId,
    pub(crate) bytes: Vec<u8>,
    /// The numbers that the bytes decode to, found by decoding them.
    pub(crate) restored: Vec<f64>,
    /// How many of them are outside the bound. The container stores those samples in full.
    pub(crate) broken: usize,
    /// Whether other columns are needed to decode the bytes.
    pub(crate) uses_others: bool,
}

/// Bytes of a sample that the container stores in full.
const REPAIR_BYTES: usize = 10;

impl Coded {
    /// Decodes what was coded and compares it with the samples; `None` if it does not decode.
    fn verified(id: CodecId, bytes: Vec<u8>, samples: &[f64], context: Context<'_>) -> Option<Self> {
        let restored = decode(id, &bytes, samples.len(), context).ok()?;
        let broken = context.target.broken(samples, &restored);
        Some(Self {
            id,
            uses_others: !context.others.is_empty(),
            bytes,
            restored,
            broken,
        })
    }
}

/// A short code of the samples, which are all finite. It has been decoded once, so the restored numbers are known.
pub(crate) fn encode(samples: &[f64], context: Context<'_>, effort: Effort) -> Coded {
    let raw = || Coded {
        id: CodecId::Raw,
        bytes: plain::raw(samples),
        restored: samples.to_vec(),
        broken: 0,
        uses_others: false,
    };
    let constant = plain::constant(samples, context.target)
        .and_then(|bytes| Coded::verified(CodecId::Constant, bytes, samples, Context::alone(context.target)))
        .filter(|coded| coded.broken == 0);
    let adaptive = || {
        let (bytes, joint) = adaptive::encode(samples, context, effort)?;
        let others = if joint { context.others } else { &[] };
        let coded = Coded::verified(CodecId::Adaptive, bytes, samples, Context { others, ..context })?;
        // Broken samples are stored in full.
        (coded.bytes.len() + REPAIR_BYTES * coded.broken < 8 * samples.len()).then_some(coded)
    };
    constant.or_else(adaptive).unwrap_or_else(raw)
}

/// Decodes `count` finite numbers; `context` must be the one that was passed to [`encode`].
///
/// # Errors
/// If the bytes are not what [`encode`] writes. Any bytes give numbers or an error.
pub(crate) fn decode(id: CodecId, bytes: &[u8], count: usize, context: Context<'_>) -> Result<Vec<f64>, Damage> {
    let values = match id {
        CodecId::Raw => plain::decode_raw(bytes, count),
        CodecId::Constant => plain::decode_constant(bytes, count),
        CodecId::Adaptive => adaptive::decode(bytes, count, context),
        CodecId::Shared => Err(Damage::Content("codec")),
    }?;
    ensure!(values.iter().all(|value| value.is_finite()), Damage::Content("values"));
    Ok(values)
}
