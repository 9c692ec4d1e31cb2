//! The adaptive codec's blocks (`fewbits-adaptive`), for every promise.

use super::Target;
use crate::bound::{Promise, TENS};
use crate::error::Damage;
use fewbits_adaptive::{BlockCodec, Config, Effort};

/// The codec of a promise. Decimals are rounded before, and then return exactly.
fn codec(target: &Target) -> Option<BlockCodec> {
    let delta = match target.promise {
        Promise::Exact | Promise::Decimals(_) => return Some(BlockCodec::lossless()),
        Promise::Within(delta) => delta,
    };
    let config = Config::new(delta).ok()?;
    let config = match target.period {
        Some(period) => config.circular(period).ok()?,
        None => config,
    };
    Some(BlockCodec::new(config))
}

/// The nearest number of so many decimals; numbers whose digits are no exact double stay as they are.
fn rounded(sample: f64, places: u8) -> f64 {
    let ten = TENS.get(usize::from(places)).copied().unwrap_or(1.0);
    let digits = (sample * ten).round();
    // Zero added: the negative zero is no number of its own here.
    if digits.abs() < 9e15 {
        digits / ten + 0.0
    } else {
        sample
    }
}

pub(super) fn encode(samples: &[f64], target: &Target, others: &[&[f64]], effort: Effort) -> Option<Vec<u8>> {
    let codec = codec(target)?.with_effort(effort);
    match target.promise {
        Promise::Decimals(places) => {
            let decimals: Vec<f64> = samples.iter().map(|sample| rounded(*sample, places)).collect();
            codec.encode_with(&decimals, others).ok()
        }
        _ => codec.encode_with(samples, others).ok(),
    }
}

/// Whether the bytes were predicted from other columns: bit 6 of a block's first byte.
pub(super) fn uses_others(bytes: &[u8]) -> bool {
    bytes.first().is_some_and(|head| head & 0x40 != 0)
}

pub(super) fn decode(bytes: &[u8], count: usize, target: &Target, others: &[&[f64]]) -> Result<Vec<f64>, Damage> {
    let codec = codec(target).ok_or(Damage::Content("bound"))?;
    codec
        .decode_with(bytes, count, others)
        .map_err(|_| Damage::Content("adaptive block"))
}
