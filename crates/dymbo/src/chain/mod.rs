//! The exact mean squared error of every scalar filter of this crate, without Monte Carlo.
//!
//! The threshold is the prediction, so the probability of a message depends on the state only through the prediction error
//! `e = theta - prediction`. This error is therefore a Markov chain by itself:
//!
//! ```text
//! message j with probability p_j(e)          sign bit: Phi(e/sigma); word: a cell; K sensors: a count or a string
//! filtered error  e - d_j                    d_j: the filter's correction
//! next error      a (e - d_j) + u,  u ~ N(0, sigma_u^2)
//! ```
//!
//! The density of `e` is smooth. The trapezoid rule on a uniform grid of a few hundred points is therefore exact to about `1e-12`. The
//! shift by `d_j` enters as the mean of the normal kernel, so nothing is interpolated.
//!
//! ```
//! use fewbits_dymbo::{chain, DymboFilter, ScalarPlant};
//! let plant = ScalarPlant::new(0.9, 0.5, 1.0)?;
//! let exact = chain::dymbo_mse(&DymboFilter::new(plant))?;
//! assert!((exact - 0.729_565_800_136).abs() < 1e-10);
//! # Ok::<(), fewbits_dymbo::Error>(())
//! ```

mod law;
mod stationary;
mod transient;

pub use law::MessageLaw;
pub use stationary::{
    StationaryError, crossover_mse, dymbo_mse, multibit_mse, parallel_mse, sequential_mse, stationary, true_loss,
};
pub use transient::{TransientStep, first_message_transient};

use crate::{Error, ScalarPlant};
use fewbits_filters::UniformGrid;
use fewbits_numerics::error::{ArgumentError, positive};
use fewbits_numerics::normal::{self, INV_SQRT_2PI};
use std::f64::consts::FRAC_2_PI;
use std::ops::Range;

/// Grid spacing divided by the smaller of the two noise deviations.
const SPACING: f64 = 0.4;
/// Half width of the grid in deviations of the predicted error.
const WIDTH: f64 = 14.0;
/// The normal kernel is cut at this many deviations, where it has fallen below rounding.
const REACH: f64 = 8.6;
/// Largest number of grid points. A plant with very little process noise would need more and is refused.
const MAX_POINTS: f64 = 40_000.0;
/// The grid is too narrow if the density at its edge exceeds this share of the peak.
const EDGE: f64 = 1e-13;
/// The power iteration has converged if the density changes by less than this mass (times the root of the number of points).
const SETTLED: f64 = 1e-14;
/// Limit on the power iterations ...
const MAX_STEPS: usize = 200_000;
/// ... and on their multiplications; whichever is reached first.
const MAX_WORK: f64 = 2e10;
/// Limit on the normal kernels of one transition: grid points times messages.
const MAX_KERNELS: f64 = 2e7;

/// The density of the prediction error `e` on a uniform grid about zero.
#[derive(Debug, Clone, PartialEq)]
struct ErrorChain {
    plant: ScalarPlant,
    grid: UniformGrid,
    density: Vec<f64>,
}

impl ErrorChain {
    /// The grid for this half width; refused if the process noise is zero or so small that it would need more than 40000 points.
    fn grid(plant: &ScalarPlant, half_width: f64) -> Result<UniformGrid, Error> {
        let finest = positive("process_variance", plant.process_variance())?
            .min(plant.measurement_variance())
            .sqrt();
        let spacing = SPACING * finest;
        if 2.0 * half_width / spacing > MAX_POINTS {
            let expected = "enough process noise for a grid of at most 40000 points";
            return Err(ArgumentError::new("process_variance", plant.process_variance(), expected).into());
        }
        UniformGrid::symmetric(half_width, spacing)
    }

    /// The chain after one prediction from a normal filtered error of variance `filtered_variance`.
    fn from_normal(plant: &ScalarPlant, filtered_variance: f64) -> Result<Self, Error> {
        let variance = plant.dynamics().predict_variance(filtered_variance);
        let grid = Self::grid(plant, WIDTH * variance.max(plant.process_variance()).sqrt())?;
        let density = grid
            .nodes()
            .map(|e| normal::log_pdf_with(e, 0.0, variance).exp())
            .collect();
        Ok(Self {
            plant: *plant,
            grid,
            density,
        })
    }

    /// The chain at `n = 1` after a first message of resolution `resolution` (`tau`, state units) and no prior. The error of the
    /// rounded sample has density `[Phi((e + tau/2)/sigma) - Phi((e - tau/2)/sigma)]/tau`.
    fn from_first_message(plant: &ScalarPlant, resolution: f64) -> Result<Self, Error> {
        let tau = positive("resolution", resolution)?;
        let sigma = plant.measurement_variance().sqrt();
        let start_width = 0.5 * tau + 9.0 * sigma;
        let a = plant.coefficient().abs();
        let steady = plant.steady_state(FRAC_2_PI)?.predicted_variance;
        let width = (WIDTH * steady.sqrt()).max(a * start_width + 9.0 * plant.process_variance().sqrt());
        let grid = Self::grid(plant, width)?;
        let mut chain = Self {
            plant: *plant,
            grid,
            density: vec![0.0; grid.points()],
        };
        let from = Self::grid(plant, start_width)?;
        // Each part of the first error is moved by the plant and spread by the process noise.
        for e in from.nodes() {
            let mass = from.spacing() * normal::interval((e - 0.5 * tau) / sigma, (e + 0.5 * tau) / sigma) / tau;
            chain.add_kernel(plant.coefficient() * e, mass);
        }
        Ok(chain)
    }

    /// Adds `mass` spread by the process noise around `centre`, and returns the nodes that it reaches.
    fn add_kernel(&mut self, centre: f64, mass: f64) -> Range<usize> {
        let deviation = self.plant.process_variance().sqrt();
        let scale = mass * INV_SQRT_2PI / deviation;
        let reached = self
            .grid
            .indices_within(centre - REACH * deviation, centre + REACH * deviation);
        for i in reached.clone() {
            let z = (self.grid.node(i) - centre) / deviation;
            self.density[i] += scale * (-0.5 * z * z).exp();
        }
        reached
    }

    /// `E e^2` before the message.
    fn predicted_mse(&self) -> f64 {
        let sum: f64 = self.grid.nodes().zip(&self.density).map(|(e, p)| e * e * p).sum();
        sum * self.grid.spacing()
    }

    /// `E (e - d)^power` after the message.
    fn filtered_moment(&self, law: &MessageLaw, power: i32) -> f64 {
        let sum: f64 = self
            .grid
            .nodes()
            .zip(&self.density)
            .map(|(e, p)| {
                p * law
                    .messages(e)
                    .map(|(probability, d)| probability * (e - d).powi(power))
                    .sum::<f64>()
            })
            .sum();
        sum * self.grid.spacing()
    }

    /// Mean squared error after the message.
    fn filtered_mse(&self, law: &MessageLaw) -> f64 {
        self.filtered_moment(law, 2)
    }

    /// Sends a message and predicts: the density of the next prediction error.
    fn advance(&mut self, law: &MessageLaw) {
        let mut next = Self {
            density: vec![0.0; self.density.len()],
            ..*self
        };
        for (e, p) in self.grid.nodes().zip(&self.density) {
            for (probability, correction) in law.messages(e) {
                let mass = p * self.grid.spacing() * probability;
                next.add_kernel(self.plant.coefficient() * (e - correction), mass);
            }
        }
        self.density = next.density;
    }

    /// The transition of [`ErrorChain::advance`] as a matrix: for each node its first successor and their weights.
    fn transition(&self, law: &MessageLaw) -> Vec<(usize, Vec<f64>)> {
        let mut column = Self {
            density: vec![0.0; self.density.len()],
            ..*self
        };
        let unit = self.grid.spacing();
        self.grid
            .nodes()
            .map(|e| {
                let (mut first, mut end) = (self.grid.points(), 0);
                // The error after a message of this correction, moved by the plant: a normal kernel about `a (e - correction)`.
                for (probability, correction) in law.messages(e) {
                    let centre = self.plant.coefficient() * (e - correction);
                    let reached = column.add_kernel(centre, unit * probability);
                    if !reached.is_empty() {
                        (first, end) = (first.min(reached.start), end.max(reached.end));
                    }
                }
                let first = first.min(end);
                // The column is zero elsewhere, so clearing this stretch prepares it for the next node.
                let weights = column.density[first..end].to_vec();
                column.density[first..end].fill(0.0);
                (first, weights)
            })
            .collect()
    }

    /// Applies the transition of one law (power iteration) until the density no longer changes.
    fn settle(&mut self, law: &MessageLaw) -> Result<(), Error> {
        let kernels = self.density.len() as f64 * law.corrections().len() as f64;
        if kernels > MAX_KERNELS {
            let expected = "a plant and messages whose chain has at most 2e7 kernels (points times messages)";
            return Err(ArgumentError::new("law", format!("{kernels} kernels"), expected).into());
        }
        let transition = self.transition(law);
        let weights: usize = transition.iter().map(|(_, weights)| weights.len()).sum();
        let most_steps = MAX_STEPS.min((MAX_WORK / weights as f64) as usize);
        let mut next = vec![0.0; self.density.len()];
        for _ in 0..most_steps {
            next.fill(0.0);
            for ((first, weights), p) in transition.iter().zip(&self.density) {
                for (n, w) in next[*first..].iter_mut().zip(weights) {
                    *n += w * p;
                }
            }
            // The cut kernels lose a little mass in each step: normalise.
            let total = next.iter().sum::<f64>() * self.grid.spacing();
            let mut change = 0.0;
            for (n, p) in next.iter_mut().zip(&self.density) {
                *n /= total;
                change += (*n - p).abs();
            }
            std::mem::swap(&mut self.density, &mut next);
            if change * self.grid.spacing() <= SETTLED * (self.density.len() as f64).sqrt() {
                return Ok(());
            }
        }
        Err(Error::NotConverged {
            what: "the error chain",
            steps: most_steps,
            unit: "iterations",
        })
    }

    fn spills(&self) -> bool {
        let peak = self.density.iter().copied().fold(0.0, f64::max);
        let ends = [self.density.first(), self.density.last()];
        ends.into_iter().flatten().any(|p| *p > EDGE * peak)
    }
}
