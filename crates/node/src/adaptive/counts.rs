//! Adaptive frequencies of residuals, and of values that occur repeatedly.

use fewbits_numerics::kernels::vectorised;

/// Largest size of a residual that has its own count.
const WINDOW: i64 = 64;
/// Number of counts of residuals.
const COUNTS: usize = 2 * WINDOW as usize + 1;
/// Total at which all counts are halved, so that old residuals lose weight.
const MOST: u32 = 1 << 15;
/// Weight of the geometric prior: `PRIOR / 2 x 2^-|k|` for residual `k`.
const PRIOR: f32 = 0.5;

/// `2^-power`, exactly.
fn half_to(power: i64) -> f32 {
    f32::from_bits(((127 - power.clamp(0, 100)) as u32) << 23)
}

/// How often each residual `k != 0` occurred. Old occurrences lose weight.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Residuals {
    counts: [u16; COUNTS],
    total: u32,
}

impl Residuals {
    pub(super) const NONE: Self = Self {
        counts: [0; COUNTS],
        total: 0,
    };

    /// Counts of the residuals from -64 to 64, and the number of all residuals.
    #[cfg(any(test, feature = "serde"))]
    pub(crate) fn to_counts(&self) -> (&[u16], u32) {
        (&self.counts, self.total)
    }

    /// The inverse of [`to_counts`](Self::to_counts); `None` if the numbers cannot be its result.
    #[cfg(any(test, feature = "serde"))]
    pub(crate) fn from_counts(counts: &[u16], total: u32) -> Option<Self> {
        let sum: u32 = counts.iter().map(|c| u32::from(*c)).sum();
        let counts = counts.try_into().ok()?;
        (total <= MOST && sum <= total).then_some(Self { counts, total })
    }

    pub(super) fn clear(&mut self) {
        self.counts.fill(0);
        self.total = 0;
    }

    fn count_mut(&mut self, k: i64) -> Option<&mut u16> {
        self.counts.get_mut(usize::try_from(k + WINDOW).ok()?)
    }

    fn scale(&self) -> f32 {
        1.0 / (self.total as f32 + PRIOR)
    }

    /// Probability of `k` among the residuals that are not zero.
    pub(crate) fn probability(&self, k: i64) -> f32 {
        let at = usize::try_from(k + WINDOW).ok();
        let count = at.and_then(|at| self.counts.get(at)).copied().unwrap_or(0);
        (f32::from(count) + 0.5 * PRIOR * half_to(k.abs().min(60))) * self.scale()
    }

    /// Probability of residuals below `k`.
    pub(crate) fn below(&self, k: i64) -> f32 {
        let counted = (k + WINDOW).clamp(0, COUNTS as i64) as usize;
        let count: u32 = self.counts.iter().take(counted).map(|c| u32::from(*c)).sum();
        let prior = if k <= 0 { half_to(1 - k) } else { 1.0 - half_to(k) };
        (count as f32 + PRIOR * prior) * self.scale()
    }

    pub(super) fn add(&mut self, k: i64) {
        if let Some(count) = self.count_mut(k) {
            *count += 1;
        }
        self.total += 1;
        if self.total >= MOST {
            self.counts.iter_mut().for_each(|c| *c /= 2);
            self.total = self.counts.iter().map(|c| u32::from(*c)).sum();
        }
    }
}

/// Largest number of remembered indices.
pub(crate) const CAPACITY: usize = 240;
/// Weight of a reported index; that of a silent slot has weight one.
pub(crate) const REPORTED: u32 = 10;
/// Total at which all counts are halved.
const MOST_SEEN: u32 = 1 << 22;

/// Bits of a count minus one: before it is halved, a count is at most `2^22` plus one weight.
const COUNT_BITS: u32 = 23;
const COUNT_MASK: u64 = (1 << COUNT_BITS) - 1;
/// Smallest stored index; the largest is `-LOWEST - 1`. A sensor can have two indices beyond, and a receiver after undetected damage
/// others. Both ends store them as the nearest allowed index.
const LOWEST: i64 = -(1 << 40);

/// How often each index occurred, for at most 240 indices, in increasing order.
///
/// An index and its count share a word of 64 bits, with the index in the higher bits. The table takes 1,920 bytes, and words are in the
/// order of their indices.
#[derive(Debug, Clone)]
pub(crate) struct Values {
    entries: [u64; CAPACITY],
    len: usize,
    total: u32,
}

/// Only the remembered indices are compared.
impl PartialEq for Values {
    fn eq(&self, other: &Self) -> bool {
        self.stored() == other.stored()
    }
}

/// The smallest word with this index.
fn entry_of(j: i64) -> u64 {
    ((j.clamp(LOWEST, -LOWEST - 1) - LOWEST) as u64) << COUNT_BITS
}

fn count_of(entry: u64) -> u32 {
    (entry & COUNT_MASK) as u32 + 1
}

impl Values {
    pub(super) const NONE: Self = Self {
        entries: [0; CAPACITY],
        len: 0,
        total: 0,
    };

    /// Indices with their counts, in increasing order.
    #[cfg(any(test, feature = "serde"))]
    pub(crate) fn iter(&self) -> impl Iterator<Item = (i64, u32)> {
        let index = |entry: u64| (entry >> COUNT_BITS) as i64 + LOWEST;
        self.stored().iter().map(move |entry| (index(*entry), count_of(*entry)))
    }

    /// The inverse of [`iter`](Self::iter). `None` unless there are at most 240 increasing indices with counts above zero and not too
    /// large.
    #[cfg(any(test, feature = "serde"))]
    pub(crate) fn from_counts(counts: impl IntoIterator<Item = (i64, u32)>) -> Option<Self> {
        let mut values = Self::NONE;
        let mut before = None;
        for (index, count) in counts {
            let fits = (LOWEST..-LOWEST).contains(&index) && before.is_none_or(|before| before < index);
            if !fits || !(1..=MOST_SEEN).contains(&count) {
                return None;
            }
            *values.entries.get_mut(values.len)? = entry_of(index) + u64::from(count - 1);
            values.len += 1;
            values.total += count;
            before = Some(index);
            if values.total > MOST_SEEN {
                return None;
            }
        }
        Some(values)
    }

    pub(super) fn clear(&mut self) {
        self.len = 0;
        self.total = 0;
    }

    /// The sum of all counts.
    pub(crate) fn total(&self) -> u32 {
        self.total
    }

    fn stored(&self) -> &[u64] {
        self.entries.get(..self.len).unwrap_or(&[])
    }

    fn rank(&self, j: i64) -> usize {
        let least = entry_of(j);
        self.stored().partition_point(|entry| *entry < least)
    }

    /// How often an index occurred.
    pub(crate) fn count(&self, j: i64) -> u32 {
        match self.stored().get(self.rank(j)) {
            Some(entry) if (entry ^ entry_of(j)) >> COUNT_BITS == 0 => count_of(*entry),
            _ => 0,
        }
    }

    /// Counts of the indices in `first..end`.
    pub(crate) fn between(&self, first: i64, end: i64) -> u32 {
        let chosen = self.stored().get(self.rank(first)..self.rank(end));
        let entries = chosen.unwrap_or(&[]);
        vectorised(
            #[inline(always)]
            || entries.iter().map(|entry| count_of(*entry)).sum(),
        )
    }

    pub(super) fn add(&mut self, j: i64, weight: u32) {
        let mut at = self.rank(j);
        match self.entries.get_mut(..self.len).and_then(|stored| stored.get_mut(at)) {
            // No overflow: the count is at most the total, which was at most `MOST_SEEN`.
            Some(entry) if (*entry ^ entry_of(j)) >> COUNT_BITS == 0 => *entry += u64::from(weight),
            _ => {
                while self.len >= CAPACITY {
                    self.halve();
                    at = self.rank(j);
                }
                self.len += 1;
                // Insert the new word: every later word moves to the next place.
                let mut pushed = entry_of(j) + u64::from(weight - 1);
                for place in self.entries.iter_mut().take(self.len).skip(at) {
                    core::mem::swap(place, &mut pushed);
                }
            }
        }
        self.total += weight;
        while self.total > MOST_SEEN {
            self.halve();
        }
    }

    fn halve(&mut self) {
        let (mut kept, mut total) = (0, 0);
        for i in 0..self.len.min(CAPACITY) {
            let entry = self.entries[i];
            let half = count_of(entry) / 2;
            if half > 0 {
                if let Some(place) = self.entries.get_mut(kept) {
                    *place = (entry & !COUNT_MASK) + u64::from(half - 1);
                }
                (kept, total) = (kept + 1, total + half);
            }
        }
        self.len = kept;
        self.total = total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_sum_to_one() {
        let mut counts = Residuals::NONE;
        for k in [1, -1, 3, 3, 64, -65, 2000, 1, 1] {
            let total: f32 = (-2100..=2100).filter(|k| *k != 0).map(|k| counts.probability(k)).sum();
            assert!((total - 1.0).abs() < 0.5, "{total}");
            for k in [-70, -64, -2, 0, 1, 5, 64, 65] {
                let step = counts.below(k + 1) - counts.below(k);
                let p = if k == 0 { 0.0 } else { counts.probability(k) };
                assert!((step - p).abs() < 1e-6, "{k}: {step} {p}");
            }
            counts.add(k);
        }
        for _ in 0..100_000 {
            counts.add(2);
        }
        let (stored, total) = counts.to_counts();
        assert_eq!(Residuals::from_counts(stored, total).as_ref(), Some(&counts));
        assert!(counts.probability(2) > 0.99);
    }

    #[test]
    fn values_are_bounded_and_the_frequent_stay() {
        let mut seen = Values::NONE;
        for j in 0..10_000 {
            seen.add(j, REPORTED);
            seen.add(-7, 1 + REPORTED);
            if j % 100 == 0 {
                assert_eq!(Values::from_counts(seen.iter()).as_ref().map(|again| again.stored()), Some(seen.stored()));
            }
        }
        assert!(seen.count(-7) > 100 && seen.count(9_999) == REPORTED);
        assert_eq!(seen.between(i64::MIN, i64::MAX), seen.total());
        assert_eq!(seen.between(i64::MIN, 0), seen.count(-7));
    }

    /// A table of pairs, as plain as can be, beside the packed one.
    #[test]
    fn packed_values_are_those_of_a_plain_table() {
        let (mut packed, mut plain) = (Values::NONE, std::collections::BTreeMap::<i64, u32>::new());
        let halve = |plain: &mut std::collections::BTreeMap<i64, u32>| {
            plain.values_mut().for_each(|count| *count /= 2);
            plain.retain(|_, count| *count > 0);
        };
        let mut signal = crate::golden::Signal::new(8);
        for n in 0..6_000 {
            let r = signal.random();
            let size = r >> 58;
            let j = if size < 40 {
                (r % (1 << size)) as i64 - (1 << size) / 2
            } else {
                3
            };
            let weight = if n % 500 == 0 {
                1 << 21
            } else {
                1 + (r >> 40) as u32 % 10
            };
            if !plain.contains_key(&j) {
                while plain.len() >= CAPACITY {
                    halve(&mut plain);
                }
            }
            *plain.entry(j).or_insert(0) += weight;
            while plain.values().sum::<u32>() > MOST_SEEN {
                halve(&mut plain);
            }
            packed.add(j, weight);
            assert!(packed.iter().eq(plain.iter().map(|(j, count)| (*j, *count))), "{n}");
            assert_eq!((packed.count(j), packed.total()), (plain.get(&j).copied().unwrap_or(0), plain.values().sum()));
        }
        assert_eq!(packed.between(-100, 100), plain.range(-100..100).map(|(_, count)| count).sum());
    }
}
