//! Beliefs over the cells of a floor plan: which cell holds a source of unknown rate, from steady readings of sensors.

use fewbits_diffusive::{RateRange, RateSums};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::kernels::log_sum_exp;
use fewbits_numerics::normal::log_interval;

/// What sensors report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Report {
    /// The reading itself.
    Value,
    /// The cell of the reading, of eight: three bits.
    Word,
}

/// Thresholds of a word.
pub(super) const THRESHOLDS: usize = 7;
/// Nodes of the table of a word's probabilities over the clean concentration.
const NODES: usize = 4096;
/// Distance of the rates, in their logarithm, at which the likelihood of words is averaged: below the least width that words leave.
const RATE_STEP: f64 = 0.027;
/// Sensors between two tests whether a cell still matters.
const BLOCK: usize = 4;
/// Mass of the credible regions.
const CREDIBLE: f64 = 0.9;
/// A cell whose log likelihood is below that of the best by more than this has no weight.
const NEGLIGIBLE: f64 = 60.0;

/// What a concentration becomes: noise, and the thresholds of words.
pub(super) struct Instrument {
    pub noise: f64,
    pub thresholds: [f64; THRESHOLDS],
    /// Nodes of the table per unit of concentration.
    density: f64,
    /// `ln p(word | clean concentration)` at the nodes, for each word.
    table: Vec<Vec<f64>>,
}

impl Instrument {
    /// `noise` and the thresholds in kg/m^3; `largest` is the largest concentration that is told apart.
    pub fn new(noise: f64, thresholds: [f64; THRESHOLDS], largest: f64) -> Self {
        let edge = |k: usize| match k {
            0 => f64::NEG_INFINITY,
            k if k > THRESHOLDS => f64::INFINITY,
            k => thresholds[k - 1],
        };
        let at = |word: usize, node: usize| {
            let clean = largest * node as f64 / (NODES - 1) as f64;
            log_interval((edge(word) - clean) / noise, (edge(word + 1) - clean) / noise)
        };
        let table = (0..=THRESHOLDS).map(|word| (0..NODES).map(|node| at(word, node)).collect());
        Self {
            noise,
            thresholds,
            density: (NODES - 1) as f64 / largest,
            table: table.collect(),
        }
    }

    pub fn word(&self, reading: f64) -> usize {
        self.thresholds.partition_point(|t| *t <= reading)
    }

    /// A row of the table, or a sum of rows, between nodes.
    #[inline(always)]
    fn look_up(&self, row: &[f64], clean: f64) -> f64 {
        let position = (clean * self.density).clamp(0.0, (NODES - 1) as f64);
        let low = (position as usize).min(NODES - 2);
        row[low] + (position - low as f64) * (row[low + 1] - row[low])
    }

    /// Probabilities of the words.
    pub fn words(&self, clean: f64) -> [f64; THRESHOLDS + 1] {
        std::array::from_fn(|word| self.look_up(&self.table[word], clean).exp())
    }
}

/// Of some sensors the responses to a unit rate in each cell, and the readings, several of each.
pub(super) type Sensed<'a> = (&'a [Vec<f64>], &'a [Vec<f64>]);

/// The belief after some sensors.
pub(super) struct PlanBelief {
    /// Probability of each cell.
    pub weights: Vec<f64>,
    /// The most probable cell.
    pub mode: usize,
    /// How far the readings are from what the best cell and rate predict, in standard deviations of that; above 0 is worse.
    pub misfit: f64,
}

impl PlanBelief {
    /// The belief of a uniform prior over cells, and over rates between `rates`, after what some sensors said.
    pub fn new(
        instrument: &Instrument,
        report: Report,
        rates: [f64; 2],
        sensed: Sensed<'_>,
    ) -> Result<Self, ArgumentError> {
        let (logs, misfit) = match report {
            Report::Value => of_values(instrument, rates, sensed)?,
            Report::Word => {
                let words = |readings: &Vec<f64>| readings.iter().map(|y| instrument.word(*y)).collect();
                let words: Vec<Vec<usize>> = sensed.1.iter().map(words).collect();
                of_words(instrument, rates, (sensed.0, &words), f64::NEG_INFINITY)
            }
        };
        Ok(Self::of_logs(&logs, misfit))
    }

    /// The belief whose logarithms, up to a constant, are given.
    pub fn of_logs(logs: &[f64], misfit: f64) -> Self {
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut weights: Vec<f64> = logs.iter().map(|log| (log - largest).exp()).collect();
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        let mode = (0..weights.len()).max_by(|a, b| weights[*a].total_cmp(&weights[*b]));
        let mode = mode.unwrap_or(0);
        Self { weights, mode, misfit }
    }

    /// Whether the credible region of nine tenths holds a cell. The region has exactly that mass: the cell that would exceed it belongs
    /// to it by `chance`, uniform from 0 to 1.
    pub fn covers(&self, cell: usize, chance: f64) -> bool {
        let own = self.weights[cell];
        let above: f64 = self.weights.iter().filter(|weight| **weight > own).sum();
        above + chance * own < CREDIBLE
    }
}

fn of_values(
    instrument: &Instrument,
    [low, high]: [f64; 2],
    (responses, readings): Sensed<'_>,
) -> Result<(Vec<f64>, f64), ArgumentError> {
    let (range, samples) = (RateRange::new(low, high)?, readings.concat());
    let (mut logs, mut smallest) = (Vec::new(), f64::INFINITY);
    for cell in 0..responses[0].len() {
        let each = responses.iter().zip(readings);
        let responses: Vec<f64> = each.flat_map(|(a, y)| y.iter().map(|_| a[cell])).collect();
        let sums = RateSums::of(&samples, &responses, instrument.noise)?;
        logs.push(sums.log_marginal(&range));
        let best = (sums.correlation / sums.response.max(f64::MIN_POSITIVE)).clamp(low, high);
        smallest = smallest.min(sums.energy - best * (2.0 * sums.correlation - best * sums.response));
    }
    // Position and rate are fitted.
    let freedom = (samples.len() as f64 - 3.0).max(1.0);
    Ok((logs, (smallest - freedom) / (2.0 * freedom).sqrt()))
}

/// Logarithm of each cell's likelihood, averaged over the rate, and the misfit, of sensors that each sent some words.
/// Cells that are far below `known`, a logarithm that another model reached, have no weight either.
pub(super) fn of_words(
    instrument: &Instrument,
    [low, high]: [f64; 2],
    (responses, words): (&[Vec<f64>], &[Vec<usize>]),
    known: f64,
) -> (Vec<f64>, f64) {
    // One row for each sensor: all its words together.
    let row = |words: &Vec<usize>| {
        let mut row = vec![0.0; NODES];
        for word in words {
            let logs = row.iter_mut().zip(&instrument.table[*word]);
            logs.for_each(|(sum, log)| *sum += log);
        }
        row
    };
    let rows: Vec<Vec<f64>> = words.iter().map(row).collect();
    // Nodes in the logarithm of the rate, weighted by the uniform density.
    let count = ((high / low).ln() / RATE_STEP).ceil() as usize;
    let rate = |k: usize| low * (high / low).powf((k as f64 + 0.5) / count as f64);
    let rates: Vec<f64> = (0..count).map(rate).collect();
    // Logarithms of probabilities: what some sensors say of a cell and a rate bounds from above what all say.
    let add = |terms: &mut [f64], cell: usize, of: std::ops::Range<usize>| {
        for (row, response) in rows[of.clone()].iter().zip(&responses[of]) {
            for (term, rate) in terms.iter_mut().zip(&rates) {
                *term += instrument.look_up(row, rate * response[cell]);
            }
        }
        terms.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    };
    let first = BLOCK.min(rows.len());
    let begin = |cell: usize| {
        let mut terms = vec![0.0; count];
        (add(&mut terms, cell, 0..first), cell, terms)
    };
    let mut open: Vec<(f64, usize, Vec<f64>)> = (0..responses[0].len()).map(begin).collect();
    open.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut best, mut logs) = ((known, 0, 1.0), vec![f64::NEG_INFINITY; responses[0].len()]);
    for (mut bound, cell, mut terms) in open {
        let mut done = first;
        while done < rows.len() && bound > best.0 - NEGLIGIBLE {
            let next = (done + BLOCK).min(rows.len());
            bound = add(&mut terms, cell, done..next);
            done = next;
        }
        if done < rows.len() {
            continue;
        }
        for (term, rate) in terms.iter_mut().zip(&rates) {
            if *term > best.0 {
                best = (*term, cell, *rate);
            }
            *term += rate.ln();
        }
        logs[cell] = log_sum_exp(&terms);
    }
    // The logarithm of the likelihood has known moments if the best cell and rate are true.
    let (log, cell, rate) = best;
    let (mut mean, mut variance) = (0.0, 0.0);
    for (responses, words) in responses.iter().zip(words) {
        let terms = |p: f64| [p * p.ln(), p * p.ln().powi(2)];
        let entropy = instrument
            .words(rate * responses[cell])
            .map(|p| if p > 0.0 { terms(p) } else { [0.0; 2] });
        let first: f64 = entropy.iter().map(|e| e[0]).sum();
        mean += words.len() as f64 * first;
        variance += words.len() as f64 * (entropy.iter().map(|e| e[1]).sum::<f64>() - first * first);
    }
    (logs, (mean - log) / variance.max(f64::MIN_POSITIVE).sqrt())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Cells are left out only where the sum over all sensors and rates is negligible; all others have that sum.
    #[test]
    fn cells_that_are_left_out_have_no_weight() {
        let thresholds = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7];
        let instrument = Instrument::new(0.05, thresholds, 3.0);
        let (cells, rates) = (60_u32, [0.5, 1.5]);
        let distance = |sensor: u32, cell: u32| f64::from(sensor * 3) - f64::from(cell);
        let response = |sensor| (0..cells).map(move |cell| 1.0 / (1.0 + 0.02 * distance(sensor, cell).powi(2)));
        let responses: Vec<Vec<f64>> = (0..20).map(|sensor| response(sensor).collect()).collect();
        let readings: Vec<Vec<f64>> = responses.iter().map(|a| vec![0.9 * a[31]; 3]).collect();
        let words: Vec<Vec<usize>> = readings
            .iter()
            .map(|y| y.iter().map(|y| instrument.word(*y)).collect())
            .collect();
        let (logs, _) = of_words(&instrument, rates, (&responses, &words), f64::NEG_INFINITY);
        let count = ((rates[1] / rates[0]).ln() / RATE_STEP).ceil() as usize;
        let brute = |cell: usize| {
            let terms = (0..count).map(|k| {
                let rate = rates[0] * (rates[1] / rates[0]).powf((k as f64 + 0.5) / count as f64);
                let of = |(a, y): (&Vec<f64>, &Vec<f64>)| -> f64 {
                    let row = |y: &f64| instrument.look_up(&instrument.table[instrument.word(*y)], rate * a[cell]);
                    y.iter().map(row).sum()
                };
                responses.iter().zip(&readings).map(of).sum::<f64>() + rate.ln()
            });
            log_sum_exp(&terms.collect::<Vec<f64>>())
        };
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert_eq!(logs[31], largest);
        let mut left_out = 0;
        for (cell, log) in logs.iter().enumerate() {
            let exact = brute(cell);
            if *log == f64::NEG_INFINITY {
                left_out += 1;
                assert!(exact < largest - 50.0, "cell {cell}: {exact} of {largest}");
            } else {
                assert!((log - exact).abs() < 1e-9, "cell {cell}: {log} for {exact}");
            }
        }
        assert!(left_out > 10 && left_out < 59, "{left_out}");
    }
}
