//! Laws of the next index: what each expert says about the probability below and above an edge.
//!
//! Positions are relative to the last index. All laws are logistic, as those of [`Filters`](super::filters::Filters).

use fewbits_node::elementary::power;

/// Probability below and above an edge, each accurate relative to itself.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tails {
    pub(super) below: f32,
    pub(super) above: f32,
}

/// `log2 e`: logistic laws are written in powers of two.
const LOG2_E: f32 = std::f32::consts::LOG2_E;
/// Beyond this many doublings a tail is flat.
pub(super) const FLAT: f32 = 60.0;
/// Mean absolute error of a prediction, fading with the past.
#[derive(Debug, Clone, Copy)]
pub(super) struct Track {
    pub(super) at: f32,
    pub(super) error: f32,
    sharpness: f32,
}

/// Weight of the newest error once many were seen.
const FADING: f32 = 0.025;

impl Track {
    pub(super) fn new() -> Self {
        Self {
            at: 0.0,
            error: 1.0,
            sharpness: Self::sharpness(1.0),
        }
    }

    /// Of the logistic law with a mean absolute error.
    #[inline(always)]
    fn sharpness(error: f32) -> f32 {
        LOG2_E / (0.72 * error + 0.06)
    }

    /// Weight of the newest of so many errors.
    #[inline(always)]
    pub(super) fn rate(seen: f32) -> f32 {
        (1.0 / (seen + 0.5)).max(FADING)
    }

    #[inline(always)]
    pub(super) fn update(&mut self, step: f32, rate: f32) {
        self.error += ((step - self.at).abs() - self.error) * rate;
        self.sharpness = Self::sharpness(self.error);
    }

    /// A logistic law about the prediction with the mean absolute error of the past.
    #[inline(always)]
    pub(super) fn tails(&self, edge: f32) -> Tails {
        let e = power(((self.at - edge) * self.sharpness).clamp(-FLAT, FLAT));
        let below = 1.0 / (1.0 + e);
        Tails {
            below,
            above: e * below,
        }
    }
}

/// Least squares of the next difference on `N` regressors, with fading memory.
#[derive(Debug, Clone)]
pub(super) struct LeastSquares<const N: usize> {
    pub(super) regressors: [f64; N],
    coefficients: [f64; N],
    covariance: [[f64; N]; N],
}

/// Weight of the past in each slot.
const MEMORY: f64 = 0.998;
/// Variances beyond this are no longer trusted: the memory is then emptied.
const LARGEST_VARIANCE: f64 = 1e9;
/// Predictions are no larger: `f32` keeps whole numbers up to there.
const FARTHEST: f64 = 4e6;

impl<const N: usize> LeastSquares<N> {
    pub(super) fn new() -> Self {
        Self {
            regressors: [0.0; N],
            coefficients: [0.0; N],
            covariance: Self::ignorant(),
        }
    }

    fn ignorant() -> [[f64; N]; N] {
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }))
    }

    #[inline(always)]
    pub(super) fn predict(&self) -> f32 {
        let mut sum = 0.0;
        for i in 0..N {
            sum += self.coefficients[i] * self.regressors[i];
        }
        sum.clamp(-FARTHEST, FARTHEST) as f32
    }

    /// Learns that the regressors led to `step`.
    #[inline(always)]
    pub(super) fn update(&mut self, step: f64) {
        let mut error = step;
        let mut gain = [0.0; N];
        let mut scale = MEMORY;
        for i in 0..N {
            error -= self.coefficients[i] * self.regressors[i];
            for j in 0..N {
                gain[i] += self.covariance[i][j] * self.regressors[j];
            }
            scale += gain[i] * self.regressors[i];
        }
        let inverse = 1.0 / scale;
        let mut trusted = true;
        for i in 0..N {
            let k = gain[i] * inverse;
            self.coefficients[i] += k * error;
            for j in 0..N {
                self.covariance[i][j] = (self.covariance[i][j] - k * gain[j]) * (1.0 / MEMORY);
            }
            trusted &= self.covariance[i][i] > 0.0 && self.covariance[i][i] < LARGEST_VARIANCE;
            trusted &= self.coefficients[i].abs() < LARGEST_VARIANCE;
        }
        if !trusted {
            self.covariance = Self::ignorant();
            if !self.coefficients.iter().all(|c| c.abs() < LARGEST_VARIANCE) {
                self.coefficients = [0.0; N];
            }
        }
    }
}

/// Indices counted one by one.
const WINDOW: usize = 4096;
/// Weight of an index that differs from the last one; a repeated one counts one.
const CHANGED: u32 = 8;
/// Weight of the filters' law among the counts.
const PRIOR: f32 = 12.0;

/// Counts in all after which no more are taken.
const MOST_COUNTED: u32 = 1 << 31;
/// Indices whose counts are summed one by one.
const BLOCK: usize = 32;

/// How often each index occurred: for signals whose values return.
#[derive(Debug, Clone)]
pub(super) struct Frequencies {
    counts: Vec<[u32; BLOCK]>,
    /// Counts below each block.
    below: [u32; WINDOW / BLOCK],
    total: u32,
    /// One over the total and the prior.
    inverse: f32,
    cells: Option<i64>,
    /// The index at the window's start.
    start: i64,
}

impl Frequencies {
    /// About the first index; on a circle of at most `WINDOW` cells all of them.
    pub(super) fn new(first: i64, cells: Option<i64>) -> Self {
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
    pub(super) fn add(&mut self, index: i64, changed: bool) {
        let offset = self.cells.map_or(index - self.start, |cells| index.rem_euclid(cells));
        if !(0..WINDOW as i64).contains(&offset) || self.total >= MOST_COUNTED {
            return;
        }
        let weight = if changed { CHANGED } else { 1 };
        let (block, place) = (offset as usize / BLOCK, offset as usize % BLOCK);
        self.counts[block][place] += weight;
        // All of them, so that the loop vectorises.
        for (b, below) in (0_i32..).zip(&mut self.below) {
            *below += if b > block as i32 { weight } else { 0 };
        }
        self.total += weight;
        self.inverse = 1.0 / (self.total as f32 + PRIOR);
    }

    /// Counts in the window below an offset from its start.
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

    /// Counts of indices below `edge`; around the circle, of those from the point opposite to `centre` on.
    #[inline(always)]
    fn below(&self, edge: i64, centre: i64) -> u32 {
        let Some(cells) = self.cells else {
            return self.prefix(edge - self.start);
        };
        let low = (centre - cells / 2).rem_euclid(cells);
        let length = (edge - (centre - cells / 2)).clamp(0, cells);
        let (first, end) = (self.prefix(low), low + length);
        if end <= cells {
            self.prefix(end) - first
        } else {
            self.total - first + self.prefix(end - cells)
        }
    }

    /// The law of the counts, filled up by the filters' law at the same edge (the first index above it).
    #[inline(always)]
    pub(super) fn tails(&self, edge: i64, centre: i64, filters: Tails) -> Tails {
        let below = self.below(edge, centre);
        Tails {
            below: (below as f32 + PRIOR * filters.below) * self.inverse,
            above: ((self.total - below) as f32 + PRIOR * filters.above) * self.inverse,
        }
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
