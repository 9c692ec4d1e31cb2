//! Indices by counts of outcomes given the last difference: without a mixture, and more than ten times as fast as `model.rs`.
//!
//! A difference (of the index, or of its differences, as the block's writer chose) is told in units of `2^k`, where `k` follows the mean size
//! of differences:
//!
//! ```text
//! zero?   sign   at least 2, 3, .. 15?   the rest by an Elias gamma code   k low bits
//! ```
//!
//! A second count of each decision, given the last index, would save 3 % of the bits; reading would take a third longer.

use super::coder::Coder;
use super::rows::{JOINT_COLUMNS, LARGEST, State, damaged};
use fewbits_core::CodecError;

/// Decisions of a context: zero, sign, and whether the size is at least 2 to 15.
const NODES: usize = 16;
/// Sizes that are told one by one.
const SIZES: u64 = NODES as u64 - 2;
/// Last differences are told apart up to this size.
const STEPS: i64 = 4;
/// Contexts. More than there are: a power of two.
const CONTEXTS: usize = 16;
const _: () = assert!(2 * STEPS < CONTEXTS as i64);
/// Occurrences after which a count forgets.
const MOST_SEEN: u16 = 40;

/// Probability of `true` in units of `2^-16`, and how often the decision was seen.
#[derive(Debug, Clone, Copy)]
struct Count {
    one: u16,
    seen: u16,
}

/// `2^15 / (n + 1.6)`. A power of two of them, so that no index is out of reach.
const SHARES: [i32; 64] = {
    let mut shares = [0; 64];
    let mut seen = 0;
    while seen < shares.len() {
        shares[seen] = 327_680 / (10 * seen as i32 + 16);
        seen += 1;
    }
    shares
};

/// Probabilities move towards these, so that they stay this far from certainty.
const LEAST: i32 = 32;
const MOST: i32 = 65_535 - LEAST;

impl Count {
    const NEW: Self = Self { one: 1 << 15, seen: 0 };

    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let (one, share) = (i32::from(self.one), SHARES[usize::from(self.seen) % SHARES.len()]);
        let target = if bit { MOST } else { LEAST };
        self.one = (one + (((target - one) * share) >> 15)) as u16;
        self.seen += u16::from(self.seen < MOST_SEEN);
    }

    #[inline(always)]
    fn decide<C: Coder>(&mut self, coder: &mut C, bit: bool) -> bool {
        let bit = coder.bit(u32::from(self.one), bit);
        self.learn(bit);
        bit
    }
}

/// The state that both ends hold.
#[derive(Debug, Clone)]
pub(super) struct Counts {
    counts: Box<[[Count; NODES]; CONTEXTS]>,
    /// Whether differences of differences are told.
    second: bool,
    last: i64,
    /// The last difference of the index, and the one that was told.
    slope: i64,
    told: i64,
    /// Sixteen times the mean size of what was told.
    size: u64,
}

impl Counts {
    /// After the first index.
    pub(super) fn new(first: i64, second: bool) -> Self {
        Self {
            counts: Box::new([[Count::NEW; NODES]; CONTEXTS]),
            second,
            last: first,
            slope: 0,
            told: 0,
            size: 16,
        }
    }

    /// Whether differences of differences are smaller.
    pub(super) fn prefers_second(indices: &[i64]) -> bool {
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
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        wanted: Option<i64>,
        _: [f64; JOINT_COLUMNS],
    ) -> Result<i64, CodecError> {
        let expected = self.last + if self.second { self.slope } else { 0 };
        // Of differences of mean size 4 and more the lowest bits are noise.
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
            // No writer's differences of differences are larger.
            if size > (8 * LARGEST as u64) >> k {
                return Err(damaged(i64::MAX));
            }
            // Arithmetic, not a branch: it goes either way as often.
            (2 * i64::from(up) - 1) * size as i64
        };
        let low = coder.raw((d - (cell << k)) as u64, k);
        let d = (difference << k) + low as i64;
        let index = expected + d;
        if index.abs() > LARGEST {
            return Err(damaged(index));
        }
        self.size = self.size - self.size / 16 + d.unsigned_abs();
        self.told = d;
        self.slope = index - self.last;
        self.last = index;
        Ok(index)
    }
}

/// Elias gamma code of a number above zero.
#[inline(always)]
pub(super) fn gamma<C: Coder>(coder: &mut C, value: u64) -> Result<u64, CodecError> {
    let wanted = 63 - value.max(1).leading_zeros();
    let mut bits = 0;
    while coder.bit(1 << 15, bits < wanted) {
        bits += 1;
        if bits > 48 {
            return Err(damaged(i64::MAX));
        }
    }
    Ok(1 << bits | coder.raw(value & ((1 << bits) - 1), bits))
}
