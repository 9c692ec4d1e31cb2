//! Adaptive frequencies: of residuals, and of values that return.

use serde::{Deserialize, Serialize};

/// Residuals counted one by one.
const WINDOW: i64 = 64;
/// Totals at which all counts are halved, so that the past fades.
const MOST: u32 = 1 << 15;
/// Weight of the geometric prior: `PRIOR / 2 x 2^-|k|` for residual `k`.
const PRIOR: f64 = 0.5;

/// Exact powers of one half.
fn half_to(power: i64) -> f64 {
    f64::from_bits(((1023 - power.clamp(0, 1000)) as u64) << 52)
}

/// How often each residual `k != 0` occurred.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Residuals {
    counts: Vec<u16>,
    total: u32,
}

impl Residuals {
    pub(crate) fn new() -> Self {
        Self {
            counts: vec![0; 2 * WINDOW as usize + 1],
            total: 0,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.counts.iter_mut().for_each(|c| *c = 0);
        self.total = 0;
    }

    pub(crate) fn is_valid(&self) -> bool {
        let sum: u32 = self.counts.iter().map(|c| u32::from(*c)).sum();
        self.counts.len() == 2 * WINDOW as usize + 1 && self.total <= MOST && sum <= self.total
    }

    fn slot(k: i64) -> Option<usize> {
        (-WINDOW..=WINDOW).contains(&k).then_some((k + WINDOW) as usize)
    }

    fn scale(&self) -> f64 {
        1.0 / (f64::from(self.total) + PRIOR)
    }

    /// Probability of `k` among the residuals that are not zero.
    pub(crate) fn probability(&self, k: i64) -> f64 {
        let count = Self::slot(k)
            .and_then(|i| self.counts.get(i))
            .map_or(0.0, |c| f64::from(*c));
        (count + 0.5 * PRIOR * half_to(k.abs().min(60))) * self.scale()
    }

    /// Probability of residuals below `k`.
    pub(crate) fn below(&self, k: i64) -> f64 {
        let counted = (k + WINDOW).clamp(0, 2 * WINDOW + 1) as usize;
        let count: u32 = self.counts[..counted].iter().map(|c| u32::from(*c)).sum();
        let prior = if k <= 0 { half_to(1 - k) } else { 1.0 - half_to(k) };
        (f64::from(count) + PRIOR * prior) * self.scale()
    }

    pub(crate) fn add(&mut self, k: i64) {
        if let Some(count) = Self::slot(k).and_then(|i| self.counts.get_mut(i)) {
            *count += 1;
        }
        self.total += 1;
        if self.total >= MOST {
            self.counts.iter_mut().for_each(|c| *c /= 2);
            self.total = self.counts.iter().map(|c| u32::from(*c)).sum();
        }
    }
}

/// Values remembered.
pub(crate) const CAPACITY: usize = 256;
/// Weight of a reported value; a silent slot counts one.
pub(crate) const REPORTED: u32 = 10;
/// Total at which all counts are halved.
const MOST_SEEN: u32 = 1 << 22;

/// How often each index occurred, for the indices worth remembering, in increasing order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Values {
    indices: Vec<i64>,
    counts: Vec<u32>,
    total: u32,
}

impl Values {
    pub(crate) fn new() -> Self {
        Self {
            indices: Vec::with_capacity(CAPACITY),
            counts: Vec::with_capacity(CAPACITY),
            total: 0,
        }
    }

    pub(crate) fn is_valid(&self) -> bool {
        let sum: u64 = self.counts.iter().map(|c| u64::from(*c)).sum();
        let ordered = self.indices.is_sorted_by(|a, b| a < b);
        let sized = self.indices.len() == self.counts.len() && self.counts.len() <= CAPACITY;
        ordered && sized && sum == u64::from(self.total) && self.total <= MOST_SEEN
    }

    /// Restores the room that a stored table lost.
    pub(crate) fn reserve(&mut self) {
        let room = CAPACITY.saturating_sub(self.counts.len());
        self.indices.reserve_exact(room);
        self.counts.reserve_exact(room);
    }

    pub(crate) fn clear(&mut self) {
        self.indices.clear();
        self.counts.clear();
        self.total = 0;
    }

    pub(crate) fn total(&self) -> u32 {
        self.total
    }

    fn rank(&self, j: i64) -> usize {
        self.indices.partition_point(|i| *i < j)
    }

    pub(crate) fn count(&self, j: i64) -> u32 {
        let at = self.rank(j);
        match self.indices.get(at) {
            Some(index) if *index == j => self.counts[at],
            _ => 0,
        }
    }

    /// Counts of the indices in `first..end`.
    pub(crate) fn between(&self, first: i64, end: i64) -> u32 {
        let chosen = self.counts.get(self.rank(first)..self.rank(end));
        chosen.map_or(0, |counts| counts.iter().sum())
    }

    pub(crate) fn add(&mut self, j: i64, weight: u32) {
        let mut at = self.rank(j);
        if self.indices.get(at) == Some(&j) {
            self.counts[at] += weight;
        } else {
            while self.counts.len() >= CAPACITY {
                self.halve();
                at = self.rank(j);
            }
            self.indices.insert(at, j);
            self.counts.insert(at, weight);
        }
        self.total += weight;
        while self.total > MOST_SEEN {
            self.halve();
        }
    }

    fn halve(&mut self) {
        let (mut kept, mut total) = (0, 0);
        for i in 0..self.counts.len() {
            let half = self.counts[i] / 2;
            if half > 0 {
                (self.indices[kept], self.counts[kept]) = (self.indices[i], half);
                (kept, total) = (kept + 1, total + half);
            }
        }
        self.indices.truncate(kept);
        self.counts.truncate(kept);
        self.total = total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_sum_to_one() {
        let mut counts = Residuals::new();
        for k in [1, -1, 3, 3, 64, -65, 2000, 1, 1] {
            let total: f64 = (-2100..=2100).filter(|k| *k != 0).map(|k| counts.probability(k)).sum();
            assert!((total - 1.0).abs() < 0.5, "{total}");
            for k in [-70, -64, -2, 0, 1, 5, 64, 65] {
                let step = counts.below(k + 1) - counts.below(k);
                let p = if k == 0 { 0.0 } else { counts.probability(k) };
                assert!((step - p).abs() < 1e-12, "{k}: {step} {p}");
            }
            counts.add(k);
        }
        for _ in 0..100_000 {
            counts.add(2);
        }
        assert!(counts.is_valid() && counts.probability(2) > 0.99);
    }

    #[test]
    fn values_are_bounded_and_the_frequent_stay() {
        let mut seen = Values::new();
        for j in 0..10_000 {
            seen.add(j, REPORTED);
            seen.add(-7, 1 + REPORTED);
            assert!(seen.is_valid());
        }
        assert!(seen.count(-7) > 100 && seen.count(9_999) == REPORTED);
        assert_eq!(seen.between(i64::MIN, i64::MAX), seen.total());
        assert_eq!(seen.between(i64::MIN, 0), seen.count(-7));
    }
}
