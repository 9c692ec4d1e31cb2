//! Binary arithmetic coder whose output ends after a whole number of bytes and needs no length.
//!
//! An interval `[low, high]` of 64-bit numbers is split at each decision in the proportion of a 16-bit probability. Leading bytes that are
//! equal in both ends are output. The code ends with the fewest bytes that, followed by zeros, lie in the interval. The decoder computes
//! them again, so it detects bytes after the end.

use crate::error::{Damaged, ensure};
use std::hint::select_unpredictable;

/// Bits of a probability.
const BITS: u32 = 16;
/// An even probability.
const EVEN: u32 = 1 << (BITS - 1);
/// Largest number of bytes that a decoder reads beyond the end: the width of the interval.
const AHEAD: usize = 8;

/// Common interface of writer and reader. A writer codes the given bit; a reader ignores it and returns the bit that was written.
pub trait Coder: Default {
    /// Codes one decision; `one` is the probability of `true` in units of `2^-16`, in `1..2^16`.
    fn bit(&mut self, one: u32, bit: bool) -> bool;

    /// The same as [`bit`](Self::bit), for unpredictable bits: a reader decides without a branch, because a processor would mispredict it.
    fn even_bit(&mut self, one: u32, bit: bool) -> bool {
        self.bit(one, bit)
    }

    /// Whether more decisions were read than any writer can have written.
    fn overran(&self) -> bool {
        false
    }

    /// Codes the low `width` bits of `value` without a model, the highest first.
    #[inline(always)]
    fn raw(&mut self, value: u64, width: u32) -> u64 {
        (0..width)
            .rev()
            .fold(0, |read, i| read << 1 | u64::from(self.even_bit(EVEN, value >> i & 1 == 1)))
    }
}

/// The interval of the numbers `low..=low + width`.
#[derive(Debug, Clone, Copy)]
struct Interval {
    low: u64,
    width: u64,
}

impl Interval {
    const WHOLE: Self = Self {
        low: 0,
        width: u64::MAX,
    };

    /// Width of the lower part, which codes `true`.
    #[inline(always)]
    fn part(self, one: u32) -> u64 {
        (self.width >> BITS) * u64::from(one)
    }

    #[inline(always)]
    fn split(&mut self, part: u64, bit: bool) {
        // Equal ends are shifted out at once, so the width is above `part`: both parts hold a number.
        if bit {
            self.width = part;
        } else {
            self.low += part + 1;
            self.width -= part + 1;
        }
    }

    /// Whether the highest byte is equal in both ends.
    #[inline(always)]
    fn settled(self) -> bool {
        (self.low ^ (self.low + self.width)) >> 56 == 0
    }

    #[inline(always)]
    fn shift(&mut self) {
        self.low <<= 8;
        self.width = self.width << 8 | 255;
    }

    /// The shortest end of the code: its bytes, the first in the highest place, and their number.
    fn end(self) -> (u64, usize) {
        (0..8)
            .map(|count| {
                // `low` rounded up to `count` bytes. A sum beyond the range wraps to 0, which the search refuses.
                let kept = if count == 0 { 0 } else { u64::MAX << (64 - 8 * count) };
                (self.low.wrapping_add(!kept) & kept, count)
            })
            .find(|(value, _)| *value >= self.low && value - self.low <= self.width)
            .unwrap_or((self.low, 8))
    }
}

/// Codes decisions as bytes.
#[derive(Debug, Clone)]
pub struct Writer {
    interval: Interval,
    bytes: Vec<u8>,
}

impl Default for Writer {
    fn default() -> Self {
        Self::new(Vec::new())
    }
}

impl Writer {
    /// A writer that appends to `bytes`.
    pub fn new(bytes: Vec<u8>) -> Self {
        Self {
            interval: Interval::WHOLE,
            bytes,
        }
    }

    /// Information coded so far in bits, with the fraction that the interval holds.
    pub fn bits(&self) -> f64 {
        8.0 * self.bytes.len() as f64 + 64.0 - (self.interval.width as f64).log2()
    }

    /// The code of what `describe` codes, behind these bytes.
    ///
    /// # Errors
    /// Those of `describe`.
    pub(crate) fn all<T, E>(bytes: Vec<u8>, describe: impl FnOnce(&mut Self) -> Result<T, E>) -> Result<Vec<u8>, E> {
        let mut writer = Self::new(bytes);
        describe(&mut writer)?;
        Ok(writer.finish())
    }

    /// All bytes, with the shortest end.
    pub fn finish(mut self) -> Vec<u8> {
        let (end, count) = self.interval.end();
        self.bytes.extend_from_slice(&end.to_be_bytes()[..count]);
        self.bytes
    }
}

impl Coder for Writer {
    #[inline(always)]
    fn bit(&mut self, one: u32, bit: bool) -> bool {
        let part = self.interval.part(one);
        self.interval.split(part, bit);
        while self.interval.settled() {
            self.bytes.push((self.interval.low >> 56) as u8);
            self.interval.shift();
        }
        bit
    }
}

/// Decodes what a [`Writer`] wrote. After the end it reads zeros; [`finish`](Self::finish) detects that.
#[derive(Debug)]
pub struct Reader<'a> {
    interval: Interval,
    /// The number that the next bytes form, minus the lower end of the interval.
    ahead: u64,
    bytes: &'a [u8],
    /// Number of bytes read, including zeros after the end.
    taken: usize,
}

impl Default for Reader<'_> {
    fn default() -> Self {
        Self::new(&[])
    }
}

impl<'a> Reader<'a> {
    /// A reader of all these bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut reader = Self {
            interval: Interval::WHOLE,
            ahead: 0,
            bytes,
            taken: 0,
        };
        (0..AHEAD).for_each(|_| reader.take());
        reader
    }

    /// What `describe` finds, if the bytes hold nothing else.
    ///
    /// # Errors
    /// Those of `describe`, and as [`finish`](Self::finish).
    pub(crate) fn all<T, E: From<Damaged>>(
        bytes: &'a [u8],
        describe: impl FnOnce(&mut Self) -> Result<T, E>,
    ) -> Result<T, E> {
        let mut reader = Self::new(bytes);
        let found = describe(&mut reader)?;
        reader.finish()?;
        Ok(found)
    }

    #[inline(always)]
    fn take(&mut self) {
        let byte = self.bytes.get(self.taken).copied().unwrap_or(0);
        self.ahead = self.ahead << 8 | u64::from(byte);
        self.taken += 1;
    }

    #[inline(always)]
    fn refill(&mut self) {
        while self.interval.settled() {
            self.interval.shift();
            self.take();
        }
    }

    /// Checks that the decisions read are all that was written.
    ///
    /// # Errors
    /// If the bytes are not those that a writer of the same decisions would have written.
    pub fn finish(&self) -> Result<(), Damaged> {
        let (end, count) = self.interval.end();
        // The bytes that were shifted out of the interval are settled; the end follows them.
        let settled = self.taken - AHEAD;
        let tail = self.bytes.get(settled..).unwrap_or_default();
        let expected = "the bytes that a writer of as many rows ends with";
        let is_end = self.bytes.len() == settled + count && tail == &end.to_be_bytes()[..count];
        ensure!(is_end, Damaged::new("block", format!("{} bytes", self.bytes.len()), expected));
        Ok(())
    }
}

impl Coder for Reader<'_> {
    #[inline(always)]
    fn bit(&mut self, one: u32, _: bool) -> bool {
        let part = self.interval.part(one);
        let bit = self.ahead <= part;
        self.interval.split(part, bit);
        if !bit {
            self.ahead -= part + 1;
        }
        self.refill();
        bit
    }

    #[inline(always)]
    fn even_bit(&mut self, one: u32, _: bool) -> bool {
        let part = self.interval.part(one);
        let bit = self.ahead <= part;
        let skipped = select_unpredictable(bit, 0, part + 1);
        self.ahead -= skipped;
        self.interval.low += skipped;
        self.interval.width = select_unpredictable(bit, part, self.interval.width - (part + 1));
        self.refill();
        bit
    }

    #[inline(always)]
    fn overran(&self) -> bool {
        self.taken > self.bytes.len() + AHEAD
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Decisions of very even and very uneven probabilities return, and bytes behind the end are refused.
    #[test]
    fn decisions_return_and_trailing_bytes_are_refused() {
        let decisions: Vec<(u32, bool)> = (0..3000_u32)
            .map(|i| {
                let one = [1, 100, 30_000, 65_000, 65_535][(i % 5) as usize];
                (one, i.wrapping_mul(2_654_435_761) >> 16 < one)
            })
            .collect();
        for count in [0, 1, 2, 7, 100, 3000] {
            let mut writer = Writer::new(Vec::new());
            decisions[..count].iter().for_each(|(one, bit)| {
                writer.bit(*one, *bit);
            });
            let bytes = writer.finish();
            let mut reader = Reader::new(&bytes);
            assert!(
                decisions[..count]
                    .iter()
                    .all(|(one, bit)| reader.bit(*one, false) == *bit)
            );
            reader.finish().unwrap();
            let longer = [bytes.as_slice(), &[0]].concat();
            let mut reader = Reader::new(&longer);
            decisions[..count].iter().for_each(|(one, _)| {
                reader.bit(*one, false);
            });
            assert!(reader.finish().is_err(), "{count}");
        }
    }
}
