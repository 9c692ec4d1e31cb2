//! Codes indices by counts of outcomes given the last difference. It uses no mixture and is more than ten times as fast as `model.rs`.
//!
//! A difference (of the index, or of its differences, as the block's writer chose) is coded in units of `2^k`; `k` follows the mean size
//! of differences:
//!
//! ```text
//! zero?   sign   at least 2, 3, .. 15?   the rest by an Elias gamma code   k low bits
//! ```
//!
//! A second set of counts given the last index was measured: 3 % fewer bits, but reading takes a third longer.

use crate::arithmetic::Coder;
use crate::error::{Damaged, ensure};
use crate::rows::{JOINT_COLUMNS, LARGEST, State, damaged};

/// Number of decisions in a context: zero, sign, and whether the size is at least 2 to 15.
const NODES: usize = 16;
/// Number of sizes that are coded one by one.
const SIZES: u64 = NODES as u64 - 2;
/// Largest size of the last difference that has its own context.
const STEPS: i64 = 4;
/// Number of contexts, rounded up to a power of two.
const CONTEXTS: usize = 16;
const _: () = assert!(2 * STEPS < CONTEXTS as i64);
/// Number of occurrences after which old ones lose weight.
const MOST_SEEN: u16 = 40;

/// Probability of `true` in units of `2^-16`, and how often the decision was seen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Count {
    one: u16,
    seen: u16,
}

/// Learning rates `2^15 / (n + 1.6)`. Their number is a power of two, so that masking replaces a bounds check.
const SHARES: [i32; 64] = {
    let mut shares = [0; 64];
    let mut seen = 0;
    while seen < shares.len() {
        shares[seen] = 327_680 / (10 * seen as i32 + 16);
        seen += 1;
    }
    shares
};

/// Smallest distance of a probability from 0 and 1, in units of `2^-16`.
const LEAST: i32 = 32;
const MOST: i32 = 65_535 - LEAST;

impl Count {
    pub(crate) const NEW: Self = Self { one: 1 << 15, seen: 0 };

    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let (one, share) = (i32::from(self.one), SHARES[usize::from(self.seen) % SHARES.len()]);
        let target = if bit { MOST } else { LEAST };
        self.one = (one + (((target - one) * share) >> 15)) as u16;
        self.seen += u16::from(self.seen < MOST_SEEN);
    }

    #[inline(always)]
    pub(crate) fn decide<C: Coder>(&mut self, coder: &mut C, bit: bool) -> bool {
        let bit = coder.bit(u32::from(self.one), bit);
        self.learn(bit);
        bit
    }
}

/// The state of the coder, the same at writer and reader.
#[derive(Debug, Clone)]
pub(crate) struct Counts {
    counts: Box<[[Count; NODES]; CONTEXTS]>,
    /// Whether differences of differences are coded.
    second: bool,
    last: i64,
    /// The last difference of the index, and the last coded difference.
    slope: i64,
    told: i64,
    /// Sixteen times the mean size of the coded differences.
    size: u64,
}

impl Counts {
    /// The state after the first index.
    pub(crate) fn new(first: i64, second: bool) -> Self {
        Self {
            counts: Box::new([[Count::NEW; NODES]; CONTEXTS]),
            second,
            last: first,
            slope: 0,
            told: 0,
            size: 16,
        }
    }

    /// The index from which the next difference is counted.
    #[inline(always)]
    fn expected(&self) -> i64 {
        self.last + if self.second { self.slope } else { 0 }
    }

    /// Whether differences of differences are smaller than differences.
    pub(crate) fn prefers_second(indices: &[i64]) -> bool {
        let bits = |d: i64| u64::from(64 - d.unsigned_abs().leading_zeros());
        let (mut first, mut second, mut slope) = (0, 0, 0);
        for pair in indices.windows(2) {
            let d = pair[1] - pair[0];
            first += bits(d);
            second += bits(d - slope);
            slope = d;
        }
        second < first
    }
}

impl State for Counts {
    fn last(&self) -> i64 {
        self.last
    }

    #[inline(always)]
    fn code<C: Coder>(&mut self, coder: &mut C, wanted: Option<i64>, _: [f64; JOINT_COLUMNS]) -> Result<i64, Damaged> {
        let expected = self.expected();
        // From mean size 4 on the lowest bits of differences are noise.
        let k = 64 - (self.size / 64).leading_zeros();
        let context = ((self.told >> k).clamp(-STEPS, STEPS) + STEPS) as usize % CONTEXTS;
        let counts = &mut self.counts[context];
        let d = wanted.map_or(0, |index| index - expected);
        let cell = d >> k;
        let difference = if counts[0].decide(coder, cell == 0) {
            0
        } else {
            let up = coder.even_bit(u32::from(counts[1].one), cell > 0);
            counts[1].learn(up);
            let wanted = cell.unsigned_abs();
            let mut size = 1;
            while size <= SIZES {
                let node = (1 + size as usize) % NODES;
                if !counts[node].decide(coder, wanted > size) {
                    break;
                }
                size += 1;
            }
            if size > SIZES {
                let over = gamma(coder, (wanted + 1).saturating_sub(size))?;
                size = size.saturating_add(over - 1);
            }
            // No writer codes a larger difference of differences.
            ensure!(size <= (8 * LARGEST as u64) >> k, damaged(i64::MAX));
            // Arithmetic instead of a branch: both signs are equally frequent.
            (2 * i64::from(up) - 1) * size as i64
        };
        let low = coder.raw((d - (cell << k)) as u64, k);
        Ok(expected + (difference << k) + low as i64)
    }

    #[inline(always)]
    fn learn(&mut self, index: i64) {
        self.told = index - self.expected();
        self.size = self.size - self.size / 16 + self.told.unsigned_abs();
        self.slope = index - self.last;
        self.last = index;
    }
}

/// Elias gamma code of a number above zero.
#[inline(always)]
pub(crate) fn gamma<C: Coder>(coder: &mut C, value: u64) -> Result<u64, Damaged> {
    let wanted = 63 - value.max(1).leading_zeros();
    let mut bits = 0;
    while coder.bit(1 << 15, bits < wanted) {
        bits += 1;
        // Differences of differences, the largest numbers, are at most 2^48 in size.
        ensure!(bits <= 48, damaged(i64::MAX));
    }
    Ok(1 << bits | coder.raw(value & ((1 << bits) - 1), bits))
}
