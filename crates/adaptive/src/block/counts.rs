//! Indices by counts of outcomes in few contexts: without a mixture, and some ten times as fast as `model.rs`.
//!
//! A difference (of the index, or of its differences, as the block's writer chose) is told in units of `2^k`, where `k` follows the mean size
//! of differences:
//!
//! ```text
//! zero?   sign   at least 2, 3, .. 13 ?   the rest by an Elias gamma code   k low bits
//! ```
//!
//! The probability of a decision is the mean of two counts: given the last difference, and given the last index.

use super::coder::Coder;
use super::rows::{JOINT_COLUMNS, LARGEST, State, damaged};
use fewbits_core::CodecError;

/// Decisions of a context: zero, sign, and whether the size is at least 2 to 15.
const NODES: usize = 16;
/// Sizes that are told one by one.
const SIZES: u64 = NODES as u64 - 2;
/// Differences are told apart up to this size.
const STEPS: i64 = 4;
/// Contexts of the last difference (more than there are: a power of two), and of the last index.
const DIFFERENCES: usize = 16;
const _: () = assert!(2 * STEPS < DIFFERENCES as i64);
const VALUES: usize = 64;
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
}

/// One decision by two counts.
#[inline(always)]
fn decide<C: Coder>(coder: &mut C, a: &mut Count, b: &mut Count, bit: bool) -> bool {
    let bit = coder.bit((u32::from(a.one) + u32::from(b.one)) / 2, bit);
    a.learn(bit);
    b.learn(bit);
    bit
}

/// The state that both ends hold.
#[derive(Debug, Clone)]
pub(super) struct Counts {
    differences: Box<[[Count; NODES]; DIFFERENCES]>,
    values: Box<[[Count; NODES]; VALUES]>,
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
            differences: Box::new([[Count::NEW; NODES]; DIFFERENCES]),
            values: Box::new([[Count::NEW; NODES]; VALUES]),
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
        // Of differences of mean size 3 and more the lowest bits are noise.
        let k = (64 - (self.size / 48).leading_zeros()).min(40);
        let difference = ((self.told >> k).clamp(-STEPS, STEPS) + STEPS) as usize % DIFFERENCES;
        let value = (self.last >> k) as usize % VALUES;
        let (told, value) = (&mut self.differences[difference], &mut self.values[value]);
        let d = wanted.map_or(0, |index| index - expected);
        let cell = d >> k;
        let difference = if decide(coder, &mut told[0], &mut value[0], cell == 0) {
            0
        } else {
            let up = decide(coder, &mut told[1], &mut value[1], cell > 0);
            let wanted = cell.unsigned_abs();
            let mut size = 1;
            while size <= SIZES {
                let node = (1 + size as usize) % NODES;
                if !decide(coder, &mut told[node], &mut value[node], wanted > size) {
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
            if up { size as i64 } else { -(size as i64) }
        };
        let low = coder.raw((d - (cell << k)) as u64, k);
        let d = (difference << k) + low as i64;
        let index = expected + d;
        if index.abs() > LARGEST {
            return Err(damaged(index));
        }
        self.size = self.size - self.size / 16 + d.unsigned_abs().min(1 << 44);
        self.told = d;
        self.slope = index - self.last;
        self.last = index;
        Ok(index)
    }
}

/// Elias gamma code of a number above zero.
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
