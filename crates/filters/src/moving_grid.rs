//! Steps of a density on a grid that goes with it, as [`PointMassFilter::following`](crate::PointMassFilter::following) takes them.

use crate::Error;
use fewbits_core::{Belief, Density, Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::{PointMass, UniformGrid};
use nalgebra::Vector1;

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

/// Masses of equidistant nodes, of any sum.
struct Masses {
    first: f64,
    spacing: f64,
    masses: Vec<f64>,
}

impl Masses {
    fn belief(&self) -> Result<PointMass, Error> {
        let mut belief =
            PointMass::new(UniformGrid::from_nodes(self.first, self.spacing, self.masses.len())?, |_| 0.0)?;
        belief.refill(|density| density.copy_from_slice(&self.masses))?;
        Ok(belief)
    }

    /// Without the nodes at the ends that have no mass.
    fn cut(mut self) -> Self {
        let negligible = CUT * self.masses.iter().sum::<f64>();
        let beyond = |masses: &mut dyn Iterator<Item = &f64>| {
            let mut sum = 0.0;
            masses
                .take_while(|mass| {
                    sum += **mass;
                    sum < negligible
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

/// The Gaussian on a grid of its own width.
pub(crate) fn start(law: &Gaussian<1>) -> Result<PointMass, Error> {
    let (mean, deviation) = (law.mean()[0], law.covariance()[0].sqrt());
    // What is known for certain is a grid of no width that matters.
    let deviation = deviation.max(1e-9 * mean.abs()).max(f64::MIN_POSITIVE.sqrt());
    let half = 0.5 * (NODES as f64 - 1.0);
    let step = REACH / half;
    let masses = (0..NODES).map(|i| (-0.5 * ((i as f64 - half) * step).powi(2)).exp());
    let masses = Masses {
        first: mean - REACH * deviation,
        spacing: step * deviation,
        masses: masses.collect(),
    };
    masses.belief()
}

/// The belief after dynamics that are linear over its width.
pub(crate) fn predicted(belief: &PointMass, dynamics: &dyn GaussianDynamics<1>) -> Result<PointMass, Error> {
    let mean = Belief::mean(belief);
    let slope = dynamics.jacobian(&mean)[0];
    let to = dynamics.mean(&mean)[0];
    let noise = dynamics.noise_covariance_at(&mean);
    let grid = belief.grid();
    let spacing = grid.spacing() * slope.abs();
    // What is forgotten leaves a point.
    if spacing <= f64::MIN_POSITIVE.sqrt() {
        return start(&Gaussian::new(Vector1::new(to), noise)?);
    }
    let mut masses = belief.density().to_vec();
    let mut first = grid.node(0);
    if slope < 0.0 {
        masses.reverse();
        first = grid.node(masses.len() - 1);
    }
    let moved = Masses {
        first: to + slope * (first - mean[0]),
        spacing,
        masses,
    };
    moved.with_noise(noise[0]).belief()
}

/// The posterior on a grid that resolves it, and the log-likelihood of the observations.
pub(crate) fn updated(belief: &PointMass, observed: &[&dyn Likelihood<1>]) -> Result<(PointMass, f64), Error> {
    let mut prior = belief.clone();
    // Logarithm of the mass of the belief that the present grid covers.
    let mut log_covered = 0.0;
    let mut pass = 0;
    loop {
        let mut posterior = prior.clone();
        let log_likelihood = posterior.update(observed)?;
        let (density, h) = (posterior.density(), posterior.grid().spacing());
        let squares: f64 = density.iter().map(|p| (p * h).powi(2)).sum();
        let covered = COVERED * density.iter().copied().fold(0.0, f64::max);
        let is_covered = |p: &f64| *p > covered;
        let low = density.iter().position(is_covered).unwrap_or(0).saturating_sub(BESIDE);
        let high = density.iter().rposition(is_covered).unwrap_or(0) + BESIDE;
        let high = high.min(density.len() - 1);
        let spacing = h * (high - low) as f64 / (NODES - 1) as f64;
        // It is resolved, or the grid cannot be finer.
        if RESOLVED * squares <= 1.0 || pass == PASSES || spacing >= h {
            let resolved = Masses {
                first: posterior.grid().node(0),
                spacing: h,
                masses: posterior.density().to_vec(),
            };
            return Ok((resolved.cut().belief()?, log_covered + log_likelihood));
        }
        let grid = UniformGrid::from_nodes(prior.grid().node(low), spacing, NODES)?;
        // The density between nodes is a line from each to the next.
        let mut finer = PointMass::new(grid, |_| 0.0)?;
        let mean_density = finer.update_with(|x| prior.log_density(&Vector1::new(x)))?;
        log_covered += mean_density + (grid.spacing() * NODES as f64).ln();
        prior = finer;
        pass += 1;
    }
}
