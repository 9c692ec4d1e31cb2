//! The filter of a number on a grid that goes with it.

use crate::contract::{Info, StateFilter};
use crate::{Error, Points};
use fewbits_core::{Belief, ColumnsMut, Gaussian, GaussianDynamics, Likelihood};
use nalgebra::{Matrix1, SMatrix, SVector, Vector1};
use rand::{Rng, RngExt};

/// Nodes of a new grid, and most nodes before it is made coarser.
const NODES: usize = 241;
const MAX_NODES: usize = 800;
/// A Gaussian is represented to so many deviations on each side.
const REACH: f64 = 6.0;
/// Distance between nodes in deviations of the noise of the dynamics, at least and at most, where the noise is spread over nodes.
const FINEST: f64 = 0.125;
const COARSEST: f64 = 1.0;
/// Mass beyond either end that is cut off.
const CUT: f64 = 1e-13;
/// A posterior on fewer nodes than this (the inverse of the sum of squares) is computed again on a finer grid, so often at most.
const RESOLVED: f64 = 16.0;
const PASSES: usize = 40;
/// A finer grid covers the nodes with more than this share of the largest posterior, and some to each side.
const COVERED: f64 = 1e-12;
const BESIDE: usize = 2;

/// A belief about a number: masses of equidistant nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct MovingGrid {
    first: f64,
    spacing: f64,
    /// Of sum one.
    masses: Vec<f64>,
}

impl MovingGrid {
    fn of(law: &Gaussian<1>) -> Result<Self, Error> {
        let (mean, deviation) = (law.mean()[0], law.covariance()[0].sqrt());
        // What is known for certain is a grid of no width that matters.
        let deviation = deviation.max(1e-9 * mean.abs()).max(f64::MIN_POSITIVE.sqrt());
        let half = 0.5 * (NODES as f64 - 1.0);
        let step = REACH / half;
        let masses = (0..NODES).map(|i| (-0.5 * ((i as f64 - half) * step).powi(2)).exp());
        let grid = Self {
            first: mean - REACH * deviation,
            spacing: step * deviation,
            masses: masses.collect(),
        };
        grid.normalised().ok_or_else(no_number)
    }

    fn node(&self, i: usize) -> f64 {
        self.first + self.spacing * i as f64
    }

    fn moments(&self) -> (f64, f64) {
        // From the middle of the grid, so that no digits are lost far from zero.
        let middle = 0.5 * (self.masses.len() as f64 - 1.0);
        let at = |i: usize| i as f64 - middle;
        let sum = |power: i32| -> f64 {
            let terms = self.masses.iter().enumerate();
            terms.map(|(i, mass)| mass * at(i).powi(power)).sum()
        };
        let (mean, square) = (sum(1), sum(2));
        let variance = (square - mean * mean).max(0.0);
        (self.first + self.spacing * (middle + mean), self.spacing * self.spacing * variance)
    }

    fn normalised(mut self) -> Option<Self> {
        let sum: f64 = self.masses.iter().sum();
        if !(sum > 0.0 && sum.is_finite() && self.spacing > 0.0 && self.spacing.is_finite() && self.first.is_finite()) {
            return None;
        }
        self.masses.iter_mut().for_each(|mass| *mass /= sum);
        Some(self)
    }

    /// Without the nodes at the ends that have no mass.
    fn cut(mut self) -> Self {
        let beyond = |masses: &mut dyn Iterator<Item = &f64>| {
            let mut sum = 0.0;
            masses
                .take_while(|mass| {
                    sum += **mass;
                    sum < CUT
                })
                .count()
        };
        let (low, high) = (beyond(&mut self.masses.iter()), beyond(&mut self.masses.iter().rev()));
        if low + high + 3 < self.masses.len() {
            self.masses.truncate(self.masses.len() - high);
            self.masses.drain(..low);
            self.first += self.spacing * low as f64;
        }
        self
    }

    /// The density between nodes, a line from each to the next, on other nodes.
    fn on(&self, first: f64, spacing: f64, count: usize) -> Self {
        let last = self.masses.len() - 1;
        let at = |i: usize| {
            let place = (first + spacing * i as f64 - self.first) / self.spacing;
            let below = place.floor();
            let of = |k: f64| {
                let is_inside = (0.0..=last as f64).contains(&k);
                if is_inside { self.masses[k as usize] } else { 0.0 }
            };
            (1.0 - (place - below)) * of(below) + (place - below) * of(below + 1.0)
        };
        Self {
            first,
            spacing,
            masses: (0..count).map(at).collect(),
        }
    }

    /// On nodes at this larger distance: each mass is shared by the two nodes beside it, so that the mean stays.
    fn coarser(&self, spacing: f64) -> Self {
        let ratio = self.spacing / spacing;
        let count = ((self.masses.len() - 1) as f64 * ratio).ceil() as usize + 2;
        let mut masses = vec![0.0; count];
        for (i, mass) in self.masses.iter().enumerate() {
            let place = i as f64 * ratio;
            let below = place.floor();
            masses[below as usize] += mass * (1.0 - (place - below));
            masses[below as usize + 1] += mass * (place - below);
        }
        Self {
            first: self.first,
            spacing,
            masses,
        }
    }

    /// The sum with independent noise of this variance.
    fn with_noise(self, variance: f64) -> Self {
        let deviation = variance.sqrt();
        let mut grid = self;
        if deviation.is_nan() || deviation <= 0.0 {
            return grid;
        }
        if grid.spacing < FINEST * deviation {
            grid = grid.coarser(FINEST * deviation);
        }
        if grid.masses.len() > MAX_NODES {
            let spacing = grid.spacing * grid.masses.len() as f64 / NODES as f64;
            grid = grid.coarser(spacing);
        }
        let ratio = grid.spacing / deviation;
        // Where nodes are too far apart for the shape of the noise, its variance is kept: by three nodes.
        let kernel: Vec<f64> = if ratio > COARSEST {
            let side = 0.5 / (ratio * ratio);
            vec![side, 1.0 - 2.0 * side, side]
        } else {
            let half = (REACH / ratio).ceil() as i32;
            let weights = (-half..=half).map(|k| (-0.5 * (f64::from(k) * ratio).powi(2)).exp());
            let weights: Vec<f64> = weights.collect();
            let sum: f64 = weights.iter().sum();
            weights.into_iter().map(|weight| weight / sum).collect()
        };
        let half = kernel.len() / 2;
        let mut masses = vec![0.0; grid.masses.len() + 2 * half];
        for (i, mass) in grid.masses.iter().enumerate().filter(|(_, mass)| **mass > 0.0) {
            for (to, weight) in masses[i..].iter_mut().zip(&kernel) {
                *to += mass * weight;
            }
        }
        Self {
            first: grid.first - grid.spacing * half as f64,
            spacing: grid.spacing,
            masses,
        }
        .cut()
    }
}

impl Belief<1> for MovingGrid {
    fn mean(&self) -> SVector<f64, 1> {
        Vector1::new(self.moments().0)
    }

    fn covariance(&self) -> SMatrix<f64, 1, 1> {
        Matrix1::new(self.moments().1)
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, 1>) {
        let [states] = states;
        for state in states {
            let mut left: f64 = rng.random();
            let node = self.masses.iter().position(|mass| {
                left -= mass;
                left < 0.0
            });
            let within = rng.random::<f64>() - 0.5;
            *state = self.first + self.spacing * (node.unwrap_or(self.masses.len() - 1) as f64 + within);
        }
    }
}

/// The exact filter of a scalar state with any likelihood and dynamics that are linear over the width of the belief: a grid that follows the
/// belief, as wide as it is, and as fine as the likelihood asks. For beliefs that are not Gaussian, as after silence has cut them.
///
/// ```text
/// predict:  nodes x <- f(mean) + F (x - mean), then the sum with N(0, Q)
/// update:   p(x) <- p(x) p(observed | x) / evidence, on a finer grid until the posterior is resolved
/// ```
/// [`PointMassFilter`](crate::PointMassFilter) has a fixed grid, and takes dynamics of any shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MovingGridFilter;

fn no_number() -> Error {
    Error::NotANumber {
        what: "a mass of the grid",
    }
}

impl StateFilter<1> for MovingGridFilter {
    type Belief = MovingGrid;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<1>) -> Result<MovingGrid, Error> {
        MovingGrid::of(prior)
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<1>,
        belief: &mut MovingGrid,
    ) -> Result<(), Error> {
        let mean = belief.mean();
        let slope = dynamics.jacobian(&mean)[0];
        let to = dynamics.mean(&mean)[0];
        let mut next = belief.clone();
        if slope < 0.0 {
            next.masses.reverse();
            next.first = belief.node(belief.masses.len() - 1);
        }
        next.first = to + slope * (next.first - mean[0]);
        next.spacing *= slope.abs();
        // What is forgotten leaves a point.
        if next.spacing <= f64::MIN_POSITIVE.sqrt() {
            let noise = dynamics.noise_covariance_at(&mean);
            let law = Gaussian::new(Vector1::new(to), noise)?;
            *belief = MovingGrid::of(&law)?;
            return Ok(());
        }
        let next = next.with_noise(dynamics.noise_covariance_at(&mean)[0]);
        *belief = next.normalised().ok_or_else(no_number)?;
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut MovingGrid,
        observed: &[&dyn Likelihood<1>],
    ) -> Result<Info, Error> {
        let mut prior = belief.clone();
        let mut pass = 0;
        loop {
            let nodes: Vec<f64> = (0..prior.masses.len()).map(|i| prior.node(i)).collect();
            let mut logs: Vec<f64> = prior.masses.iter().map(|mass| mass.ln()).collect();
            observed.add_log_likelihoods([&nodes], &mut logs);
            let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if !top.is_finite() {
                return Err(if top == f64::NEG_INFINITY {
                    Error::Impossible
                } else {
                    no_number()
                });
            }
            let masses: Vec<f64> = logs.iter().map(|log| (log - top).exp()).collect();
            let sum: f64 = masses.iter().sum();
            let squares: f64 = masses.iter().map(|mass| mass * mass).sum();
            if sum * sum >= RESOLVED * squares || pass == PASSES {
                let posterior = MovingGrid { masses, ..prior };
                *belief = posterior.normalised().ok_or_else(no_number)?.cut();
                return Ok(Info::new(top + sum.ln()));
            }
            pass += 1;
            let is_covered = |mass: &f64| *mass > COVERED;
            let low = masses.iter().position(is_covered).unwrap_or(0).saturating_sub(BESIDE);
            let high = masses.iter().rposition(is_covered).unwrap_or(0) + BESIDE;
            let high = high.min(masses.len() - 1);
            let spacing = prior.spacing * (high - low) as f64 / (NODES - 1) as f64;
            if spacing >= prior.spacing {
                // It cannot be finer.
                pass = PASSES;
                continue;
            }
            let mut finer = prior.on(prior.node(low), spacing, NODES);
            // Masses of nodes that are closer are smaller.
            let share = spacing / prior.spacing;
            finer.masses.iter_mut().for_each(|mass| *mass *= share);
            prior = finer;
        }
    }

    fn points(&self, belief: &MovingGrid) -> Option<Points<1>> {
        Some(Points {
            states: [(0..belief.masses.len()).map(|i| belief.node(i)).collect()],
            log_weights: belief.masses.iter().map(|mass| mass.ln()).collect(),
        })
    }
}
