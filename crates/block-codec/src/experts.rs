//! Probability laws of the next index: what each expert predicts below and above an edge.
//!
//! Positions are relative to the last index. A prediction has a logistic law whose scale follows its past errors.

use crate::lanes::{Lanes, power};

/// Each expert's probability below and above an edge, both with a small relative error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tails {
    pub(crate) below: Lanes,
    pub(crate) above: Lanes,
}

/// `log2 e`: logistic laws are written in powers of two.
const LOG2_E: f32 = std::f32::consts::LOG2_E;
/// Distance, in doublings of the odds, beyond which a tail is constant.
const FLAT: f32 = 60.0;
/// Weight of the newest error in the mean, after many errors.
const FADING: f32 = 0.02;
/// Number of the expert [`Frequencies`]; other experts are predictions.
const PREDICTED: usize = 1;
const COUNTED: usize = 3;

/// Predictions with exponentially weighted means of their absolute errors; one place is unused.
#[derive(Debug, Clone)]
pub(crate) struct Tracks {
    pub(crate) at: Lanes,
    pub(crate) errors: Lanes,
    sharpness: Lanes,
}

impl Tracks {
    pub(crate) fn new() -> Self {
        let mut tracks = Self {
            at: Lanes::ZERO,
            errors: Lanes::ONE,
            sharpness: Lanes::ZERO,
        };
        tracks.sharpen();
        tracks
    }

    /// Computes the scales of the logistic laws from the mean absolute errors.
    #[inline(always)]
    fn sharpen(&mut self) {
        self.sharpness = Lanes::splat(LOG2_E) / (self.errors * 0.72 + 0.06);
    }

    /// Updates the errors with the actual step; `seen` is the number of earlier steps.
    #[inline(always)]
    pub(crate) fn update(&mut self, step: f32, seen: f32) {
        let rate = (1.0 / (seen + 1.5)).max(FADING);
        self.errors += ((Lanes::splat(step) - self.at).abs() - self.errors) * rate;
        self.sharpen();
    }

    /// The probabilities below and above an edge.
    #[inline(always)]
    pub(crate) fn tails(&self, edge: f32) -> Tails {
        let odds = (self.at - edge) * self.sharpness;
        let e = power(odds.fast_clamp(Lanes::splat(-FLAT), Lanes::splat(FLAT)));
        let below = Lanes::ONE / (e + 1.0);
        Tails {
            below,
            above: e * below,
        }
    }
}

/// Recursive least squares for the next difference on `N` regressors (a power of two), with exponential forgetting.
#[derive(Debug, Clone)]
pub(crate) struct LeastSquares<const N: usize> {
    pub(crate) regressors: [f64; N],
    coefficients: [f64; N],
    covariance: [[f64; N]; N],
}

/// Forgetting factor per slot.
const MEMORY: f64 = 0.998;
/// Prior variance of the coefficients.
const VARIANCE: f64 = 0.15;
/// If a variance exceeds this, the recursion starts again.
const LARGEST_VARIANCE: f64 = 1e9;
/// Largest size of a prediction: `f32` represents integers up to there.
const FARTHEST: f64 = 4e6;

/// The scalar product, summed in halves: an order that can be vectorised.
#[inline(always)]
fn product<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut terms = [0.0; N];
    for i in 0..N {
        terms[i] = a[i] * b[i];
    }
    let mut half = N / 2;
    while half > 0 {
        for i in 0..half {
            terms[i] += terms[i + half];
        }
        half /= 2;
    }
    terms[0]
}

impl<const N: usize> LeastSquares<N> {
    pub(crate) fn new() -> Self {
        Self {
            regressors: [0.0; N],
            coefficients: [0.0; N],
            covariance: Self::ignorant(),
        }
    }

    fn ignorant() -> [[f64; N]; N] {
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { VARIANCE } else { 0.0 }))
    }

    #[inline(always)]
    pub(crate) fn predict(&self) -> f32 {
        product(&self.coefficients, &self.regressors).clamp(-FARTHEST, FARTHEST) as f32
    }

    /// Updates with the actual `step` that followed the regressors.
    #[inline(always)]
    pub(crate) fn update(&mut self, step: f64) {
        // `P x`, from the rows of the symmetric `P`.
        let mut gain = [0.0; N];
        for (row, regressor) in self.covariance.iter().zip(&self.regressors) {
            for i in 0..N {
                gain[i] += row[i] * regressor;
            }
        }
        let error = step - product(&self.coefficients, &self.regressors);
        // Recursive least squares with forgetting: the gain is `P x / (memory + x' P x)`.
        let inverse = 1.0 / (MEMORY + product(&gain, &self.regressors));
        let mut is_sound = true;
        for i in 0..N {
            self.coefficients[i] += gain[i] * inverse * error;
            is_sound &= self.coefficients[i].abs() < LARGEST_VARIANCE;
        }
        for (i, row) in self.covariance.iter_mut().enumerate() {
            let k = gain[i] * inverse;
            for j in 0..N {
                row[j] = (row[j] - k * gain[j]) * (1.0 / MEMORY);
            }
            is_sound &= (row[i] < LARGEST_VARIANCE) & (row[i] > 0.0);
        }
        // In a direction that is never excited the variance grows exponentially: start again before it overflows.
        if !is_sound {
            self.covariance = Self::ignorant();
            if !self.coefficients.iter().all(|c| c.abs() < LARGEST_VARIANCE) {
                self.coefficients = [0.0; N];
            }
        }
    }
}

/// Number of consecutive indices that have counts.
const WINDOW: usize = 4096;
/// Weight of an index that differs from the last one; a repeated index has weight one.
const CHANGED: u32 = 8;
/// Weight of a prediction's law relative to the counts.
const PRIOR: f32 = 12.0;

/// Total count at which counting stops.
const MOST_COUNTED: u32 = 1 << 30;
/// Number of indices per partial sum.
const BLOCK: usize = 32;

/// How often each index occurred, for signals whose values return.
#[derive(Debug, Clone)]
pub(crate) struct Frequencies {
    counts: Vec<[u32; BLOCK]>,
    /// Sum of the counts below each group of `BLOCK` indices, without the last counts of one group.
    below: [u32; WINDOW / BLOCK],
    /// That group, and the sum of these counts.
    newest: (usize, u32),
    total: u32,
    /// Reciprocal of the total count plus the prior's weight.
    inverse: f32,
    cells: Option<i64>,
    /// First index of the window.
    start: i64,
}

impl Frequencies {
    /// A window centred on the first index. On a circle of at most `WINDOW` cells it holds all of them.
    pub(crate) fn new(first: i64, cells: Option<i64>) -> Self {
        let cells = cells.filter(|cells| *cells <= WINDOW as i64);
        Self {
            counts: vec![[0; BLOCK]; WINDOW / BLOCK],
            below: [0; WINDOW / BLOCK],
            newest: (0, 0),
            total: 0,
            inverse: 1.0 / PRIOR,
            cells,
            start: if cells.is_some() { 0 } else { first - WINDOW as i64 / 2 },
        }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, index: i64, changed: bool) {
        let offset = self.offset(index);
        if !(0..WINDOW as i64).contains(&offset) || self.total >= MOST_COUNTED {
            return;
        }
        let weight = if changed { CHANGED } else { 1 };
        let (block, place) = (offset as usize / BLOCK, offset as usize % BLOCK);
        self.counts[block][place] += weight;
        // Neighbouring rows are most often in one group, for which the sums are updated together.
        if block == self.newest.0 {
            self.newest.1 += weight;
        } else {
            let (newest, counted) = std::mem::replace(&mut self.newest, (block, weight));
            // Visit all groups, so that the loop can be vectorised.
            for (b, below) in (0_i32..).zip(&mut self.below) {
                *below += if b > newest as i32 { counted } else { 0 };
            }
        }
        self.total += weight;
        self.inverse = 1.0 / (self.total as f32 + PRIOR);
    }

    /// Sum of the counts below an offset from the window's start.
    #[inline(always)]
    fn prefix(&self, offset: i64) -> u32 {
        if offset >= WINDOW as i64 {
            return self.total;
        }
        let offset = offset.max(0) as usize;
        let (block, place) = (offset / BLOCK, (offset % BLOCK) as i32);
        let mut sum = self.below[block] + if block > self.newest.0 { self.newest.1 } else { 0 };
        for (i, count) in (0_i32..).zip(&self.counts[block]) {
            sum += if i < place { *count } else { 0 };
        }
        sum
    }

    /// Sum of the counts of indices below `edge`. On a circle it starts at the point opposite to `centre`.
    #[inline(always)]
    fn below(&self, edge: i64, centre: i64) -> u32 {
        let Some(cells) = self.cells else {
            return self.prefix(edge - self.start);
        };
        let low = (centre - cells / 2).rem_euclid(cells);
        let length = (edge - (centre - cells / 2)).clamp(0, cells);
        // The stretch from `low` may pass the end of the window and go on at its start.
        let (first, end) = (self.prefix(low), low + length);
        if end <= cells {
            self.prefix(end) - first
        } else {
            self.total - first + self.prefix(end - cells)
        }
    }

    /// Adds the law of the counts, combined with a prediction's law as prior, to the tails at an edge (the first index above it).
    #[inline(always)]
    pub(crate) fn complete(&self, edge: i64, centre: i64, tails: &mut Tails) {
        self.fill(self.below(edge, centre), tails);
    }

    #[inline(always)]
    fn fill(&self, below: u32, tails: &mut Tails) {
        let law = |tail: &mut Lanes, counted: u32| {
            let tail = tail.as_mut_array();
            tail[COUNTED] = (counted as i32 as f32 + PRIOR * tail[PREDICTED]) * self.inverse;
        };
        law(&mut tails.below, below);
        law(&mut tails.above, self.total - below);
    }

    /// As [`complete`](Self::complete), for both edges of the cell `first..next`.
    #[inline(always)]
    pub(crate) fn complete_cell(&self, first: i64, next: i64, centre: i64, tails: &mut [Tails; 2]) {
        let below = self.below(first, centre);
        let inside = if next - first == 1 {
            let offset = self.offset(first);
            let counted = (0..WINDOW as i64).contains(&offset);
            if counted {
                self.counts[offset as usize / BLOCK][offset as usize % BLOCK]
            } else {
                0
            }
        } else {
            self.below(next, centre) - below
        };
        self.fill(below, &mut tails[0]);
        self.fill(below + inside, &mut tails[1]);
    }

    #[inline(always)]
    fn offset(&self, index: i64) -> i64 {
        self.cells.map_or(index - self.start, |cells| index.rem_euclid(cells))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_count_as_brute_force_does() {
        for cells in [None, Some(10), Some(4096), Some(5000)] {
            let mut frequencies = Frequencies::new(3, cells);
            let mut seen = Vec::new();
            for i in 0..400_i64 {
                let index = (i * i) % 37 - 12;
                frequencies.add(index, true);
                seen.push(index);
                let (centre, edge) = (i % 11, i % 11 + i % 5 - 2);
                let expected = match cells.filter(|cells| *cells <= 4096) {
                    None => seen.iter().filter(|x| **x < edge).count(),
                    Some(cells) => {
                        let low = centre - cells / 2;
                        seen.iter()
                            .filter(|x| (**x - low).rem_euclid(cells) < (edge - low).clamp(0, cells))
                            .count()
                    }
                };
                assert_eq!(frequencies.below(edge, centre), CHANGED * expected as u32, "{cells:?} {i}");
            }
        }
    }

    #[test]
    fn least_squares_finds_a_recursion_and_survives_extremes() {
        let mut squares = LeastSquares::<2>::new();
        let (mut a, mut b) = (100.0, 50.0);
        for _ in 0..100 {
            squares.regressors = [a, b];
            let next = 1.6 * a - 0.9 * b;
            squares.update(next);
            (b, a) = (a, next);
        }
        assert!((squares.coefficients[0] - 1.6).abs() < 0.1 && (squares.coefficients[1] + 0.9).abs() < 0.1);
        for extreme in [1e15, -1e15, 0.0, 1e15, 1.0] {
            squares.regressors = [extreme, -extreme];
            squares.update(-extreme);
            assert!(squares.predict().is_finite());
        }
    }
}
