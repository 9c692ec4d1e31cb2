//! Interface between the container and the codecs: finite numbers in; bytes, and the numbers that they decode to, out.
//!
//! A new codec is a new id and a pair of functions in its own file. The container stores the id beside the bytes. It stores samples in full
//! that a codec does not restore within the bound (see [`Coded::restored`]), and depends on nothing else of the codec.
//!
//! | id | bytes | used for |
//! |---|---|---|
//! | 0 | doubles, little-endian | samples that no codec makes smaller |
//! | 1 | the first bytes of one double, highest first | samples that are all within the bound of one number |
//! | 2 | a block of `fewbits-adaptive` | everything else |
//! | 3 | none: the column is in the block's shared code | samples on the grid of the column's start |

pub(crate) mod adaptive;
mod plain;

use crate::bound::Promise;
use crate::error::Damage;
use fewbits_adaptive::{Effort, Start};

pub(crate) use fewbits_adaptive::JOINT_COLUMNS;

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
        Ok(match byte {
            0 => Self::Raw,
            1 => Self::Constant,
            2 => Self::Adaptive,
            3 => Self::Shared,
            _ => return Err(Damage::Content("codec")),
        })
    }
}

/// The bound of a column in one block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Target {
    pub(crate) promise: Promise,
    pub(crate) period: Option<f64>,
}

impl Target {
    pub(crate) fn holds(&self, sample: f64, restored: f64) -> bool {
        self.promise.holds(sample, restored, self.period)
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
    fn verified(
        id: CodecId,
        bytes: Vec<u8>,
        samples: &[f64],
        target: &Target,
        start: Option<&Start>,
        others: &[&[f64]],
    ) -> Option<Self> {
        let restored = decode(id, &bytes, samples.len(), target, start, others).ok()?;
        let pairs = samples.iter().zip(&restored);
        let broken = pairs.filter(|(sample, value)| !target.holds(**sample, **value)).count();
        Some(Self {
            id,
            uses_others: !others.is_empty(),
            bytes,
            restored,
            broken,
        })
    }

    fn cost(&self) -> usize {
        self.bytes.len() + REPAIR_BYTES * self.broken
    }
}

/// A short code of the samples, which are all finite. It has been decoded once, so the restored numbers are known.
///
/// `start`: the column's start in the header. `others`: the same rows of other columns, as a reader restores them; NaN for missing values.
pub(crate) fn encode(
    samples: &[f64],
    target: &Target,
    start: Option<&Start>,
    others: &[&[f64]],
    effort: Effort,
) -> Coded {
    let constant = plain::constant(samples, target)
        .and_then(|bytes| Coded::verified(CodecId::Constant, bytes, samples, target, None, &[]))
        .filter(|coded| coded.broken == 0);
    let raw = || Coded {
        id: CodecId::Raw,
        bytes: plain::raw(samples),
        restored: samples.to_vec(),
        broken: 0,
        uses_others: false,
    };
    constant.unwrap_or_else(|| {
        adaptive::encode(samples, target, start, others, effort)
            .and_then(|(bytes, joint)| {
                let others = if joint { others } else { &[] };
                Coded::verified(CodecId::Adaptive, bytes, samples, target, start, others)
            })
            .filter(|coded| coded.cost() < 8 * samples.len())
            .unwrap_or_else(raw)
    })
}

/// Decodes `count` finite numbers; `others` must be those that were passed to [`encode`].
///
/// # Errors
/// If the bytes are not what [`encode`] writes. Any bytes give numbers or an error.
pub(crate) fn decode(
    id: CodecId,
    bytes: &[u8],
    count: usize,
    target: &Target,
    start: Option<&Start>,
    others: &[&[f64]],
) -> Result<Vec<f64>, Damage> {
    let values = match id {
        CodecId::Raw => plain::decode_raw(bytes, count),
        CodecId::Constant => plain::decode_constant(bytes, count),
        CodecId::Adaptive => adaptive::decode(bytes, count, target, start, others),
        CodecId::Shared => Err(Damage::Content("codec")),
    }?;
    if values.iter().all(|value| value.is_finite()) {
        Ok(values)
    } else {
        Err(Damage::Content("values"))
    }
}
