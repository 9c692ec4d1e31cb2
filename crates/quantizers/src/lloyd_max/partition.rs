//! The best partition of a density on a grid, as a start without empty cells.
//!
//! The squared error of a partition is a sum over its cells, so the best partition into `l` cells follows from the best ones into
//! `l - 1` cells:
//!
//! ```text
//! cost(a, b) <- squared error of the grid cells a..b about their own mean      # from cumulative sums
//! V_1(b)     <- cost(0, b)
//! V_l(b)     <- min over a < b of V_{l-1}(a) + cost(a, b)
//! ```
//!
//! The best `a` does not decrease as `b` increases, so each layer takes `O(n log n)` steps by bisecting the range of `b`.

use crate::density::Density;

/// Number of cells of the grid.
const GRID: usize = 2000;
/// Smallest average number of grid cells per cell of the partition; with fewer the grid is not used.
const MIN_GRID_CELLS: usize = 8;

/// Breakpoints, measured from the density's centre, of the partition of smallest squared error whose edges are on a grid over the density's
/// extent. `None` if the grid is too coarse for so many levels, or the density has no mass on it.
pub(super) fn best_on_grid(density: &impl Density, levels: usize) -> Option<Vec<f64>> {
    if levels * MIN_GRID_CELLS > GRID {
        return None;
    }
    let (low, high) = density.extent();
    let width = (high - low) / GRID as f64;
    // Cumulative mass, first and second moment of the grid cells, in grid units about the middle of the grid.
    let mut sums = vec![[0.0; 3]; GRID + 1];
    for i in 0..GRID {
        let place = i as f64 + 0.5 - 0.5 * GRID as f64;
        let mass = density.pdf(low + (i as f64 + 0.5) * width).max(0.0);
        let [m, x, xx] = sums[i];
        sums[i + 1] = [m + mass, x + mass * place, xx + mass * place * place];
    }
    let total = sums[GRID][0];
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let cost = |a: usize, b: usize| {
        let [m, x, xx] = [0, 1, 2].map(|i| sums[b][i] - sums[a][i]);
        // Rounding may leave a negative sum for a cell that is nearly a point.
        if m > 0.0 { (xx - x * (x / m)).max(0.0) } else { 0.0 }
    };
    let mut best: Vec<f64> = (0..=GRID).map(|b| cost(0, b)).collect();
    let mut came_from = Vec::with_capacity(levels);
    for level in 1..levels {
        let mut layer = Layer {
            before: &best,
            cost: &cost,
            next: vec![f64::INFINITY; GRID + 1],
            from: vec![0; GRID + 1],
        };
        // `level + 1` cells need as many grid cells; the cells before the last need `level` of them.
        layer.fill((level + 1, GRID), (level, GRID - 1));
        let Layer { next, from, .. } = layer;
        best = next;
        came_from.push(from);
    }
    // Follow the best last edge of each layer back from the end of the grid.
    let mut at = GRID;
    let mut edges: Vec<f64> = Vec::with_capacity(levels - 1);
    for from in came_from.iter().rev() {
        at = from[at];
        edges.push(low + at as f64 * width);
    }
    edges.reverse();
    Some(edges)
}

/// One layer (number of cells) of the dynamic programme.
struct Layer<'a, C> {
    before: &'a [f64],
    cost: &'a C,
    next: Vec<f64>,
    from: Vec<usize>,
}

impl<C: Fn(usize, usize) -> f64> Layer<'_, C> {
    /// Computes the entries `b` of a range, whose best `a` is known to be in another range.
    fn fill(&mut self, (first, last): (usize, usize), (low, high): (usize, usize)) {
        if first > last {
            return;
        }
        let b = first + (last - first) / 2;
        let mut best = (f64::INFINITY, low);
        for a in low..=high.min(b - 1) {
            let value = self.before[a] + (self.cost)(a, b);
            if value < best.0 {
                best = (value, a);
            }
        }
        (self.next[b], self.from[b]) = best;
        self.fill((first, b - 1), (low, best.1));
        self.fill((b + 1, last), (best.1, high));
    }
}
