//! The seam between the container and the codecs of values: finite numbers in, bytes and what they decode to out.
//!
//! A new codec is a new id with a pair of functions in a file of its own. The container stores the id beside the bytes, repairs
//! what a codec did not promise (see [`Coded::restored`]) and knows nothing else of it.
//!
//! | id | bytes | used for |
//! |---|---|---|
//! | 0 | doubles, little-endian | a few samples, or what nothing compresses |
//! | 1 | one double | all samples alike within the promise |
//! | 2 | the adaptive stream of the column's bound | absolute bounds, shares, decimals |
//! | 3 | decimals, step, the adaptive stream of whole numbers | lossless columns of decimals or whole steps |
//! | 4 | pco of doubles | lossless columns without steps |
//! | 5 | origin, pco of whole numbers | fine bounds, where pco is smaller than 2 |
//! | 6 | decimals, step, origin, pco of whole numbers | lossless decimals, where pco is smaller than 3 |

mod adaptive;
mod packed;
mod plain;

pub(crate) use plain::greatest_common_divisor;

use crate::bound::Promise;
use crate::error::Damage;

/// Which codec wrote the bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CodecId {
    Raw = 0,
    Constant = 1,
    Adaptive = 2,
    AdaptiveSteps = 3,
    PackedDoubles = 4,
    PackedLattice = 5,
    PackedSteps = 6,
}

impl CodecId {
    pub(crate) fn from_byte(byte: u8) -> Result<Self, Damage> {
        Ok(match byte {
            0 => Self::Raw,
            1 => Self::Constant,
            2 => Self::Adaptive,
            3 => Self::AdaptiveSteps,
            4 => Self::PackedDoubles,
            5 => Self::PackedLattice,
            6 => Self::PackedSteps,
            _ => return Err(Damage::Content("codec")),
        })
    }
}

/// What a column promises in one block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Target {
    pub(crate) promise: Promise,
    pub(crate) period: Option<f64>,
}

impl Target {
    pub(crate) fn holds(&self, sample: f64, restored: f64) -> bool {
        self.promise.holds(sample, restored, self.period)
    }

    /// The bound around the circle, if there is one that codecs have to know.
    fn circle(&self) -> Option<f64> {
        self.period.filter(|_| self.promise != Promise::Exact)
    }
}

/// Coded values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Coded {
    pub(crate) id: CodecId,
    pub(crate) bytes: Vec<u8>,
    /// What the bytes decode to, found by decoding them.
    pub(crate) restored: Vec<f64>,
    /// How many of them break the promise; the container stores those samples whole.
    pub(crate) broken: usize,
}

/// Bytes of a sample that the container stores whole.
const REPAIR_BYTES: usize = 10;

impl Coded {
    /// Decodes what was coded and compares it with the samples; `None` if it does not decode.
    fn verified(id: CodecId, bytes: Vec<u8>, samples: &[f64], target: &Target) -> Option<Self> {
        let restored = decode(id, &bytes, samples.len(), target).ok()?;
        let pairs = samples.iter().zip(&restored);
        let broken = pairs.filter(|(sample, value)| !target.holds(**sample, **value)).count();
        Some(Self {
            id,
            bytes,
            restored,
            broken,
        })
    }

    fn cost(&self) -> usize {
        self.bytes.len() + REPAIR_BYTES * self.broken
    }
}

/// From this many bytes per sample on pco is tried beside the adaptive stream. Below it never won on 75 recordings.
const PACKED_FROM: f64 = 0.25;

/// The smallest code of the samples, all finite. Every candidate is decoded before it is compared.
pub(crate) fn encode(samples: &[f64], target: &Target) -> Coded {
    let mut best = plain::constant(samples, target)
        .and_then(|bytes| Coded::verified(CodecId::Constant, bytes, samples, target))
        .filter(|coded| coded.broken == 0);
    if let Some(constant) = best.take() {
        return constant;
    }
    let mut consider = |id: CodecId, bytes: Option<Vec<u8>>| {
        let coded = bytes.and_then(|bytes| Coded::verified(id, bytes, samples, target));
        if let Some(coded) = coded
            && best.as_ref().is_none_or(|best| coded.cost() < best.cost())
        {
            best = Some(coded);
        }
        best.as_ref().map_or(usize::MAX, Coded::cost)
    };
    let worth_packing = |cost: usize| cost as f64 > PACKED_FROM * samples.len() as f64;
    if target.promise == Promise::Exact {
        if let Some(steps) = plain::Steps::find(samples) {
            let cost = consider(CodecId::AdaptiveSteps, adaptive::encode_steps(&steps));
            if worth_packing(cost) {
                consider(CodecId::PackedSteps, packed::encode_steps(&steps));
            }
        }
        let cost = consider(CodecId::Raw, Some(plain::raw(samples)));
        if worth_packing(cost) {
            consider(CodecId::PackedDoubles, packed::encode_doubles(samples));
        }
    } else {
        let cost = consider(CodecId::Adaptive, adaptive::encode(samples, target));
        if worth_packing(cost) {
            consider(CodecId::PackedLattice, packed::encode_lattice(samples, target));
            consider(CodecId::Raw, Some(plain::raw(samples)));
        }
    }
    best.unwrap_or_else(|| Coded {
        id: CodecId::Raw,
        bytes: plain::raw(samples),
        restored: samples.to_vec(),
        broken: 0,
    })
}

/// The `count` numbers that the bytes stand for, all finite.
///
/// # Errors
/// If they are not what [`encode`] writes. Total: any bytes give numbers or an error.
pub(crate) fn decode(id: CodecId, bytes: &[u8], count: usize, target: &Target) -> Result<Vec<f64>, Damage> {
    let values = match id {
        CodecId::Raw => plain::decode_raw(bytes, count),
        CodecId::Constant => plain::decode_constant(bytes, count),
        CodecId::Adaptive => adaptive::decode(bytes, count, target),
        CodecId::AdaptiveSteps => adaptive::decode_steps(bytes, count),
        CodecId::PackedDoubles => packed::decode_doubles(bytes, count),
        CodecId::PackedLattice => packed::decode_lattice(bytes, count, target),
        CodecId::PackedSteps => packed::decode_steps(bytes, count),
    }?;
    if values.iter().all(|value| value.is_finite()) {
        Ok(values)
    } else {
        Err(Damage::Content("values"))
    }
}
