//! Search for quantizers whose levels are not intervals.
//!
//! Where sensors share noise, or noise is small, the best cells are often folded: one sensor reports coarse position, another
//! position modulo a period. No continuous path leads there from a contiguous design, so the search moves over label sequences
//! on a fine grid of the sample axis and polishes the edges by Newton's method:
//!
//! ```text
//! for each start, periodic ones first
//!     labels <- a few runs of levels, for every sensor
//!     repeat
//!         for each sensor: label of each grid cell <- the level worth most there, decoder and other sensors fixed
//!     until no label changes
//! for the best few of these, by value on the grid
//!     merge runs into cells; Newton on all edges; keep the best
//! ```

use super::cells::level_gains;
use crate::criterion::Criterion;
use crate::design::{Design, joint};
use crate::error::{Error, refuse};
use crate::moments::{Table, dot};
use crate::newton::Newton;
use crate::system::System;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::normal;
use fewbits_quantizers::Quantizer;
use rand::RngExt;

/// Half-width of the grid, in standard deviations of a sample.
const REACH: f64 = 4.5;
/// Ascent ends after this many sweeps even if labels still flicker.
const MAX_SWEEPS: usize = 200;
/// A quantizer of more cells than this is an artefact of the grid.
const MAX_CELLS: usize = 64;

/// Settings of [`discover`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Discovery {
    /// Grid cells a sensor.
    pub grid: usize,
    /// Random label sequences tried, besides the periodic ones.
    pub starts: usize,
    /// How many of the best are polished by Newton's method.
    pub polished: usize,
    /// Seed of the random label sequences.
    pub seed: u64,
}

impl Default for Discovery {
    fn default() -> Self {
        Self {
            grid: 160,
            starts: 60,
            polished: 12,
            seed: 1,
        }
    }
}

/// The best quantizers found for the sensors of `system` (channels and numbers of levels kept) when levels need not be
/// intervals. The system's own quantizers take part, polished, so the result is no worse than their local optimum.
///
/// # Errors
/// [`Error::Argument`] unless every group is a single sensor, `grid` is in `8..=2000` and something is to be tried; the error of
/// the system's own local optimum if nothing else converged.
pub fn discover(system: &System, criterion: Criterion, settings: &Discovery) -> Result<Design, Error> {
    if !(8..=2000).contains(&settings.grid) {
        return refuse("grid", settings.grid, "8 to 2000 cells");
    }
    if let Some(group) = system.groups().iter().find(|g| g.sensors().len() != 1) {
        return refuse("system", format!("{} sensors in a group", group.sensors().len()), "single sensors");
    }
    system.check_outcomes()?;
    // Refuses a Bayes error under a continuous prior before the search.
    system.value(criterion)?;
    let sensors: Vec<SensorGrid> = (0..system.groups().len())
        .map(|g| SensorGrid::new(system, g, settings.grid))
        .collect();
    let size = match criterion {
        Criterion::MeanSquaredError => system.scene().prior_variance(),
        Criterion::MutualInformation | Criterion::BayesError => 1.0,
    };
    let mut found: Vec<(f64, Vec<Quantizer>)> = Vec::new();
    let random = (0..settings.starts).map(|start| {
        let mut rng = Stream::new(settings.seed)
            .named("label-starts")
            .indexed(start as u64)
            .rng();
        sensors.iter().map(|s| s.random_labels(&mut rng)).collect::<Vec<_>>()
    });
    for mut labels in periodic_starts(&sensors).into_iter().chain(random) {
        ascend(system, criterion, &sensors, &mut labels);
        let quantizers: Option<Vec<Quantizer>> = sensors.iter().zip(&labels).map(|(s, l)| s.quantizer(l)).collect();
        let Some(quantizers) = quantizers else { continue };
        let value = criterion.sense() * system.with_quantizers(quantizers.clone())?.value(criterion)?;
        if found.iter().all(|(v, _)| (v - value).abs() > 1e-9 * size) {
            found.push((value, quantizers));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let newton = Newton::default();
    let mut best = joint(system, criterion, &newton);
    for (_, quantizers) in found.into_iter().take(settings.polished) {
        let Ok(candidate) = joint(&system.with_quantizers(quantizers)?, criterion, &newton) else {
            continue;
        };
        let better = best
            .as_ref()
            .map_or(true, |b| criterion.sense() * (candidate.value - b.value) > 0.0);
        if better {
            best = Ok(candidate);
        }
    }
    best
}

/// One sensor folded, the others contiguous: every sensor in turn, from one to `levels + 1` cells more than levels, levels
/// running round or to and fro.
fn periodic_starts(sensors: &[SensorGrid]) -> Vec<Vec<Vec<usize>>> {
    let mut starts = Vec::new();
    for (folded, sensor) in sensors.iter().enumerate() {
        let levels = sensor.levels;
        for runs in levels + 1..=2 * levels + 1 {
            let round: Vec<usize> = (0..runs).map(|r| r % levels).collect();
            let turn = 2 * levels - 2;
            let to_and_fro: Vec<usize> = (0..runs).map(|r| (r % turn).min(turn - r % turn)).collect();
            for pattern in [round, to_and_fro] {
                let labels = sensors.iter().enumerate().map(|(n, s)| {
                    if n == folded {
                        s.even_runs(&pattern)
                    } else {
                        s.even_runs(&(0..s.levels).collect::<Vec<_>>())
                    }
                });
                starts.push(labels.collect());
            }
        }
    }
    starts
}

/// One sensor on its grid.
struct SensorGrid {
    levels: usize,
    edges: Vec<f64>,
    /// Probability of each grid cell at each node.
    cells: Table,
}

impl SensorGrid {
    fn new(system: &System, group: usize, grid: usize) -> Self {
        let entry = &system.groups()[group];
        let scene = system.scene();
        let (means, sd) = scene.sample_law(entry.sensors()[0]);
        let spread = scene.sample_deviation(entry.sensors()[0]);
        let (low, step) = (scene.sample_mean() - REACH * spread, 2.0 * REACH * spread / grid as f64);
        let edges: Vec<f64> = (1..grid).map(|i| low + i as f64 * step).collect();
        let edge = |i: usize| edges.get(i).copied();
        let mut cells = Vec::with_capacity(grid * means.len());
        for c in 0..grid {
            let lower = c.checked_sub(1).and_then(edge).unwrap_or(f64::NEG_INFINITY);
            let upper = edge(c).unwrap_or(f64::INFINITY);
            cells.extend(
                means
                    .iter()
                    .map(|m| normal::interval((lower - m) / sd, (upper - m) / sd)),
            );
        }
        Self {
            levels: entry.quantizer().levels(),
            cells: Table::new(cells, means.len()),
            edges,
        }
    }

    /// Labels in runs of equal width over the middle half of the grid, the outer ones going on to the ends.
    fn even_runs(&self, pattern: &[usize]) -> Vec<usize> {
        let grid = self.cells.rows();
        let (low, width) = (grid / 4, grid.div_ceil(2));
        let run = |c: usize| (c.saturating_sub(low) * pattern.len() / width).min(pattern.len() - 1);
        (0..grid).map(|c| pattern[run(c)]).collect()
    }

    fn random_labels(&self, rng: &mut impl rand::Rng) -> Vec<usize> {
        let grid = self.cells.rows();
        let runs = rng.random_range(self.levels..=2 * self.levels + 1);
        let mut cuts: Vec<usize> = (1..runs).map(|_| rng.random_range(grid / 8..grid - grid / 8)).collect();
        cuts.sort_unstable();
        let offset = rng.random_range(0..self.levels);
        let mut label = offset;
        let mut labels = Vec::with_capacity(grid);
        for c in 0..grid {
            if cuts.contains(&c) {
                // A step of 1 walks through all levels; others shuffle them.
                label = (label + rng.random_range(1..self.levels.max(2))) % self.levels;
            }
            labels.push(label);
        }
        labels
    }

    /// Probability of each level at each node.
    fn level_probabilities(&self, labels: &[usize]) -> Table {
        let nodes = self.cells.nodes;
        let mut levels = vec![0.0; self.levels * nodes];
        for (c, label) in labels.iter().enumerate() {
            let row = &mut levels[label * nodes..(label + 1) * nodes];
            row.iter_mut().zip(self.cells.row(c)).for_each(|(r, p)| *r += p);
        }
        Table::new(levels, nodes)
    }

    /// Runs of equal labels as cells; none if a level is unused.
    fn quantizer(&self, labels: &[usize]) -> Option<Quantizer> {
        let changes: Vec<usize> = (1..labels.len()).filter(|c| labels[*c] != labels[c - 1]).collect();
        if changes.len() >= MAX_CELLS || (0..self.levels).any(|l| !labels.contains(&l)) {
            return None;
        }
        let breakpoints = changes.iter().map(|c| self.edges[c - 1]).collect();
        let runs = std::iter::once(labels[0])
            .chain(changes.iter().map(|c| labels[*c]))
            .collect();
        Quantizer::with_labels(breakpoints, runs).ok()
    }
}

fn ascend(system: &System, criterion: Criterion, sensors: &[SensorGrid], labels: &mut [Vec<usize>]) {
    let through = |g: usize, levels: &Table| -> Table {
        let channel = system.groups()[g].channel();
        let mut symbols = vec![0.0; channel.outputs() * levels.nodes];
        for (t, row) in symbols.chunks_exact_mut(levels.nodes).enumerate() {
            for z in 0..channel.inputs() {
                let c = channel.probability(t, z);
                if c != 0.0 {
                    row.iter_mut().zip(levels.row(z)).for_each(|(r, p)| *r += c * p);
                }
            }
        }
        Table::new(symbols, levels.nodes)
    };
    let mut symbols: Vec<Table> = sensors
        .iter()
        .zip(labels.iter())
        .enumerate()
        .map(|(g, (s, l))| through(g, &s.level_probabilities(l)))
        .collect();
    for _ in 0..MAX_SWEEPS {
        let mut changed = false;
        for (g, sensor) in sensors.iter().enumerate() {
            let nodes = sensor.cells.nodes;
            let others = symbols
                .iter()
                .enumerate()
                .filter(|(h, _)| *h != g)
                .fold(Table::new(vec![1.0; nodes], nodes), |joint, (_, s)| joint.outer(s));
            let gains = level_gains(system.scene(), criterion, &others, &symbols[g], system.groups()[g].channel());
            for (c, label) in labels[g].iter_mut().enumerate() {
                let worth = |z: usize| dot(sensor.cells.row(c), gains.row(z));
                let mut best = (*label, worth(*label));
                for z in 0..sensor.levels {
                    let w = worth(z);
                    if w > best.1 {
                        best = (z, w);
                    }
                }
                changed |= best.0 != *label;
                *label = best.0;
            }
            symbols[g] = through(g, &sensor.level_probabilities(&labels[g]));
        }
        if !changed {
            return;
        }
    }
}
