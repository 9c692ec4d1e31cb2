//! Codes without a model: the doubles themselves, or one number for all samples.

use super::Target;
use crate::bound::Bound;
use crate::error::{Damage, ensure};
use crate::ranges::wider;

pub(super) fn raw(samples: &[f64]) -> Vec<u8> {
    samples.iter().flat_map(|sample| sample.to_le_bytes()).collect()
}

pub(super) fn decode_raw(bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    let (chunks, rest) = bytes.as_chunks::<8>();
    ensure!(chunks.len() == count && rest.is_empty(), Damage::Content("length of raw samples"));
    Ok(chunks.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect())
}

/// The number with the fewest bytes that may be within the bound of all samples: the middle of their range, rounded to as few bits
/// as possible, or the first sample if all are equal. `None` if there is none.
pub(super) fn constant(samples: &[f64], target: &Target) -> Option<Vec<u8>> {
    let first = *samples.first()?;
    let keeps = |value: f64| samples.iter().all(|sample| target.holds(*sample, value));
    let ends = samples.iter().fold((first, first), |ends, x| wider(ends, *x));
    let middle = match target.bound {
        Bound::Absolute(delta) if target.period.is_none() && ends.1 - ends.0 <= 2.0 * delta => {
            ends.0 + 0.5 * (ends.1 - ends.0)
        }
        // The largest and the smallest allow the same numbers as all others.
        Bound::Relative { .. } => ends.0 + 0.5 * (ends.1 - ends.0),
        _ => first,
    };
    let short = |kept: usize| {
        let mut bytes = middle.to_be_bytes();
        bytes[kept..].fill(0);
        f64::from_be_bytes(bytes)
    };
    let kept = (0..=8).find(|kept| keeps(short(*kept)));
    let kept = kept.map(|kept| middle.to_be_bytes()[..kept].to_vec());
    kept.or_else(|| keeps(first).then(|| first.to_be_bytes().to_vec()))
}

pub(super) fn decode_constant(bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    let mut all = [0; 8];
    ensure!(bytes.len() <= all.len(), Damage::Content("length of a number"));
    all[..bytes.len()].copy_from_slice(bytes);
    Ok(vec![f64::from_be_bytes(all); count])
}
