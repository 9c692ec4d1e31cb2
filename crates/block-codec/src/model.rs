//! Codes one column of integers, decision by decision, with mixed models.
//!
//! The index is coded relative to a centre, in cells of `2^k` indices. The centre is the prediction with the smallest error so far: the
//! last index, least squares, or least squares with other columns (without any, the slow mean). `k` follows that error:
//!
//! ```text
//! cell 0?   sign   at least 2, 3, 4, 6, 10, .. cells away?   where in the interval?   k low bits, the highest two with a model
//! ```

use crate::arithmetic::Coder;
use crate::error::{Damaged, ensure};
use crate::experts::{Frequencies, LeastSquares, Tails, Tracks};
use crate::lanes::Lanes;
use crate::mixer::Mixer;
use crate::rows::{JOINT_COLUMNS, LARGEST, State, damaged};
use fewbits_node::elementary::round;

/// Number of past differences used as regressors.
const PAST: usize = 4;
/// Smallest weight of a new index in the slow mean.
const SLOW: f64 = 0.02;
/// Number of low bits that are coded with a model.
const MODELLED: u32 = 2;
/// Numbers of decisions, by which contexts tell them apart.
const MAGNITUDES: u32 = 2;
const INSIDE: u32 = 40;
const LOW: u32 = 44;
/// Classes of decisions that share weights.
const CLASS_MAGNITUDES: usize = 2;
const CLASS_INSIDE: usize = 6;
const CLASS_LOW: usize = 7;

impl State for Model {
    fn last(&self) -> i64 {
        self.last
    }

    #[inline(always)]
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        wanted: Option<i64>,
        others: [f64; JOINT_COLUMNS],
    ) -> Result<i64, Damaged> {
        let grid = self.expect(others);
        self.decide(coder, grid, wanted)
    }

    #[inline(always)]
    fn learn(&mut self, index: i64) {
        let step = index - self.last;
        self.tracks.update(step as f32, self.seen as f32);
        self.squares.update(step as f64);
        if let Some(squares) = &mut self.joint {
            squares.update(step as f64);
        }
        self.frequencies.add(index, step != 0);
        if let Some(rests) = &mut self.rests {
            rests.learn(step);
        }
        self.past.rotate_right(1);
        self.past[0] = step;
        self.last = index;
        self.seen += 1.0;
        self.slow += (index as f64 - self.slow) * (1.0 / self.seen).max(SLOW);
    }
}

/// Centre and cell size for the next index.
#[derive(Debug, Clone, Copy)]
struct Grid {
    centre: i64,
    /// A cell has `2^k` indices.
    k: u32,
}

impl Grid {
    /// First index of a cell.
    #[inline(always)]
    fn first(self, cell: i64) -> i64 {
        self.centre + (cell << self.k) - ((1 << self.k) >> 1)
    }

    /// The edge beyond which an index is at least `cells` cells away.
    #[inline(always)]
    fn edge(self, cells: i64, up: bool) -> i64 {
        self.first(if up { cells } else { 1 - cells })
    }
}

/// The state of the coder, the same at writer and reader.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    mixer: Mixer,
    squares: LeastSquares<4>,
    /// Least squares with other columns too.
    joint: Option<LeastSquares<8>>,
    frequencies: Frequencies,
    tracks: Tracks,
    cells: Option<i64>,
    last: i64,
    past: [i64; PAST],
    /// Rests of the index; `None` in blocks of earlier writers, whose contexts have none.
    rests: Option<Rests>,
    slow: f64,
    seen: f64,
}

/// How long the index has rested, how long it rested before its last step, and whether that step went up.
#[derive(Debug, Clone, Copy, Default)]
struct Rests {
    now: u32,
    before: u32,
    up: bool,
}

impl Rests {
    #[inline(always)]
    fn learn(&mut self, step: i64) {
        if step == 0 {
            self.now = self.now.saturating_add(1);
        } else {
            *self = Self {
                now: 0,
                before: self.now,
                up: step > 0,
            };
        }
    }

    /// A length: exact up to 8, then four classes per doubling.
    #[inline(always)]
    fn class(rows: u32) -> u32 {
        if rows < 8 {
            return rows;
        }
        let power = 31 - rows.leading_zeros();
        4 * power + (rows >> (power - 2) & 3) - 4
    }

    /// A fine and a coarse context.
    #[inline(always)]
    fn contexts(self) -> (u32, u32) {
        let now = Self::class(self.now) << 1 | u32::from(self.up);
        (now | Self::class(self.before) << 9, now)
    }
}

impl Model {
    /// The state after the first index of a block of `rows` rows. `cells`: number of points on a circle. `rests`: whether contexts have the
    /// lengths of rests.
    pub(crate) fn new(rows: usize, first: i64, cells: Option<i64>, joint: bool, rests: bool) -> Self {
        let mut frequencies = Frequencies::new(first, cells);
        frequencies.add(first, true);
        Self {
            mixer: Mixer::new(rows),
            squares: LeastSquares::new(),
            joint: joint.then(LeastSquares::new),
            frequencies,
            tracks: Tracks::new(),
            cells,
            last: first,
            past: [0; PAST],
            rests: rests.then(Rests::default),
            slow: first as f64,
            seen: 1.0,
        }
    }

    /// Computes predictions, contexts and the centre.
    #[inline(always)]
    fn expect(&mut self, others: [f64; JOINT_COLUMNS]) -> Grid {
        let [d0, d1, d2, d3] = self.past;
        let level = self.last as f64 - self.slow;
        let lags = [d0 as f64, d1 as f64, d2 as f64, d3 as f64];
        self.squares.regressors = [lags[0], lags[1], lags[2], level];
        let recursion = self.squares.predict();
        let third = match &mut self.joint {
            Some(squares) => {
                let [a, b, c] = others;
                squares.regressors = [a, b, c, lags[0], lags[1], lags[2], lags[3], level];
                squares.predict()
            }
            None => -level as f32,
        };
        self.tracks.at = Lanes::new([0.0, recursion, third, 0.0]);
        // The last index is preferred to a prediction that is only a little better.
        let [hold, of_recursion, of_third, _] = self.tracks.errors.to_array();
        let mut best = (hold * 0.96, 0.0);
        for (error, at) in [(of_recursion, recursion), (of_third, third)] {
            if error < best.0 {
                best = (error, at);
            }
        }
        // Predictions are within 2^22, where rounding is exact.
        let offset = round(best.1.clamp(-4e6, 4e6)) as i64;
        // k: base-2 logarithm of the error over the square root of two, rounded down, at least zero.
        let k = ((best.0 * std::f32::consts::FRAC_1_SQRT_2).to_bits() >> 23).saturating_sub(127);

        let step = |d: i64| ((d >> k).clamp(-20, 20) + 32) as u32;
        let size = |d: i64| (d.unsigned_abs() >> k).min(3) as u32;
        let point = |j: i64| self.cells.map_or(j, |cells| j.rem_euclid(cells)) as u32;
        let centre = self.last + offset;
        let here = step(offset) | k << 6;
        let steps = step(d0) | step(d1) << 6;
        let sizes = size(d0) << 6 | size(d1) << 4 | size(d2) << 2 | size(d3);
        let last = point(self.last).wrapping_mul(0x2545_F491);
        // The last two steps with the offset; the centre; the last index with the offset; rough sizes of four steps.
        let mut contexts = [steps | here << 12, point(centre), last ^ here, sizes | k << 8];
        // Of an index that rests, the last steps say nothing.
        if let Some(rests) = self.rests
            && d0 == 0
            && d1 == 0
        {
            let (fine, coarse) = rests.contexts();
            contexts[0] = 1 << 31 | fine ^ here.wrapping_mul(0x2_0001);
            contexts[3] = 1 << 30 | coarse ^ here.wrapping_mul(0x2001);
        }
        // A product with an odd number mixes the highest bits best; the rotation brings them down to where the table is indexed.
        for (context, word) in self.mixer.contexts.iter_mut().zip(contexts) {
            *context = word.wrapping_mul(0x9E37_79B1).rotate_left(13);
        }
        Grid { centre, k }
    }

    /// Each expert's probabilities below and above an edge, given by the first index above it.
    #[inline(always)]
    fn tails(&self, grid: Grid, edge: i64) -> Tails {
        let mut tails = self.tracks.tails(self.place(edge));
        self.frequencies.complete(edge, grid.centre, &mut tails);
        tails
    }

    /// Position of an edge relative to the last index.
    #[inline(always)]
    fn place(&self, edge: i64) -> f32 {
        (edge - self.last) as f32 - 0.5
    }

    #[inline(always)]
    fn decide_one<C: Coder>(&mut self, coder: &mut C, wanted: bool) -> bool {
        let p = self.mixer.predict();
        let bit = coder.bit(p, wanted);
        self.mixer.update(bit);
        bit
    }

    #[inline(always)]
    fn decide<C: Coder>(&mut self, coder: &mut C, grid: Grid, wanted: Option<i64>) -> Result<i64, Damaged> {
        self.mixer.look_up(0, 0);
        let (first, next) = (grid.first(0), grid.first(1));
        let mut tails = [
            self.tracks.tails(self.place(first)),
            self.tracks.tails(self.place(next)),
        ];
        self.frequencies.complete_cell(first, next, grid.centre, &mut tails);
        let [low, high] = tails;
        let outside = low.below + high.above;
        // Of the equivalent expressions for the share inside, use the one with the least cancellation.
        let is_upper = low.below.simd_gt(Lanes::HALF);
        let beside = is_upper.bitselect(low.above - high.above, high.below - low.below);
        let inside = outside.simd_lt(Lanes::HALF).bitselect(Lanes::ONE - outside, beside);
        self.mixer.set_experts(inside, outside);
        if self.decide_one(coder, wanted.is_some_and(|j| (first..next).contains(&j))) {
            return Ok(self.low_bits(coder, grid, first, [low, high], wanted));
        }
        self.mixer.look_up(1, 1);
        self.mixer.set_experts(high.above, low.below);
        let up = self.decide_one(coder, wanted.is_some_and(|j| j >= next));
        let side = |tails: &Tails| if up { tails.above } else { tails.below };
        let is_beyond = |edge: i64| wanted.is_some_and(|j| if up { j >= edge } else { j < edge });

        // Outwards in growing steps: is the index at least this many cells away?
        let mut near = if up { high } else { low };
        let mut far;
        let (mut begin, mut width, mut count) = (1_i64, 1_i64, 0_usize);
        loop {
            ensure!(begin + width <= LARGEST >> grid.k << 2, damaged(i64::MAX));
            let node = MAGNITUDES + 2 * count.min(18) as u32 + u32::from(up);
            self.mixer.look_up(node, CLASS_MAGNITUDES + count.min(3));
            let edge = grid.edge(begin + width, up);
            far = self.tails(grid, edge);
            self.mixer.set_experts(side(&far), side(&near) - side(&far));
            if !self.decide_one(coder, is_beyond(edge)) {
                break;
            }
            near = far;
            begin += width;
            count += 1;
            if count >= 3 {
                width *= 2;
            }
        }
        // Inwards, by bisection.
        let (mut end, mut depth) = (begin + width, 0);
        while end - begin > 1 {
            self.mixer.look_up(INSIDE + depth, CLASS_INSIDE);
            let middle = begin + (end - begin) / 2;
            let edge = grid.edge(middle, up);
            let between = self.tails(grid, edge);
            self.mixer
                .set_experts(side(&between) - side(&far), side(&near) - side(&between));
            if self.decide_one(coder, is_beyond(edge)) {
                (begin, near) = (middle, between);
            } else {
                (end, far) = (middle, between);
            }
            depth = (depth + 1).min(3);
        }
        let (cell, ends) = if up {
            (begin, [near, far])
        } else {
            (-begin, [far, near])
        };
        Ok(self.low_bits(coder, grid, grid.first(cell), ends, wanted))
    }

    /// Codes the position within a cell, whose edges are its `ends`.
    #[inline(always)]
    fn low_bits<C: Coder>(
        &mut self,
        coder: &mut C,
        grid: Grid,
        first: i64,
        [mut a, mut c]: [Tails; 2],
        wanted: Option<i64>,
    ) -> i64 {
        let mut index = first;
        for level in 0..grid.k.min(MODELLED) {
            self.mixer.look_up(LOW + level, CLASS_LOW);
            let half = 1 << (grid.k - level - 1);
            let b = self.tails(grid, index + half);
            // Probabilities of the upper and lower half from each expert's distribution. In the upper tail they come from the survival
            // function, which keeps its digits there.
            let is_upper = a.below.simd_ge(Lanes::HALF);
            let upper = is_upper.bitselect(b.above - c.above, c.below - b.below);
            let lower = is_upper.bitselect(a.above - b.above, b.below - a.below);
            self.mixer.set_experts(upper, lower);
            if self.decide_one(coder, wanted.is_some_and(|j| j >= index + half)) {
                index += half;
                a = b;
            } else {
                c = b;
            }
        }
        let left = grid.k.saturating_sub(MODELLED);
        let value = wanted.map_or(0, |j| (j - index) as u64);
        index + coder.raw(value, left) as i64
    }
}
