//! Blocks of the adaptive codec (`fewbits-block-codec`), for every bound.

use super::relative::Lattice;
use super::{Context, Target};
use crate::bound::{Bound, TENS};
use crate::error::Damage;
use fewbits_block_codec::bytes::Fields;
use fewbits_block_codec::{BlockCodec, Effort, Start};
use std::borrow::Cow;

/// The codec for a bound. For decimals, samples are rounded before and then restored exactly.
pub(crate) fn codec(target: &Target) -> Option<BlockCodec> {
    let delta = match target.bound {
        Bound::Absolute(delta) => delta,
        _ => return Some(BlockCodec::lossless()),
    };
    let codec = BlockCodec::new(delta).ok()?;
    match target.period {
        Some(period) => codec.on_circle(period).ok(),
        None => Some(codec),
    }
}

/// The nearest number of `places` decimals. If its digits are not an exact double, the sample itself.
fn rounded(sample: f64, places: u8) -> f64 {
    let ten = TENS.get(usize::from(places)).copied().unwrap_or(1.0);
    let digits = (sample * ten).round();
    // Adding zero converts the negative zero.
    if digits.abs() < 9e15 {
        digits / ten + 0.0
    } else {
        sample
    }
}

/// The samples that are passed to the codec.
pub(crate) fn prepared<'a>(samples: &'a [f64], target: &Target) -> Cow<'a, [f64]> {
    match target.bound {
        Bound::Decimals(places) => samples.iter().map(|sample| rounded(*sample, places)).collect(),
        Bound::Relative { share, floor } => {
            let lattice = Lattice::new(share, floor);
            samples.iter().map(|sample| lattice.index(*sample) as f64).collect()
        }
        _ => Cow::Borrowed(samples),
    }
}

/// The samples of what the codec has decoded: the inverse of [`prepared`].
pub(crate) fn restored(values: Vec<f64>, target: &Target) -> Vec<f64> {
    match target.bound {
        Bound::Relative { share, floor } => {
            let lattice = Lattice::new(share, floor);
            // No writer writes an index that is not whole; one that a forger writes saturates.
            values.into_iter().map(|index| lattice.value(index as i64)).collect()
        }
        _ => values,
    }
}

/// The start for blocks of a column with samples like these.
pub(crate) fn start(samples: &[f64], target: &Target) -> Option<Start> {
    codec(target)?.start(&prepared(samples, target))
}

/// The start as fields; a reader has none.
pub(crate) fn code_start<F: Fields>(fields: &mut F, own: Option<&Start>, target: &Target) -> Result<Start, Damage> {
    let start = codec(target).and_then(|codec| codec.code_start(fields, own).ok());
    start.ok_or(Damage::Content("start of blocks"))
}

/// The coded bytes, and whether other columns are needed to decode them.
pub(super) fn encode(samples: &[f64], context: Context<'_>, effort: Effort) -> Option<(Vec<u8>, bool)> {
    let codec = codec(context.target)?.with_effort(effort);
    let samples = prepared(samples, context.target);
    if let Some(start) = context.start {
        let block = codec.encode_from(start, &samples, context.others).ok()?;
        return Some((block.bytes, block.joint));
    }
    let bytes = codec.encode_with(&samples, context.others).ok()?;
    // Bit 6 of a block's first byte says so.
    let joint = bytes.first().is_some_and(|head| head & 0x40 != 0);
    Some((bytes, joint))
}

pub(super) fn decode(bytes: &[u8], count: usize, context: Context<'_>) -> Result<Vec<f64>, Damage> {
    let codec = codec(context.target).ok_or(Damage::Content("bound"))?;
    let values = match context.start {
        Some(start) => codec.decode_from(start, bytes, count, context.others),
        None => codec.decode_with(bytes, count, context.others),
    };
    let values = values.map_err(|_| Damage::Content("adaptive block"))?;
    Ok(restored(values, context.target))
}
