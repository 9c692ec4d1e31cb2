//! The thesis's decoders of the bits of all sensors, as tables, and their exact errors.

use fewbits_binary_patterns::engine::{Kind, support};
use fewbits_binary_patterns::{Bank, Error, LookupTable, Nodes};
use fewbits_numerics::golden::maximum;
use fewbits_numerics::normal::log_pdf;
use fewbits_quantizer_design::outcomes::{Table, for_each_log};
use fewbits_quantizers::Quantizer;

/// Smaller probabilities are replaced by this before their logarithm is multiplied by a count, which may be zero.
const FLOOR: f64 = 1e-300;
/// Scores closer than this are ties, and the lowest cell is taken; scores of symmetric outcomes are equal up to rounding.
const TIE: f64 = 1e-11;
/// Smallest and largest number of points of the scan for the largest density, and points per noise standard deviation.
const MIN_POINTS: usize = 4001;
const MAX_POINTS: usize = 64_001;
const PER_NOISE: f64 = 8.0;
/// Log densities closer than this belong to the same plateau.
const PLATEAU: f64 = 1e-12;
/// Relative width at which golden-section search stops.
const GOLDEN_STOP: f64 = 1e-10;

/// Rule by which the fusion centre computes an estimate from the bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Decoder<'a> {
    /// Posterior mean, [`Bank::table`]: the least mean squared error.
    Mmse,
    /// Centroid of the cell `l` that maximises `ln P(c_l) + sum_n ln P(z_n|c_l)`. This is equation 5.10 with the missing division of
    /// `P(z_n, c_l)` by `P(c_l)` (erratum `binary-4`). The bits are treated as independent given the cell, but they are independent
    /// only given `X` (erratum `binary-5`).
    DiscreteMap(&'a Quantizer),
    /// Equation 5.10 as printed, with joint in place of conditional probabilities. Equal to [`Self::DiscreteMap`] for
    /// equally likely cells; up to three times its error for a Gaussian source.
    PrintedDiscreteMap(&'a Quantizer),
    /// Centroid of the cell of greatest posterior probability `int_cell p(x) prod_n P(z_n|x) dx`.
    ExactDivisionMap(&'a Quantizer),
    /// The `x` in the support that maximises `ln p(x) + sum_n ln P(z_n|x)`; the midpoint of a plateau, the lowest of equal maxima.
    ContinuousMap,
}

impl Decoder<'_> {
    /// The look-up table of the decoder.
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes.
    pub fn table(self, bank: &Bank) -> Result<LookupTable, Error> {
        let outcomes = bank.checked_outcomes()?;
        let estimates = match self {
            Self::Mmse => return bank.table(),
            Self::DiscreteMap(grid) => division_map(bank, grid, |p, mass| p / mass.max(FLOOR)),
            Self::PrintedDiscreteMap(grid) => division_map(bank, grid, |p, _| p),
            Self::ExactDivisionMap(grid) => exact_division_map(bank, grid, outcomes),
            Self::ContinuousMap => continuous_map(bank),
        };
        LookupTable::new(bank.clone(), estimates)
    }

    /// Exact mean squared error of the decoder.
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes.
    pub fn mse(self, bank: &Bank) -> Result<f64, Error> {
        match self {
            Self::Mmse => bank.mmse(),
            other => Ok(other.table(bank)?.mse()),
        }
    }
}

/// A cell of the grid within the support.
struct Cell {
    nodes: Nodes,
    mass: f64,
    centroid: f64,
}

/// Nodes with breaks at the edges of `grid`, for each cell.
fn cells(bank: &Bank, grid: &Quantizer) -> Vec<Cell> {
    let supports = (0..grid.cells()).filter_map(|cell| support(grid, cell, bank.source()));
    let cell = |(low, high): (f64, f64)| {
        let nodes = bank.nodes_between(low, high);
        let mass = nodes.expectation(|_| 1.0);
        let centroid = if mass > 0.0 {
            nodes.expectation(|x| x) / mass
        } else {
            0.5 * (low + high)
        };
        Cell { nodes, mass, centroid }
    };
    supports.map(cell).collect()
}

/// `scaled` makes of the joint probability of bit and cell, and that of the cell, what is multiplied over the sensors.
fn division_map(bank: &Bank, grid: &Quantizer, scaled: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let cells = cells(bank, grid);
    let log = |p: f64| p.max(FLOOR).ln();
    let tables = bank.groups().map(|(sensor, count)| {
        let bit = |bit: usize, cell: &Cell| {
            let pairs = cell.nodes.points.iter().zip(&cell.nodes.weights);
            let joint: f64 = pairs
                .map(|(&x, &w)| w * sensor.quantizer().probabilities(x, sensor.noise_deviation())[bit])
                .sum();
            log(scaled(joint, cell.mass))
        };
        let rows = [0, 1].map(|b| cells.iter().map(|cell| bit(b, cell)).collect::<Vec<_>>());
        Table::new(rows.concat(), cells.len()).of_log_counts(count)
    });
    let tables: Vec<Table> = tables.collect();
    let prior: Vec<f64> = cells.iter().map(|cell| log(cell.mass)).collect();
    let mut estimates = Vec::new();
    // With the logarithm of the cell's prior probability the score is the log posterior up to a constant.
    for_each_log(&tables, &prior, |_, score| {
        estimates.push(cells[first_largest(score, |best| TIE * best.abs().max(1.0))].centroid);
    });
    estimates
}

fn exact_division_map(bank: &Bank, grid: &Quantizer, outcomes: usize) -> Vec<f64> {
    let cells = cells(bank, grid);
    let (mut nodes, mut ends) = (Nodes::default(), Vec::with_capacity(cells.len()));
    for cell in &cells {
        nodes.points.extend(&cell.nodes.points);
        nodes.weights.extend(&cell.nodes.weights);
        ends.push(nodes.points.len());
    }
    let mut estimates = vec![0.0; outcomes];
    let mut score = vec![0.0; cells.len()];
    bank.for_outcomes(&nodes, |index, w| {
        let mut from = 0;
        for (s, &to) in score.iter_mut().zip(&ends) {
            *s = w[from..to].iter().sum();
            from = to;
        }
        estimates[index] = cells[first_largest(&score, |best| TIE * best)].centroid;
    });
    estimates
}

/// The first index whose score is within `slack(best)` of the best score.
fn first_largest(scores: &[f64], slack: impl Fn(f64) -> f64) -> usize {
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let enough = best - slack(best);
    scores.iter().position(|&s| s >= enough).unwrap_or(0)
}

/// For each outcome, the argument of the largest posterior density, which may have several peaks and plateaus.
///
/// A dense scan finds the highest peak; a golden-section search refines it. On a plateau the estimate is its midpoint.
fn continuous_map(bank: &Bank) -> Vec<f64> {
    let reach = bank.source().reach();
    let noises = bank.groups().map(|(sensor, _)| sensor.noise_deviation());
    let finest = noises.fold(f64::INFINITY, f64::min);
    let intervals = (PER_NOISE * 2.0 * reach / finest).min(MAX_POINTS as f64 - 1.0) as usize;
    // An even number of intervals, so that zero and both ends are points of the scan.
    let intervals = intervals.max(MIN_POINTS - 1).next_multiple_of(2);
    let points: Vec<f64> = (0..=intervals)
        .map(|i| reach * (2.0 * i as f64 - intervals as f64) / intervals as f64)
        .collect();
    let prior = |x: f64| match bank.source().kind() {
        Kind::Uniform { .. } => 0.0,
        Kind::Gaussian { deviation } => log_pdf(x / deviation),
    };
    let log_prior: Vec<f64> = points.iter().map(|&x| prior(x)).collect();
    let mut estimates = Vec::new();
    bank.for_log_outcomes(&points, |index, likelihood| {
        let score: Vec<f64> = likelihood.iter().zip(&log_prior).map(|(l, p)| l + p).collect();
        let best = score.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let enough = best - PLATEAU * best.abs().max(1.0);
        let first = score.iter().position(|&s| s >= enough).unwrap_or(0);
        let last = (first..points.len())
            .take_while(|&i| score[i] >= enough)
            .last()
            .unwrap_or(first);
        // Four neighbours are as high only on a plateau: about a smooth peak at most two are.
        if last > first + 2 {
            estimates.push(0.5 * (points[first] + points[last]));
            return;
        }
        // Between the points on either side the log posterior is unimodal, so the golden-section search finds its peak. The numbers of ones
        // are the digits of the outcome's index.
        let (mut groups, mut rest) = (Vec::new(), index);
        for (sensor, count) in bank.groups().collect::<Vec<_>>().into_iter().rev() {
            groups.push((sensor, count, rest % (count + 1)));
            rest /= count + 1;
        }
        let posterior = |x: f64| {
            groups.iter().rev().fold(prior(x), |sum, (sensor, count, ones)| {
                let [l0, l1] = sensor.log_probabilities(x);
                sum + *ones as f64 * l1 + (count - ones) as f64 * l0
            })
        };
        let (low, high) = (points[first.saturating_sub(1)], points[(last + 1).min(points.len() - 1)]);
        estimates.push(maximum(posterior, low, high, GOLDEN_STOP).0);
    });
    estimates
}
