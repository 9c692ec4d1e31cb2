//! One column of whole numbers, coded decision by decision.
//!
//! The index is coded relative to a centre (of the last index, the filters' mean and the least-squares prediction, the one with the
//! smallest error so far), in cells of `2^k` indices, where `k` follows that error:
//!
//! ```text
//! cell 0?   sign   at least 2, 3, 4, 6, 10, .. cells away?   where in the interval?   k low bits, the highest two with a model
//! ```

use super::coder::Coder;
use super::experts::{Frequencies, LeastSquares, Tails, Track};
use super::filters::Filters;
use super::mixer::{EXPERTS, Mixer, log_odds};
use fewbits_core::CodecError;
use fewbits_node::elementary::round;

/// Largest index, either sign: sums of a few stay whole in an `i64` with room.
pub(super) const LARGEST: i64 = 1 << 46;
/// Differences remembered.
const PAST: usize = 4;
/// Least weight of a new index in the slow mean.
const SLOW: f64 = 0.005;
/// Low bits that are coded with a model.
const MODELLED: u32 = 2;
/// Numbers of decisions, by which contexts tell them apart.
const MAGNITUDES: u32 = 2;
const INSIDE: u32 = 40;
const LOW: u32 = 44;
/// Classes of decisions that share weights.
const CLASS_MAGNITUDES: usize = 2;
const CLASS_INSIDE: usize = 6;
const CLASS_LOW: usize = 7;

/// Where the next index is expected, and how finely it is told.
#[derive(Debug, Clone, Copy)]
struct Grid {
    centre: i64,
    /// Bits of a cell.
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

/// The state that both ends hold.
#[derive(Debug, Clone)]
pub(super) struct Model {
    pub(super) mixer: Mixer,
    pub(super) filters: Filters,
    squares: LeastSquares<5>,
    /// The error of the prediction from other columns, and least squares on them.
    joint: Option<(Track, LeastSquares<8>)>,
    frequencies: Frequencies,
    mean: Track,
    hold: Track,
    recursion: Track,
    cells: Option<i64>,
    last: i64,
    past: [i64; PAST],
    slow: f64,
    seen: f64,
}

#[inline(always)]
fn hash(a: u32, b: u32) -> u32 {
    (a.wrapping_mul(0x2545_F491) ^ b)
        .wrapping_mul(0x9E37_79B1)
        .rotate_left(13)
}

pub(super) fn damaged(value: i64) -> CodecError {
    CodecError::Invalid {
        what: "index",
        value: value.to_string(),
        expected: "at most 2^46 in size",
    }
}

impl Model {
    /// After the first index of a block of so many rows; `cells`: points of a circle.
    pub(super) fn new(rows: usize, first: i64, cells: Option<i64>, joint: bool) -> Self {
        let mut frequencies = Frequencies::new(first, cells);
        frequencies.add(first, true);
        Self {
            mixer: Mixer::new(rows),
            filters: Filters::new(),
            squares: LeastSquares::new(),
            joint: joint.then(|| (Track::new(), LeastSquares::new())),
            frequencies,
            mean: Track::new(),
            hold: Track::new(),
            recursion: Track::new(),
            cells,
            last: first,
            past: [0; PAST],
            slow: first as f64,
            seen: 1.0,
        }
    }

    pub(super) fn last(&self) -> i64 {
        self.last
    }

    /// Codes the next index: `wanted` at the writer, `None` at the reader. `others`: differences of other columns. For loops under
    /// [`vectorised`](fewbits_numerics::kernels::vectorised).
    #[inline(always)]
    pub(super) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        wanted: Option<i64>,
        others: [f64; 3],
    ) -> Result<i64, CodecError> {
        let grid = self.expect(others);
        let index = self.decide(coder, grid, wanted)?;
        if index.abs() > LARGEST {
            return Err(damaged(index));
        }
        self.learn(index, grid.k == 0 && index == grid.centre);
        Ok(index)
    }

    /// Predictions, contexts and the centre.
    #[inline(always)]
    fn expect(&mut self, others: [f64; 3]) -> Grid {
        let [d0, d1, d2, d3] = self.past;
        let level = self.last as f64 - self.slow;
        let lags = [d0 as f64, d1 as f64, d2 as f64, d3 as f64, level];
        self.squares.regressors = lags;
        self.mean.at = self.filters.predict();
        self.recursion.at = self.squares.predict();
        let mut best = (self.hold.error * 0.98, 0.0);
        for track in [&self.mean, &self.recursion] {
            if track.error < best.0 {
                best = (track.error, track.at);
            }
        }
        if let Some((track, squares)) = &mut self.joint {
            let [a, b, c] = others;
            squares.regressors = [a, b, c, lags[0], lags[1], lags[2], lags[3], level];
            track.at = squares.predict();
            if track.error < best.0 {
                best = (track.error, track.at);
            }
        }
        // Predictions are within 2^22, where rounding is exact.
        let offset = round(best.1.clamp(-4e6, 4e6)) as i64;
        // Doublings of the error over the square root of two, rounded down, if any.
        let k = ((best.0 * std::f32::consts::FRAC_1_SQRT_2).to_bits() >> 23).saturating_sub(127);

        let step = |d: i64| ((d >> k).clamp(-20, 20) + 32) as u32;
        let size = |d: i64| (d.unsigned_abs() >> k).min(3) as u32;
        let point = |j: i64| self.cells.map_or(j, |cells| j.rem_euclid(cells)) as u32;
        let centre = self.last + offset;
        let here = step(offset) + (k << 8);
        let (s0, s1, s2) = (step(d0), step(d1), step(d2));
        let sizes = size(d0) << 6 | size(d1) << 4 | size(d2) << 2 | size(d3);
        let (last, before) = (point(self.last), point(self.last - d0));
        self.mixer.contexts = [
            hash(hash(3, s0), hash(s1, here)),
            hash(hash(hash(4, s0), s1), hash(s2, here)),
            hash(5, point(centre)),
            hash(hash(6, last), here),
            hash(hash(7, last), hash(before, here)),
            hash(hash(11, sizes), k),
        ];
        Grid { centre, k }
    }

    /// What each expert says about an edge: the first index above it.
    #[inline(always)]
    fn tails(&self, grid: Grid, edge: i64) -> [Tails; EXPERTS] {
        let filters = self.filters.tails((edge - self.last) as f32 - 0.5);
        self.tails_beside(grid, edge, filters)
    }

    /// The same where what the filters say is known.
    #[inline(always)]
    fn tails_beside(&self, grid: Grid, edge: i64, filters: Tails) -> [Tails; EXPERTS] {
        let at = (edge - self.last) as f32 - 0.5;
        [
            filters,
            self.recursion.tails(at),
            self.frequencies.tails(edge, grid.centre, filters),
            self.joint
                .as_ref()
                .map_or(Tails::default(), |(track, _)| track.tails(at)),
        ]
    }

    #[inline(always)]
    fn decide_one<C: Coder>(&mut self, coder: &mut C, wanted: bool) -> bool {
        let p = self.mixer.predict();
        let bit = coder.bit(p, wanted);
        self.mixer.update(bit);
        bit
    }

    /// Sets the experts' inputs from the shares of the two outcomes.
    #[inline(always)]
    fn inputs(&mut self, shares: impl Fn(usize) -> (f32, f32)) {
        let (mut yes, mut no) = ([0.0; EXPERTS], [0.0; EXPERTS]);
        for e in 0..EXPERTS {
            (yes[e], no[e]) = shares(e);
        }
        self.mixer.experts = log_odds(yes, no);
        if self.joint.is_none() {
            self.mixer.experts[EXPERTS - 1] = 0.0;
        }
    }

    #[inline(always)]
    fn decide<C: Coder>(&mut self, coder: &mut C, grid: Grid, wanted: Option<i64>) -> Result<i64, CodecError> {
        self.mixer.look_up(0, 0);
        let (first, next) = (grid.first(0), grid.first(1));
        let [below, above] = self.filters.cell((first - self.last) as f32 - 0.5, grid.k);
        let (low, high) = (self.tails_beside(grid, first, below), self.tails_beside(grid, next, above));
        self.inputs(|e| {
            let outside = low[e].below + high[e].above;
            // Of the forms of the share inside, the one that cancels least.
            let inside = if outside < 0.5 {
                1.0 - outside
            } else if low[e].below > 0.5 {
                low[e].above - high[e].above
            } else {
                high[e].below - low[e].below
            };
            (inside, outside)
        });
        if self.decide_one(coder, wanted.is_some_and(|j| (first..next).contains(&j))) {
            return Ok(self.low_bits(coder, grid, first, wanted));
        }
        self.mixer.look_up(1, 1);
        self.inputs(|e| (high[e].above, low[e].below));
        let up = self.decide_one(coder, wanted.is_some_and(|j| j >= next));
        let side = |tails: &Tails| if up { tails.above } else { tails.below };
        let is_beyond = |edge: i64| wanted.is_some_and(|j| if up { j >= edge } else { j < edge });

        // Outwards: is the index at least so many cells away?
        let mut near: [f32; EXPERTS] = std::array::from_fn(|e| side(if up { &high[e] } else { &low[e] }));
        let mut far;
        let (mut begin, mut width, mut count) = (1_i64, 1_i64, 0_usize);
        loop {
            if begin + width > LARGEST >> grid.k << 2 {
                return Err(damaged(i64::MAX));
            }
            let node = MAGNITUDES + 2 * count.min(18) as u32 + u32::from(up);
            self.mixer.look_up(node, CLASS_MAGNITUDES + count.min(3));
            let edge = grid.edge(begin + width, up);
            let tails = self.tails(grid, edge);
            far = tails.each_ref().map(side);
            self.inputs(|e| (far[e], near[e] - far[e]));
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
            let between = self.tails(grid, edge).each_ref().map(side);
            self.inputs(|e| (between[e] - far[e], near[e] - between[e]));
            if self.decide_one(coder, is_beyond(edge)) {
                (begin, near) = (middle, between);
            } else {
                (end, far) = (middle, between);
            }
            depth = (depth + 1).min(3);
        }
        let cell = if up { begin } else { -begin };
        Ok(self.low_bits(coder, grid, grid.first(cell), wanted))
    }

    /// Where in a cell.
    #[inline(always)]
    fn low_bits<C: Coder>(&mut self, coder: &mut C, grid: Grid, first: i64, wanted: Option<i64>) -> i64 {
        let mut index = first;
        for level in 0..grid.k.min(MODELLED) {
            self.mixer.look_up(LOW + level, CLASS_LOW);
            let half = 1 << (grid.k - level - 1);
            let [a, b, c] = [index, index + half, index + 2 * half].map(|edge| self.tails(grid, edge));
            self.inputs(|e| {
                if a[e].below < 0.5 {
                    (c[e].below - b[e].below, b[e].below - a[e].below)
                } else {
                    (b[e].above - c[e].above, a[e].above - b[e].above)
                }
            });
            if self.decide_one(coder, wanted.is_some_and(|j| j >= index + half)) {
                index += half;
            }
        }
        let left = grid.k.saturating_sub(MODELLED);
        let value = wanted.map_or(0, |j| (j - index) as u64);
        index + coder.raw(value, left) as i64
    }

    /// `inside`: the index is the cell of width one that was asked for first.
    #[inline(always)]
    fn learn(&mut self, index: i64, inside: bool) {
        let step = index - self.last;
        let at = step as f32;
        let rate = Track::rate(self.seen as f32);
        for track in [&mut self.mean, &mut self.hold, &mut self.recursion] {
            track.update(at, rate);
        }
        self.squares.update(step as f64);
        if let Some((track, squares)) = &mut self.joint {
            track.update(at, rate);
            squares.update(step as f64);
        }
        self.filters.update(at, inside);
        self.frequencies.add(index, step != 0);
        self.past.rotate_right(1);
        self.past[0] = step;
        self.last = index;
        self.seen += 1.0;
        self.slow += (index as f64 - self.slow) * (1.0 / self.seen).max(SLOW);
    }
}
