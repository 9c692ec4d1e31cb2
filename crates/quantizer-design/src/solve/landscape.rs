//! A criterion as a function of the words that are assigned to the cells of a grid.
//!
//! The sample axis of every sensor is divided into a few dozen grid cells. Given the symbols of the other sensors, the moments of
//! each grid cell form a table, the *block* of that sensor. With the block, changes of the sensor's breakpoints or words
//! need no sums over quadrature nodes: a change takes a few thousand multiplications.

use crate::criterion::{Criterion, LOG_FLOOR, Scored};
use crate::deadline::Deadline;
use crate::error::Error;
use crate::law::negative_entropy;
use crate::observation_model::{ObservationModel, Resolution};
use crate::outcomes::{NodeWeights, Table, add_scaled, cell_probabilities, dot, intervals, moments_until};
use fewbits_quantizers::Channel;

/// Half-width of the table of a sample, in its standard deviations.
pub(super) const REACH: f64 = 4.5;
/// Number of steps of that table.
const PLACES: usize = 400;
/// Assumed number of sweeps over the cells of a sensor per block, for estimates of the work.
const SWEEPS: f64 = 5.0;

/// Moments of the outcome "symbol `output` received", from the moments of each word, if word `w` is sent as `renamed[w]`.
fn mix(law: &Channel, output: usize, words: &[f64], renamed: &[usize], outcome: &mut [f64]) {
    outcome.fill(0.0);
    for (moments, word) in words.chunks_exact(outcome.len()).zip(renamed) {
        add_scaled(outcome, law.probability(output, *word), moments);
    }
}

/// One observation model, on coarse nodes.
#[derive(Debug, Clone)]
struct Scenario {
    weight: f64,
    model: ObservationModel,
    features: Vec<NodeWeights>,
}

/// The grid of one sensor: edges, and the probability of each cell at each node, for each scenario.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) edges: Vec<f64>,
    cells: Vec<Table>,
}

/// The word of each grid cell.
pub(super) type Words = Vec<usize>;

/// The criterion of a model, or of a mixture of models, and the channels of the words.
#[derive(Debug, Clone)]
pub(super) struct Landscape {
    scenarios: Vec<Scenario>,
    scored: Scored,
    /// The channel from the words of each sensor to the received symbols.
    pub(super) laws: Vec<Channel>,
    samples: Vec<Sample>,
}

/// The distribution of a sensor's sample under the first scenario, as a table.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    pub(super) mean: f64,
    pub(super) deviation: f64,
    places: Vec<f64>,
    below: Vec<f64>,
}

impl Sample {
    fn of(model: &ObservationModel, sensor: usize) -> Self {
        let (mean, deviation) = (model.prior().mean(), model.sample_deviation(sensor));
        let place = |i: usize| mean + REACH * deviation * (2.0 * i as f64 / PLACES as f64 - 1.0);
        let places: Vec<f64> = (0..=PLACES).map(place).collect();
        let noise = model.noise().deviation(sensor);
        let at = |y: &f64| {
            let mut below = vec![f64::NEG_INFINITY; model.values.len()];
            let upper: Vec<f64> = model.values.iter().map(|x| (y - x) / noise).collect();
            intervals(&mut below, &upper);
            dot(&below, &model.weights)
        };
        Self {
            mean,
            deviation,
            below: places.iter().map(at).collect(),
            places,
        }
    }

    /// The `parts - 1` quantiles that divide the sample into parts of equal probability.
    pub(super) fn quantiles(&self, parts: usize) -> Vec<f64> {
        (1..parts)
            .map(|i| {
                let target = i as f64 / parts as f64;
                let at = self.below.partition_point(|p| *p < target).clamp(1, PLACES);
                let (low, high) = (self.below[at - 1], self.below[at]);
                let share = if high > low {
                    ((target - low) / (high - low)).clamp(0.0, 1.0)
                } else {
                    0.5
                };
                self.places[at - 1] + share * (self.places[at] - self.places[at - 1])
            })
            .collect()
    }
}

/// Moments of every grid cell of one sensor for every joint symbol of the others: `[other][cell][feature]`.
pub(super) struct Block {
    moments: Vec<f64>,
    pub(super) others: usize,
    cells: usize,
    pub(super) sensor: usize,
}

impl Landscape {
    /// `models` come with weights; more than one is possible only for the squared error. Each is discretised on fewer nodes here.
    pub(super) fn new(
        models: &[(f64, &ObservationModel)],
        criterion: Criterion,
        laws: Vec<Channel>,
        resolution: Resolution,
    ) -> Result<Self, Error> {
        let coarse = models
            .iter()
            .map(|(_, s)| s.at(resolution))
            .collect::<Result<Vec<_>, _>>()?;
        let scored = Scored::new(criterion, &coarse[0])?;
        let reference = coarse[0].mean;
        let scenarios = coarse
            .into_iter()
            .zip(models)
            .map(|(model, (weight, _))| {
                let features = if criterion == Criterion::MeanSquaredError {
                    // The moments of all scenarios are taken about the same point.
                    let (offset, mass) = (model.mean - reference, &model.mass.weights);
                    let moment = model.moment.weights.iter().zip(mass).map(|(m, w)| m + offset * w);
                    vec![model.mass.clone(), NodeWeights::of_all(moment.collect())]
                } else {
                    scored.features().to_vec()
                };
                Scenario {
                    weight: *weight,
                    model,
                    features,
                }
            })
            .collect();
        Ok(Self {
            samples: (0..laws.len()).map(|n| Sample::of(models[0].1, n)).collect(),
            scenarios,
            scored,
            laws,
        })
    }

    /// Changes the weights of the models.
    pub(super) fn set_weights(&mut self, weights: &[f64]) {
        self.scenarios.iter_mut().zip(weights).for_each(|(s, w)| s.weight = *w);
    }

    /// Number of moments of an outcome.
    pub(super) fn width(&self) -> usize {
        self.scenarios[0].features.len()
    }

    /// Multiplications of one round over the sensors: their blocks, and the sweeps over cells and words.
    pub(super) fn work(&self, grid: usize) -> f64 {
        let outcomes: f64 = self.laws.iter().map(|l| l.outputs() as f64).product();
        let nodes: f64 = self
            .scenarios
            .iter()
            .map(|s| s.features.iter().map(|f| f.weights.len() as f64).sum::<f64>())
            .sum();
        let sweeps = |l: &Channel| SWEEPS * (l.outputs() * self.width()) as f64;
        let block = |l: &Channel| outcomes / l.outputs() as f64 * grid as f64 * (nodes + sweeps(l));
        self.laws.iter().map(block).sum()
    }

    /// Computes the cell probabilities of a grid for one sensor.
    pub(super) fn grid(&self, sensor: usize, edges: Vec<f64>) -> Grid {
        let cells = self.scenarios.iter().map(|scenario| {
            let (means, deviation) = scenario.model.sample_law(sensor);
            cell_probabilities(&means, deviation, &edges)
        });
        Grid {
            cells: cells.collect(),
            edges,
        }
    }

    /// A sensor's sample under the first scenario.
    pub(super) fn sample(&self, sensor: usize) -> &Sample {
        &self.samples[sensor]
    }

    /// Probability of each symbol of a sensor at each node, for each scenario.
    pub(super) fn symbols(&self, sensor: usize, grid: &Grid, words: &[usize]) -> Vec<Table> {
        grid.cells
            .iter()
            .map(|cells| self.symbols_in(cells, sensor, words))
            .collect()
    }

    /// As [`symbols`](Self::symbols), in one scenario, given the probabilities of the grid's cells.
    fn symbols_in(&self, cells: &Table, sensor: usize, words: &[usize]) -> Table {
        let law = &self.laws[sensor];
        let levels = cells.mixed(law.inputs(), |w, c| f64::from(words[c] == w));
        levels.mixed(law.outputs(), |t, w| law.probability(t, w))
    }

    /// The block of a sensor, given the symbols of all sensors (its own are not used); `None` if the time limit is reached first.
    pub(super) fn block(
        &self,
        sensor: usize,
        grid: &Grid,
        symbols: &[Vec<Table>],
        deadline: Deadline,
    ) -> Option<Block> {
        let mut total: Vec<f64> = Vec::new();
        for (s, scenario) in self.scenarios.iter().enumerate() {
            // Moments of every outcome of the other sensors with every cell of this one. After this, assignments of words are evaluated by
            // additions.
            let others = symbols
                .iter()
                .enumerate()
                .filter(|(n, _)| *n != sensor)
                .map(|(_, t)| &t[s]);
            let tables: Vec<&Table> = others.chain([&grid.cells[s]]).collect();
            let sums = moments_until(&tables, &scenario.features, deadline)?;
            total.resize(sums.len(), 0.0);
            add_scaled(&mut total, scenario.weight, &sums);
        }
        let cells = grid.edges.len() + 1;
        Some(Block {
            others: total.len() / (cells * self.width()),
            moments: total,
            cells,
            sensor,
        })
    }

    /// The signed criterion, without constants and without the other sensors' part of the conditional entropy.
    pub(super) fn value(&self, block: &Block, grid: &Grid, words: &[usize]) -> f64 {
        let levels = self.levels(block, words);
        let unchanged: Words = (0..self.laws[block.sensor].inputs()).collect();
        self.value_of_levels(block, grid, &levels, words, &unchanged)
    }

    /// Moments of each word: `[other][word][feature]`.
    pub(super) fn levels(&self, block: &Block, words: &[usize]) -> Vec<f64> {
        let (width, count) = (self.width(), self.laws[block.sensor].inputs());
        let mut levels = vec![0.0; block.others * count * width];
        for other in 0..block.others {
            for (c, word) in words.iter().enumerate() {
                let from = (other * block.cells + c) * width;
                let to = (other * count + word) * width;
                add_scaled(&mut levels[to..to + width], 1.0, &block.moments[from..from + width]);
            }
        }
        levels
    }

    /// The value if the word `w` is sent as `renamed[w]`.
    pub(super) fn value_of_levels(
        &self,
        block: &Block,
        grid: &Grid,
        levels: &[f64],
        words: &[usize],
        renamed: &[usize],
    ) -> f64 {
        let law = &self.laws[block.sensor];
        let mut outcome = vec![0.0; self.width()];
        let mut value = 0.0;
        // For every outcome of the other sensors, the link mixes the words to symbols, and each symbol has its value.
        for other in levels.chunks_exact(law.inputs() * self.width()) {
            for t in 0..law.outputs() {
                mix(law, t, other, renamed, &mut outcome);
                value += self.scored.value(&outcome, 0.0);
            }
        }
        if self.scored.has_separable_entropy() {
            let renamed: Words = words.iter().map(|w| renamed[*w]).collect();
            value += self.own_entropy(&self.symbols_in(&grid.cells[0], block.sensor, &renamed));
        }
        value
    }

    /// Contribution of a sensor's symbols to the conditional entropy.
    fn own_entropy(&self, symbols: &Table) -> f64 {
        negative_entropy(symbols, &self.scenarios[0].model.mass.weights)
    }

    /// The value of a whole design; `None` if the time limit is reached first.
    pub(super) fn total(
        &self,
        grids: &[Grid],
        words: &[Words],
        symbols: &[Vec<Table>],
        deadline: Deadline,
    ) -> Option<f64> {
        let last = grids.len() - 1;
        let block = self.block(last, &grids[last], symbols, deadline)?;
        let mut value = self.value(&block, &grids[last], &words[last]);
        if self.scored.has_separable_entropy() {
            value += symbols[..last].iter().map(|s| self.own_entropy(&s[0])).sum::<f64>();
        }
        Some(value)
    }

    /// Scale with which changes of a value are compared.
    pub(super) fn unit(&self, value: f64) -> f64 {
        self.scored.unit(value, &self.scenarios[0].model)
    }

    /// Gain of each word for each grid cell, for a fixed decoder: `[cell][word]`.
    pub(super) fn worth(&self, block: &Block, grid: &Grid, words: &[usize]) -> Vec<f64> {
        let law = &self.laws[block.sensor];
        let (width, count, outputs) = (self.width(), law.inputs(), law.outputs());
        let levels = self.levels(block, words);
        let mut per_symbol = vec![0.0; block.cells * outputs];
        let unchanged: Words = (0..count).collect();
        let (mut outcome, mut slopes) = (vec![0.0; width], vec![0.0; outputs * width]);
        let cells = block.moments.chunks_exact(block.cells * width);
        for (own, cells) in levels.chunks_exact(count * width).zip(cells) {
            for (t, slope) in slopes.chunks_exact_mut(width).enumerate() {
                mix(law, t, own, &unchanged, &mut outcome);
                // For a fixed decoder the criterion is linear in the outcome, and its slope gives the gain of a cell for each symbol.
                self.scored.slope(&outcome, 0.0, slope);
            }
            for (cell, out) in cells.chunks_exact(width).zip(per_symbol.chunks_exact_mut(outputs)) {
                for (slope, out) in slopes.chunks_exact(width).zip(out) {
                    *out += slope.iter().zip(cell).map(|(s, m)| s * m).sum::<f64>();
                }
            }
        }
        if self.scored.has_separable_entropy() {
            let symbols = self.symbols_in(&grid.cells[0], block.sensor, words);
            let mass = &self.scenarios[0].model.mass.weights;
            for t in 0..outputs {
                let logs = symbols.row(t).iter().zip(mass).map(|(p, w)| w * p.max(LOG_FLOOR).ln());
                let logs: Vec<f64> = logs.collect();
                for c in 0..block.cells {
                    per_symbol[c * outputs + t] += dot(&logs, grid.cells[0].row(c));
                }
            }
        }
        // The gain of a word is the mean gain of the symbols into which the link turns it.
        let mut worth = vec![0.0; block.cells * count];
        for (out, per_symbol) in worth.chunks_exact_mut(count).zip(per_symbol.chunks_exact(outputs)) {
            for (w, out) in out.iter_mut().enumerate() {
                *out = per_symbol
                    .iter()
                    .enumerate()
                    .map(|(t, r)| law.probability(t, w) * r)
                    .sum();
            }
        }
        worth
    }
}
