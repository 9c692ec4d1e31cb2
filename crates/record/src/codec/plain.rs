//! Codes that need no model: doubles as they are, one number for all, whole multiples of a decimal step.

use super::Target;
use crate::bound::{MAX_DECIMALS, Promise, TENS, decimal};
use crate::error::Damage;
use crate::wire::{Bytes, push_varint};

pub(super) fn raw(samples: &[f64]) -> Vec<u8> {
    samples.iter().flat_map(|sample| sample.to_le_bytes()).collect()
}

pub(super) fn decode_raw(bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    let (chunks, rest) = bytes.as_chunks::<8>();
    if chunks.len() != count || !rest.is_empty() {
        return Err(Damage::Content("length of raw samples"));
    }
    Ok(chunks.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect())
}

/// A double without the zero bytes at its low end.
pub(super) fn push_short_double(bytes: &mut Vec<u8>, value: f64) {
    let all = value.to_be_bytes();
    let kept = all.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    bytes.push(kept as u8);
    bytes.extend_from_slice(&all[..kept]);
}

pub(super) fn read_short_double(bytes: &mut Bytes<'_>) -> Result<f64, Damage> {
    let kept = usize::from(bytes.byte()?);
    let mut all = [0; 8];
    let head = all.get_mut(..kept).ok_or(Damage::Content("length of a number"))?;
    head.copy_from_slice(bytes.take(kept)?);
    Ok(f64::from_be_bytes(all))
}

/// One number that keeps the promise for all samples, if there may be one: the middle, or the first where it is the same.
pub(super) fn constant(samples: &[f64], target: &Target) -> Option<Vec<u8>> {
    let first = *samples.first()?;
    let ends = samples
        .iter()
        .fold((first, first), |(low, high), x| (low.min(*x), high.max(*x)));
    let value = match target.promise {
        _ if samples.iter().all(|sample| target.holds(*sample, first)) => first,
        Promise::Within(delta) if target.period.is_none() && ends.1 - ends.0 <= 2.0 * delta => {
            ends.0 + 0.5 * (ends.1 - ends.0)
        }
        _ => return None,
    };
    let mut bytes = Vec::new();
    push_short_double(&mut bytes, value);
    Some(bytes)
}

pub(super) fn decode_constant(bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    let mut reader = Bytes(bytes);
    let value = read_short_double(&mut reader)?;
    reader.finish()?;
    Ok(vec![value; count])
}

/// Samples as whole multiples of a decimal step: `sample = step * multiple / 10^places`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Steps {
    pub(super) places: u8,
    pub(super) step: u64,
    /// The first sample, in units of the last decimal: multiples count from it.
    pub(super) origin: i64,
    pub(super) multiples: Vec<i64>,
}

/// Share of the samples that must be decimals of so many places. The others cost ten bytes each.
const DECIMAL_SHARE: f64 = 0.95;

impl Steps {
    /// The fewest decimals that write nearly all samples, and the largest step that all of those are multiples of.
    ///
    /// A sample that they do not write takes the multiple before it; the container stores it whole.
    pub(super) fn find(samples: &[f64]) -> Option<Self> {
        let written = |places: u8| samples.iter().filter(|x| decimal(**x, places).is_some()).count();
        let enough = |places: &u8| written(*places) as f64 >= DECIMAL_SHARE * samples.len() as f64;
        let places = (0..=MAX_DECIMALS).find(enough)?;
        // More decimals that write all are better than fewer that write nearly all.
        let complete = (places..=MAX_DECIMALS.min(places + 3)).find(|p| written(*p) == samples.len());
        let places = complete.unwrap_or(places);
        let mut last = samples.iter().find_map(|x| decimal(*x, places))?;
        let origin = last;
        let mut multiples = Vec::with_capacity(samples.len());
        for sample in samples {
            last = decimal(*sample, places).unwrap_or(last);
            multiples.push(last - origin);
        }
        let step = multiples
            .iter()
            .fold(0, |step, m| greatest_common_divisor(step, m.unsigned_abs()));
        let step = step.max(1);
        multiples.iter_mut().for_each(|m| *m /= step as i64);
        Some(Self {
            places,
            step,
            origin,
            multiples,
        })
    }

    pub(super) fn push_head(&self, bytes: &mut Vec<u8>) {
        bytes.push(self.places);
        push_varint(bytes, self.step);
        push_varint(bytes, crate::wire::zigzag(self.origin));
    }

    /// What [`push_head`](Self::push_head) wrote, without multiples.
    pub(super) fn read_head(reader: &mut Bytes<'_>) -> Result<Self, Damage> {
        let places = reader.byte()?;
        let (step, origin) = (reader.varint()?, reader.signed()?);
        if places > MAX_DECIMALS || step == 0 || step > 1 << 54 || origin.unsigned_abs() > 1 << 54 {
            return Err(Damage::Content("step"));
        }
        Ok(Self {
            places,
            step,
            origin,
            multiples: Vec::new(),
        })
    }

    /// The sample of a multiple. Exact for every multiple that [`find`](Self::find) gave.
    pub(super) fn value(&self, multiple: i64) -> f64 {
        let digits = i128::from(self.origin) + i128::from(self.step) * i128::from(multiple);
        digits as f64 / TENS[usize::from(self.places)]
    }
}

pub(crate) fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
