//! Probability laws of the next index: what each expert predicts below and above an edge.
//!
//! Positions are relative to the last index. A prediction has a logistic law whose scale follows its past errors.

use crate::mixer::EXPERTS;
use fewbits_node::elementary::power;

/// Each expert's probability below and above an edge, both with a small relative error.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Tails {
    pub(crate) below: [f32; EXPERTS],
    pub(crate) above: [f32; EXPERTS],
}

/// `log2 e`: logistic laws are written in powers of two.
const LOG2_E: f32 = std::f32::consts::LOG2_E;
/// Distance, in doublings of the odds, beyond which a tail is constant.
const FLAT: f32 = 60.0;
/// Weight of the newest error in the mean, after many errors.
const FADING: f32 = 0.02;
/// Number of the expert [`Frequencies`]; other experts are predictions.
pub(crate) const PREDICTED: usize = 1;
pub(crate) const COUNTED: usize = EXPERTS - 1;
/// Places for predictions; one is unused.
const TRACKS: usize = EXPERTS;

/// Predictions with exponentially weighted means of their absolute errors.
#[derive(Debug, Clone)]
pub(crate) struct Tracks {
    pub(crate) at: [f32; TRACKS],
    pub(crate) errors: [f32; TRACKS],
    sharpness: [f32; TRACKS],
}

impl Tracks {
    pub(crate) fn new() -> Self {
        let mut tracks = Self {
            at: [0.0; TRACKS],
            errors: [1.0; TRACKS],
            sharpness: [0.0; TRACKS],
        };
        tracks.sharpen();
        tracks
    }

    /// Computes the scales of the logistic laws from the mean absolute errors.
    #[inline(always)]
    fn sharpen(&mut self) {
        for i in 0..TRACKS {
            self.sharpness[i] = LOG2_E / (0.72 * self.errors[i] + 0.06);
        }
    }

    /// Updates the errors with the actual step; `seen` is the number of earlier steps.
    #[inline(always)]
    pub(crate) fn update(&mut self, step: f32, seen: f32) {
        let rate = (1.0 / (seen + 1.5)).max(FADING);
        for i in 0..TRACKS {
            self.errors[i] += ((step - self.at[i]).abs() - self.errors[i]) * rate;
        }
        self.sharpen();
    }

    /// The probabilities below and above an edge.
    #[inline(always)]
    pub(crate) fn tails(&self, edge: f32) -> Tails {
        let mut tails = Tails::default();
        for i in 0..TRACKS {
            let odds = (self.at[i] - edge) * self.sharpness[i];
            let e = power(odds.clamp(-FLAT, FLAT));
            tails.below[i] = 1.0 / (1.0 + e);
            tails.above[i] = e * tails.below[i];
        }
        tails
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
        let (mut largest, mut least) = (0.0_f64, f64::INFINITY);
        for i in 0..N {
            self.coefficients[i] += gain[i] * inverse * error;
            largest = largest.max(self.coefficients[i].abs());
        }
        for (i, row) in self.covariance.iter_mut().enumerate() {
            let k = gain[i] * inverse;
            for j in 0..N {
                row[j] = (row[j] - k * gain[j]) * (1.0 / MEMORY);
            }
            (largest, least) = (largest.max(row[i]), least.min(row[i]));
        }
        // In a direction that is never excited the variance grows exponentially: start again before it overflows.
        if !(largest < LARGEST_VARIANCE && least > 0.0) {
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
const BLOCK: usize = 64;

/// How often each index occurred, for signals whose values return.
#[derive(Debug, Clone)]
pub(crate) struct Frequencies {
    counts: Vec<[u32; BLOCK]>,
    /// Sum of the counts below each group of `BLOCK` indices.
    below: [u32; WINDOW / BLOCK],
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
        // Visit all groups, so that the loop can be vectorised.
        for (b, below) in (0_i32..).zip(&mut self.below) {
            *below += if b > block as i32 { weight } else { 0 };
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
        let mut sum = self.below[block];
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
        tails.below[COUNTED] = (below as i32 as f32 + PRIOR * tails.below[PREDICTED]) * self.inverse;
        tails.above[COUNTED] = ((self.total - below) as i32 as f32 + PRIOR * tails.above[PREDICTED]) * self.inverse;
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
