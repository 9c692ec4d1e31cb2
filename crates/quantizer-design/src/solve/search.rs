//! Joint local search for cells and words, on grids.
//!
//! ```text
//! for each start
//!     repeat
//!         for each sensor
//!             block <- moments of its grid cells, with the other sensors fixed
//!             repeat
//!                 words of the cells <- best for the present decoder           # neighbours with the same word become one cell
//!                 insert an unused word if that is better
//!                 exchange two words if that is better
//!     until a round over the sensors gains nothing
//! for the best few results: the same on finer grids around their breakpoints
//! ```
//!
//! A step is taken only if it raises the criterion. A word that is the best one for no cell is not used. The search
//! therefore always ends with a valid design.

use super::control::Control;
use super::landscape::{Block, Grid, Landscape, REACH, Words};
use super::participant::WordedCells;
use crate::criterion::AllowedCells;
use crate::deadline::Deadline;
use crate::outcomes::Table;
use fewbits_monte_carlo::Stream;
use rand::RngExt;

/// A loop ends if its gain is below this fraction of the criterion's scale.
const GAIN: f64 = 1e-10;
/// A search ends if a round over the sensors gains less than this fraction.
const ROUND_GAIN: f64 = 1e-7;
/// Fraction of the half-width of a sample's table that evenly spaced edges cover.
const EVEN_SHARE: f64 = 0.75;
/// Number of grid cells on either side of a breakpoint on a finer grid.
const FINER: i32 = 3;
/// Exchanges of words are left out if trying all of them once needs more multiplications than this.
const MAX_EXCHANGE_WORK: f64 = 3e8;

/// Number of points that are kept for the next stage.
const KEPT: usize = 4;
/// Largest number of rounds over the sensors, or over cells and words of one sensor.
const MAX_ROUNDS: usize = 60;
/// Largest number of sweeps in a loop over cells or words.
const MAX_SWEEPS: usize = 40;

/// A point of the search: for every sensor a grid and the words of its cells.
#[derive(Debug, Clone)]
pub(super) struct Point {
    pub(super) grids: Vec<Grid>,
    pub(super) words: Vec<Words>,
    pub(super) value: f64,
}

/// Cells and words of every sensor at a point.
pub(super) fn cells_of(point: &Point) -> Vec<WordedCells> {
    point
        .grids
        .iter()
        .zip(&point.words)
        .map(|(g, w)| WordedCells::of(&g.edges, w))
        .collect()
}

/// The first grid of a sensor, with some additional edges.
pub(super) fn grid_with(landscape: &Landscape, sensor: usize, cells: usize, more: &[f64]) -> Grid {
    let mut edges = first_edges(landscape, sensor, cells);
    edges.extend(more);
    edges.sort_by(f64::total_cmp);
    edges.dedup();
    landscape.grid(sensor, edges)
}

/// Edges of which half are evenly spaced and half at equal probabilities of a sensor's sample.
fn first_edges(landscape: &Landscape, sensor: usize, cells: usize) -> Vec<f64> {
    let sample = landscape.sample(sensor);
    let (even, reach) = (cells / 2, EVEN_SHARE * REACH * sample.deviation);
    let mut edges: Vec<f64> = (1..even)
        .map(|i| sample.mean + reach * (2.0 * i as f64 / even as f64 - 1.0))
        .collect();
    edges.extend(sample.quantiles(cells - even));
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|b, a| *b - *a < 1e-6 * sample.deviation);
    edges
}

/// Starting words on a grid: intervals of equal probability, one for each of the given words.
pub(super) fn start(landscape: &Landscape, sensor: usize, grid: &Grid, words: &[usize]) -> Words {
    let worded = WordedCells {
        breakpoints: landscape.sample(sensor).quantiles(words.len()),
        words: words.to_vec(),
    };
    worded.on(&grid.edges)
}

/// Random starting words: a random number of cells, at random places, in random order. If folded cells are allowed, there are more cells
/// than words.
pub(super) fn random_start(
    landscape: &Landscape,
    sensor: usize,
    grid: &Grid,
    shape: AllowedCells,
    stream: Stream,
) -> Words {
    let mut rng = stream.rng();
    let all = landscape.laws[sensor].inputs();
    let count = rng.random_range((all / 2).max(2)..=all);
    let mut words: Vec<usize> = (0..all).collect();
    for i in (1..all).rev() {
        words.swap(i, rng.random_range(0..=i));
    }
    words.truncate(count);
    if shape == AllowedCells::Any && all > 1 {
        // Each cell gets another word than the one before it.
        let count = rng.random_range(count..=2 * all + 1);
        while words.len() < count {
            let step = rng.random_range(1..all);
            words.push((words[words.len() - 1] + step) % all);
        }
    }
    let fine = landscape.sample(sensor).quantiles(200);
    let mut breakpoints: Vec<f64> = (1..words.len())
        .map(|_| fine[rng.random_range(0..fine.len())])
        .collect();
    breakpoints.sort_by(f64::total_cmp);
    WordedCells { breakpoints, words }.on(&grid.edges)
}

/// A random sequence of words in which neighbours differ in one bit; it ends if no unused word is left that does. Over links that invert
/// bits the best words of neighbouring cells are often of this kind. There are more such sequences than Gray codes.
pub(super) fn gray_walk(words: usize, stream: Stream) -> Vec<usize> {
    let mut rng = stream.rng();
    let mut walk = vec![rng.random_range(0..words)];
    loop {
        let last = walk[walk.len() - 1];
        let neighbours = (0..usize::BITS)
            .map(|bit| last ^ (1 << bit))
            .take_while(|word| *word < 2 * words);
        let free: Vec<usize> = neighbours
            .filter(|word| *word < words && !walk.contains(word))
            .collect();
        if free.is_empty() {
            return walk;
        }
        walk.push(free[rng.random_range(0..free.len())]);
    }
}

/// Local search from a point until a round over the sensors gains nothing or the time limit is reached; `None` if there is no time
/// to evaluate the first point.
pub(super) fn climb(
    landscape: &Landscape,
    grids: Vec<Grid>,
    mut words: Vec<Words>,
    shape: AllowedCells,
    control: &mut Control<'_>,
) -> Option<Point> {
    let deadline = control.deadline();
    let mut symbols: Vec<Vec<Table>> = (0..grids.len())
        .map(|n| landscape.symbols(n, &grids[n], &words[n]))
        .collect();
    let mut value = landscape.total(&grids, &words, &symbols, deadline)?;
    for _ in 0..MAX_ROUNDS {
        let before = value;
        // One sensor at a time, given all others. A round cannot lower the value.
        for n in 0..grids.len() {
            let block = control
                .step()
                .then(|| landscape.block(n, &grids[n], &symbols, deadline))
                .flatten();
            // No time or steps left: the present design is valid.
            let Some(block) = block else {
                return Some(Point { grids, words, value });
            };
            let mut sensor = Sensor {
                landscape,
                grid: &grids[n],
                block: &block,
                shape,
                deadline,
                value: landscape.value(&block, &grids[n], &words[n]),
                words: std::mem::take(&mut words[n]),
            };
            let first = sensor.value;
            sensor.climb();
            value += sensor.value - first;
            words[n] = sensor.words;
            symbols[n] = landscape.symbols(n, &grids[n], &words[n]);
        }
        if grids.len() == 1 || value - before <= ROUND_GAIN * landscape.unit(value) {
            break;
        }
    }
    Some(Point { grids, words, value })
}

/// Local search on finer grids around the breakpoints of a point; the new spacing is a third of `spacing`.
pub(super) fn refine(
    landscape: &Landscape,
    point: Point,
    spacings: &mut [f64],
    shape: AllowedCells,
    control: &mut Control<'_>,
) -> Point {
    let (mut grids, mut words) = (Vec::new(), Vec::new());
    for (n, spacing) in spacings.iter_mut().enumerate() {
        let cells = WordedCells::of(&point.grids[n].edges, &point.words[n]);
        let mut edges = Vec::new();
        for b in &cells.breakpoints {
            edges.extend((-FINER..=FINER).map(|i| b + *spacing * f64::from(i) / f64::from(FINER)));
        }
        // Neighbouring breakpoints can have the same candidates.
        edges.sort_by(f64::total_cmp);
        edges.dedup_by(|b, a| *b - *a < 1e-3 * *spacing);
        if edges.is_empty() {
            edges.push(landscape.sample(n).mean);
        }
        words.push(cells.on(&edges));
        grids.push(landscape.grid(n, edges));
        *spacing /= f64::from(FINER);
    }
    climb(landscape, grids, words, shape, control).unwrap_or(point)
}

/// The largest distance between neighbouring candidates for breakpoints: the possible error of a breakpoint.
pub(super) fn spacing(landscape: &Landscape, sensor: usize, cells: usize) -> f64 {
    2.0 * EVEN_SHARE * REACH * landscape.sample(sensor).deviation / (cells / 2) as f64
}

/// The best points; of those of nearly equal value only one.
pub(super) fn best_of(mut points: Vec<Point>, same: f64) -> Vec<Point> {
    points.sort_by(|a, b| b.value.total_cmp(&a.value));
    points.dedup_by(|b, a| (a.value - b.value).abs() <= same);
    points.truncate(KEPT);
    points
}

/// Local search over one sensor, with the others fixed.
struct Sensor<'a> {
    landscape: &'a Landscape,
    grid: &'a Grid,
    block: &'a Block,
    shape: AllowedCells,
    deadline: Deadline,
    words: Words,
    value: f64,
}

impl Sensor<'_> {
    fn climb(&mut self) {
        for _ in 0..MAX_ROUNDS {
            let before = self.value;
            self.move_cells();
            if self.exchange_work() <= MAX_EXCHANGE_WORK {
                self.exchange_words();
            }
            if self.value - before <= GAIN * self.landscape.unit(before) || self.deadline.is_over() {
                return;
            }
        }
    }

    /// Replaces the words if `words` are better.
    fn accept(&mut self, words: Words) -> bool {
        if words == self.words {
            return false;
        }
        let value = self.landscape.value(self.block, self.grid, &words);
        let better = value - self.value > GAIN * self.landscape.unit(self.value);
        if better {
            (self.words, self.value) = (words, value);
        }
        better
    }

    /// Assigns each grid cell its best word for the present decoder, and repeats with the new decoder.
    fn move_cells(&mut self) {
        for _ in 0..MAX_SWEEPS {
            let worth = self.landscape.worth(self.block, self.grid, &self.words);
            let next = match self.shape {
                AllowedCells::Any => self.best_words(&worth),
                AllowedCells::Intervals => self.best_intervals(&worth),
            };
            if !self.accept(next) || self.deadline.is_over() {
                return;
            }
        }
    }

    fn best_words(&self, worth: &[f64]) -> Words {
        let count = self.landscape.laws[self.block.sensor].inputs();
        let rows = worth.chunks_exact(count).zip(&self.words);
        rows.map(|(row, own)| (0..count).fold(*own, |best, w| if row[w] > row[best] { w } else { best }))
            .collect()
    }

    /// The best intervals with the words in their present order and at most one unused word inserted.
    fn best_intervals(&self, worth: &[f64]) -> Words {
        let count = self.landscape.laws[self.block.sensor].inputs();
        let order = WordedCells::of(&self.grid.edges, &self.words).words;
        let (mut best, mut words) = in_order(worth, count, &order);
        for unused in (0..count).filter(|w| !order.contains(w)) {
            for at in 0..=order.len() {
                let mut longer = order.clone();
                longer.insert(at, unused);
                let (value, found) = in_order(worth, count, &longer);
                if value > best + GAIN * best.abs() {
                    (best, words) = (value, found);
                }
            }
        }
        words
    }

    fn exchange_work(&self) -> f64 {
        let law = &self.landscape.laws[self.block.sensor];
        let pairs = (law.inputs() * law.inputs()) as f64 / 2.0;
        pairs * (law.outputs() * law.inputs()) as f64 * (self.block.others * self.landscape.width()) as f64
    }

    /// Exchanges two words if that is better, for all pairs.
    fn exchange_words(&mut self) {
        let count = self.landscape.laws[self.block.sensor].inputs();
        for _ in 0..MAX_SWEEPS {
            let levels = self.landscape.levels(self.block, &self.words);
            let used: Vec<bool> = (0..count).map(|w| self.words.contains(&w)).collect();
            let mut renamed: Vec<usize> = (0..count).collect();
            let mut changed = false;
            for a in 0..count {
                for b in a + 1..count {
                    if !used[a] && !used[b] || self.deadline.is_over() {
                        continue;
                    }
                    // Two words are exchanged if that raises the value: over a noisy link the distance between words matters.
                    renamed.swap(a, b);
                    let value = self
                        .landscape
                        .value_of_levels(self.block, self.grid, &levels, &self.words, &renamed);
                    if value - self.value > GAIN * self.landscape.unit(self.value) {
                        self.value = value;
                        changed = true;
                    } else {
                        renamed.swap(a, b);
                    }
                }
            }
            if !changed {
                return;
            }
            self.words.iter_mut().for_each(|w| *w = renamed[*w]);
        }
    }
}

/// Dynamic programme over the cells of a grid: intervals with words in the given order; words may be left out.
fn in_order(worth: &[f64], count: usize, order: &[usize]) -> (f64, Words) {
    let cells = worth.len() / count;
    // `best[j]`: the most that the cells so far can gain if the last one has the `j`-th word of the order.
    let mut best = vec![0.0; order.len()];
    let mut from = Vec::with_capacity(cells);
    for row in worth.chunks_exact(count) {
        let (mut leader, mut next) = (0, vec![0.0; order.len()]);
        let mut came = vec![0; order.len()];
        for (j, word) in order.iter().enumerate() {
            // If values are equal, the later word is taken.
            if best[j] >= best[leader] {
                leader = j;
            }
            (next[j], came[j]) = (best[leader] + row[*word], leader);
        }
        best = next;
        from.push(came);
    }
    let mut at = (0..order.len()).fold(0, |a, j| if best[j] > best[a] { j } else { a });
    let value = best[at];
    // Trace back from the best word of the last cell.
    let mut words = vec![0; cells];
    for c in (0..cells).rev() {
        words[c] = order[at];
        at = from[c][at];
    }
    (value, words)
}
