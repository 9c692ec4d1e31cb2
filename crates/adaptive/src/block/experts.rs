//! Laws of the next index: what each expert says about the probability below and above an edge.
//!
//! Positions are relative to the last index. All laws are logistic, as those of [`fewbits_node::adaptive::Bank`], whose 24 filters [`Filters`] runs in
//! `f32`.

use super::elementary::exp2;
use super::priors::FILTER_WEIGHTS;
use fewbits_node::adaptive::{DECAYS, MODELS, SCALES, steady_gains};
use fewbits_numerics::kernels::vectorised;
use std::sync::LazyLock;

/// Probability below and above an edge, each accurate relative to itself.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tails {
    pub(super) below: f32,
    pub(super) above: f32,
}

/// `log2 e`: logistic laws are written in powers of two.
const LOG2_E: f64 = std::f64::consts::LOG2_E;
/// Beyond this many doublings a tail is flat.
const FLAT: f32 = 60.0;
/// Share of the weights that is spread evenly before each slot.
const SWITCHING: f32 = 0.005;
/// The least evidence of one slot, and the least weight: far above the smallest normal number.
const LEAST_EVIDENCE: f32 = 1e-12;
const LEAST_WEIGHT: f32 = 1e-18;

struct Gains {
    sharpness: [f32; MODELS],
    position: [f32; MODELS],
    velocity: [f32; MODELS],
}

static GAINS: LazyLock<Gains> = LazyLock::new(|| {
    let mut gains = Gains {
        sharpness: [0.0; MODELS],
        position: [0.0; MODELS],
        velocity: [0.0; MODELS],
    };
    for m in 0..MODELS {
        let [sharpness, position, velocity] = steady_gains(m);
        gains.sharpness[m] = (sharpness * LOG2_E) as f32;
        gains.position[m] = position as f32;
        gains.velocity[m] = velocity as f32;
    }
    gains
});

/// The bank of filters, weighted by what they predicted.
#[derive(Debug, Clone)]
pub(super) struct Filters {
    position: [f32; MODELS],
    velocity: [f32; MODELS],
    weight: [f32; MODELS],
}

/// The sum in eight lanes, then of the lanes: an order that vectorises.
#[inline(always)]
fn sum(terms: &[f32; MODELS]) -> f32 {
    let mut lanes = [0.0_f32; 8];
    for chunk in terms.chunks_exact(8) {
        for (lane, term) in lanes.iter_mut().zip(chunk) {
            *lane += term;
        }
    }
    ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]))
}

impl Filters {
    pub(super) fn new() -> Self {
        Self {
            position: [0.0; MODELS],
            velocity: [0.0; MODELS],
            weight: FILTER_WEIGHTS,
        }
    }

    /// The time update; returns the mean.
    #[inline(always)]
    pub(super) fn predict(&mut self) -> f32 {
        let mut terms = [0.0; MODELS];
        for m in 0..MODELS {
            self.weight[m] = self.weight[m] * (1.0 - SWITCHING) + SWITCHING / MODELS as f32;
            self.velocity[m] *= DECAYS[m / SCALES] as f32;
            self.position[m] += self.velocity[m];
            terms[m] = self.weight[m] * self.position[m];
        }
        sum(&terms)
    }

    #[inline(always)]
    pub(super) fn tails(&self, edge: f32) -> Tails {
        let sharpness = &GAINS.sharpness;
        vectorised(
            #[inline(always)]
            || {
                let (mut below, mut above) = ([0.0; MODELS], [0.0; MODELS]);
                for m in 0..MODELS {
                    let e = exp2(((self.position[m] - edge) * sharpness[m]).clamp(-FLAT, FLAT));
                    let share = self.weight[m] / (1.0 + e);
                    below[m] = share;
                    above[m] = e * share;
                }
                Tails {
                    below: sum(&below),
                    above: sum(&above),
                }
            },
        )
    }

    /// The measurement update with an index `step` from the last one, which becomes the origin.
    #[inline(always)]
    pub(super) fn update(&mut self, step: f32) {
        let gains = &*GAINS;
        vectorised(
            #[inline(always)]
            || {
                let mut evidence = [0.0; MODELS];
                for m in 0..MODELS {
                    let residual = step - self.position[m];
                    let z = (residual.abs() * gains.sharpness[m]).min(FLAT);
                    let half = 0.5 * gains.sharpness[m];
                    let (wide, narrow) = (exp2(half - z), exp2(-half - z));
                    evidence[m] =
                        self.weight[m] * ((wide - narrow) / ((1.0 + wide) * (1.0 + narrow))).max(LEAST_EVIDENCE);
                    self.position[m] += gains.position[m] * residual - step;
                    self.velocity[m] += gains.velocity[m] * residual;
                }
                let inverse = 1.0 / sum(&evidence);
                for m in 0..MODELS {
                    self.weight[m] = (evidence[m] * inverse).max(LEAST_WEIGHT);
                }
            },
        );
    }

    #[cfg(test)]
    pub(super) fn total(&self) -> f32 {
        sum(&self.weight)
    }
}

/// Mean absolute error of a prediction, fading with the past.
#[derive(Debug, Clone, Copy)]
pub(super) struct Track {
    pub(super) at: f32,
    pub(super) error: f32,
    seen: f32,
}

/// Weight of the newest error once many were seen.
const FADING: f32 = 0.025;

impl Track {
    pub(super) fn new() -> Self {
        Self {
            at: 0.0,
            error: 1.0,
            seen: 0.0,
        }
    }

    #[inline(always)]
    pub(super) fn update(&mut self, step: f32) {
        self.seen += 1.0;
        let rate = (1.0 / (self.seen + 0.5)).max(FADING);
        self.error += ((step - self.at).abs() - self.error) * rate;
    }

    /// A logistic law about the prediction with the mean absolute error of the past.
    #[inline(always)]
    pub(super) fn tails(&self, edge: f32) -> Tails {
        let sharpness = LOG2_E as f32 / (0.72 * self.error + 0.06);
        let e = exp2(((self.at - edge) * sharpness).clamp(-FLAT, FLAT));
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

/// How often each index occurred: for signals whose values return. A binary indexed tree.
#[derive(Debug, Clone)]
pub(super) struct Frequencies {
    sums: Vec<u32>,
    total: u32,
    cells: Option<i64>,
    /// The index at the window's start.
    start: i64,
}

impl Frequencies {
    /// About the first index; on a circle of at most `WINDOW` cells all of them.
    pub(super) fn new(first: i64, cells: Option<i64>) -> Self {
        let cells = cells.filter(|cells| *cells <= WINDOW as i64);
        Self {
            sums: vec![0; WINDOW + 1],
            total: 0,
            cells,
            start: if cells.is_some() { 0 } else { first - WINDOW as i64 / 2 },
        }
    }

    pub(super) fn add(&mut self, index: i64, changed: bool) {
        let offset = self.cells.map_or(index - self.start, |cells| index.rem_euclid(cells));
        if !(0..WINDOW as i64).contains(&offset) {
            return;
        }
        let weight = if changed { CHANGED } else { 1 };
        let mut node = offset as usize + 1;
        while node <= WINDOW {
            self.sums[node] = self.sums[node].wrapping_add(weight);
            node += node & node.wrapping_neg();
        }
        self.total = self.total.wrapping_add(weight);
    }

    /// Counts in the window below an offset from its start.
    fn prefix(&self, offset: i64) -> u32 {
        let mut node = offset.clamp(0, WINDOW as i64) as usize;
        let mut sum = 0_u32;
        while node > 0 {
            sum = sum.wrapping_add(self.sums[node]);
            node &= node - 1;
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
        let inverse = 1.0 / (self.total as f32 + PRIOR);
        Tails {
            below: (below as f32 + PRIOR * filters.below) * inverse,
            above: ((self.total - below) as f32 + PRIOR * filters.above) * inverse,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filter_tails_sum_to_their_weights() {
        let mut filters = Filters::new();
        for i in 0..2000_i16 {
            filters.predict();
            let step = f32::from(i % 7 - 3) * if i % 100 == 0 { 1e9 } else { 1.0 };
            for edge in [-1e6, -2.5, 0.5, 3.5, 1e6] {
                let tails = filters.tails(edge);
                assert!((tails.below + tails.above - filters.total()).abs() < 1e-4, "{i}");
            }
            filters.update(step);
            assert!((filters.total() - 1.0).abs() < 1e-4 && filters.position.iter().all(|x| x.is_finite()));
        }
    }

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
