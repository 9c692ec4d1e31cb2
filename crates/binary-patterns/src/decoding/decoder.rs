//! Fusion-centre decoders as look-up tables, and their exact mean squared errors.

use crate::Error;
use crate::decoding::continuous_map;
use crate::observation::bank::{Bank, IMPOSSIBLE};
use crate::observation::source::Nodes;
use crate::{CellGrid, LookupTable};
use fewbits_core::Observation;
use fewbits_numerics::error::{entries, finite};

/// Smaller probabilities are replaced by this before their logarithm is multiplied by a count, which may be zero.
const FLOOR: f64 = 1e-300;
/// Scores closer than this are ties, and the lowest cell is taken; scores of symmetric outcomes are equal up to rounding.
const TIE: f64 = 1e-11;

/// Rule by which the fusion centre computes an estimate from the bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Decoder<'a> {
    /// Posterior mean: the least mean squared error.
    Mmse,
    /// Centroid of the cell `l` that maximises `ln P(c_l) + sum_n ln P(z_n|c_l)`. This is equation 5.10 with the missing division of
    /// `P(z_n, c_l)` by `P(c_l)` (erratum `binary-4`). The bits are treated as independent given the cell, but they are independent
    /// only given `X` (erratum `binary-5`).
    DiscreteMap(&'a CellGrid),
    /// Equation 5.10 as printed, with joint in place of conditional probabilities. Equal to [`Self::DiscreteMap`] for
    /// equally likely cells; up to three times its error for a Gaussian source.
    PrintedDiscreteMap(&'a CellGrid),
    /// Centroid of the cell of greatest posterior probability `int_cell p(x) prod_n P(z_n|x) dx`.
    ExactDivisionMap(&'a CellGrid),
    /// The `x` in the support that maximises `ln p(x) + sum_n ln P(z_n|x)`; the midpoint of a plateau, the lowest of equal maxima.
    ContinuousMap,
}

impl Bank {
    /// The posterior mean from one observation per sensor, without a table. A missing bit carries no information.
    ///
    /// # Errors
    /// If the number of observations is not the number of sensors.
    pub fn posterior_mean(&self, observations: &[Observation<bool>]) -> Result<f64, Error> {
        let (score, nodes) = self.posterior_score(observations)?;
        Ok(mean_under(&score, &nodes))
    }

    /// `E[(x - estimate)^2 | observations]` from one observation per sensor, in squared units of the source. A missing bit carries no
    /// information. At the posterior mean it is the posterior variance.
    ///
    /// # Errors
    /// If the number of observations is not the number of sensors, or `estimate` is not finite.
    pub fn posterior_squared_error(&self, observations: &[Observation<bool>], estimate: f64) -> Result<f64, Error> {
        finite("estimate", estimate)?;
        let (score, nodes) = self.posterior_score(observations)?;
        let w = weights_under(&score, &nodes);
        let (mass, _) = moments(&w, &nodes.x);
        Ok(if mass > 0.0 {
            squared_error(&w, &nodes.x, estimate) / mass
        } else {
            0.0
        })
    }

    /// Log likelihood of the observations at the quadrature nodes of the source, and the nodes.
    fn posterior_score(&self, observations: &[Observation<bool>]) -> Result<(Vec<f64>, Nodes), Error> {
        entries("observations", observations.len(), self.sensors())?;
        let nodes = self.fine_nodes();
        let mut score = vec![0.0; nodes.len()];
        for (n, observation) in observations.iter().enumerate() {
            let Some(bit) = observation.received() else {
                continue;
            };
            let sensor = self.sensor(n);
            for (s, x) in score.iter_mut().zip(&nodes.x) {
                *s += sensor.log_probabilities(*x)[usize::from(*bit)];
            }
        }
        Ok((score, nodes))
    }

    /// The look-up table of a decoder.
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes.
    pub fn table(&self, decoder: Decoder<'_>) -> Result<LookupTable, Error> {
        let outcomes = self.checked_outcomes()?;
        let estimates = match decoder {
            Decoder::Mmse => self.posterior_means(outcomes),
            Decoder::DiscreteMap(grid) => self.division_map(grid, outcomes, Scaling::Conditional),
            Decoder::PrintedDiscreteMap(grid) => self.division_map(grid, outcomes, Scaling::Printed),
            Decoder::ExactDivisionMap(grid) => self.exact_division_map(grid, outcomes),
            Decoder::ContinuousMap => continuous_map::estimates(self, outcomes),
        };
        Ok(LookupTable {
            bank: self.clone(),
            estimates,
        })
    }

    /// Exact mean squared error of a decoder.
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes.
    pub fn mse(&self, decoder: Decoder<'_>) -> Result<f64, Error> {
        match decoder {
            Decoder::Mmse => self.mmse(),
            other => Ok(self.mse_of(&self.table(other)?.estimates)),
        }
    }

    /// Exact mean squared error of the posterior mean, `sum_z int (x - E[X|z])^2 p(x) P(z|x) dx`.
    ///
    /// Every term is positive, so no digits are lost if the error is small.
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes.
    pub fn mmse(&self) -> Result<f64, Error> {
        self.checked_outcomes()?;
        let nodes = self.fine_nodes();
        let mut error = 0.0;
        self.for_outcomes(&nodes, |_, w| {
            let (mass, first) = moments(w, &nodes.x);
            if mass > IMPOSSIBLE {
                error += squared_error(w, &nodes.x, first / mass);
            }
        });
        Ok(error)
    }

    fn mse_of(&self, estimates: &[f64]) -> f64 {
        let nodes = self.fine_nodes();
        let mut error = 0.0;
        self.for_outcomes(&nodes, |index, w| error += squared_error(w, &nodes.x, estimates[index]));
        error
    }

    fn posterior_means(&self, outcomes: usize) -> Vec<f64> {
        let nodes = self.fine_nodes();
        let mut estimates = vec![0.0; outcomes];
        let mut impossible = Vec::new();
        self.for_outcomes(&nodes, |index, w| {
            let (mass, first) = moments(w, &nodes.x);
            if mass > IMPOSSIBLE {
                estimates[index] = first / mass;
            } else {
                impossible.push(index);
            }
        });
        // Outcomes whose probability underflows are computed in logarithms, which takes longer.
        if !impossible.is_empty() {
            let logs = self.log_rows(&nodes.x);
            let mut counts = Vec::new();
            let mut score = vec![0.0; nodes.len()];
            for index in impossible {
                self.counts_at(index, &mut counts);
                self.log_likelihood(&logs, &counts, &mut score);
                estimates[index] = mean_under(&score, &nodes);
            }
        }
        estimates
    }

    /// `[ln P0, ln P1]` at every point for every group.
    pub(crate) fn log_rows(&self, points: &[f64]) -> Vec<Vec<[f64; 2]>> {
        self.groups()
            .iter()
            .map(|g| points.iter().map(|&x| g.sensor.log_probabilities(x)).collect())
            .collect()
    }

    /// `sum_g k ln P1 + (m - k) ln P0` at every point.
    pub(crate) fn log_likelihood(&self, rows: &[Vec<[f64; 2]>], counts: &[usize], score: &mut [f64]) {
        score.fill(0.0);
        for ((row, group), &ones) in rows.iter().zip(self.groups()).zip(counts) {
            let (ones, zeros) = (ones as f64, (group.count - ones) as f64);
            for (s, [l0, l1]) in score.iter_mut().zip(row) {
                *s += ones * l1 + zeros * l0;
            }
        }
    }

    /// Nodes with breaks at the edges of `grid`, for each cell.
    fn cells(&self, grid: &CellGrid) -> Vec<Cell> {
        (0..grid.cells())
            .filter_map(|cell| grid.support(cell, self.source()))
            .map(|(low, high)| {
                let nodes = self.nodes_between(low, high);
                let mass = nodes.expectation(|_| 1.0);
                Cell {
                    centroid: if mass > 0.0 {
                        nodes.expectation(|x| x) / mass
                    } else {
                        0.5 * (low + high)
                    },
                    mass,
                    nodes,
                }
            })
            .collect()
    }

    fn division_map(&self, grid: &CellGrid, outcomes: usize, scaling: Scaling) -> Vec<f64> {
        let cells = self.cells(grid);
        let log = |p: f64| p.max(FLOOR).ln();
        let logs: Vec<Vec<[f64; 2]>> = self
            .groups()
            .iter()
            .map(|g| {
                cells
                    .iter()
                    .map(|cell| {
                        let mut joint = [0.0; 2];
                        for (&x, &w) in cell.nodes.x.iter().zip(&cell.nodes.w) {
                            let [p0, p1] = g.sensor.probabilities(x);
                            joint[0] += w * p0;
                            joint[1] += w * p1;
                        }
                        let scale = if scaling == Scaling::Conditional {
                            cell.mass.max(FLOOR)
                        } else {
                            1.0
                        };
                        joint.map(|p| log(p / scale))
                    })
                    .collect()
            })
            .collect();
        let mut counts = Vec::new();
        let mut score = vec![0.0; cells.len()];
        (0..outcomes)
            .map(|index| {
                self.counts_at(index, &mut counts);
                self.log_likelihood(&logs, &counts, &mut score);
                // Logarithm of the cell's prior probability. The score is then the log posterior up to a constant.
                for (s, cell) in score.iter_mut().zip(&cells) {
                    *s += log(cell.mass);
                }
                cells[first_largest(&score, |best| TIE * best.abs().max(1.0))].centroid
            })
            .collect()
    }

    fn exact_division_map(&self, grid: &CellGrid, outcomes: usize) -> Vec<f64> {
        let cells = self.cells(grid);
        let mut nodes = Nodes::default();
        let mut ends = Vec::with_capacity(cells.len());
        for cell in &cells {
            nodes.x.extend(&cell.nodes.x);
            nodes.w.extend(&cell.nodes.w);
            ends.push(nodes.len());
        }
        let mut estimates = vec![0.0; outcomes];
        let mut score = vec![0.0; cells.len()];
        self.for_outcomes(&nodes, |index, w| {
            let mut from = 0;
            for (s, &to) in score.iter_mut().zip(&ends) {
                *s = w[from..to].iter().sum();
                from = to;
            }
            estimates[index] = cells[first_largest(&score, |best| TIE * best)].centroid;
        });
        estimates
    }
}

/// The probabilities that equation 5.10 multiplies.
#[derive(Clone, Copy, PartialEq)]
enum Scaling {
    /// Probabilities given the cell.
    Conditional,
    /// Joint probabilities of bit and cell, as printed.
    Printed,
}

/// A cell of the grid within the support.
struct Cell {
    nodes: Nodes,
    mass: f64,
    centroid: f64,
}

/// The first index whose score is within `slack(best)` of the best score.
fn first_largest(scores: &[f64], slack: impl Fn(f64) -> f64) -> usize {
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let enough = best - slack(best);
    scores.iter().position(|&s| s >= enough).unwrap_or(0)
}

/// Mean of the source if its density is multiplied by the exponential of `score`, which is given at the nodes.
fn mean_under(score: &[f64], nodes: &Nodes) -> f64 {
    let (mass, first) = moments(&weights_under(score, nodes), &nodes.x);
    if mass > 0.0 { first / mass } else { 0.0 }
}

/// Weights of the nodes times the exponential of `score`, up to a constant. The largest score is subtracted first, so that at least one
/// does not underflow.
fn weights_under(score: &[f64], nodes: &Nodes) -> Vec<f64> {
    let best = score.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    score.iter().zip(&nodes.w).map(|(s, w)| w * (s - best).exp()).collect()
}

/// `(sum w, sum w x)`.
pub fn moments(w: &[f64], x: &[f64]) -> (f64, f64) {
    w.iter()
        .zip(x)
        .fold((0.0, 0.0), |(m0, m1), (w, x)| (m0 + w, m1 + w * x))
}

/// `sum w (x - estimate)^2`.
pub fn squared_error(w: &[f64], x: &[f64], estimate: f64) -> f64 {
    w.iter().zip(x).map(|(w, x)| w * (x - estimate) * (x - estimate)).sum()
}
