//! Steps of a density on a grid that goes with it, as [`PointMassFilter::following`](crate::PointMassFilter::following) takes them.

use crate::Error;
use fewbits_core::{Belief, Density, Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::{PointMass, UniformGrid};
use nalgebra::Vector1;

/// How fine a grid is.
pub(crate) struct Resolution {
    /// Nodes of a new grid, and most nodes before it is made coarser.
    nodes: usize,
    max_nodes: usize,
    /// A Gaussian is represented to so many deviations on each side.
    reach: f64,
    /// Smallest distance between nodes in deviations of the noise of the dynamics.
    finest: f64,
    /// Mass beyond either end that is cut off.
    cut: f64,
    /// A posterior on fewer nodes than this (the inverse of the sum of squares) is computed again on a finer grid.
    resolved: f64,
    /// A finer grid covers the nodes with more than this share of the largest posterior.
    covered: f64,
    /// If the posterior has more than this share of its peak at an end, it is that of the belief's moments.
    end: f64,
}

/// That of a filter.
pub(crate) const FINE: Resolution = Resolution {
    nodes: 241,
    max_nodes: 800,
    reach: 6.0,
    finest: 0.125,
    cut: 1e-13,
    resolved: 16.0,
    covered: 1e-12,
    end: 1e-6,
};

/// That of a search, which computes the likelihood of a whole table some hundred times.
pub(crate) const QUICK: Resolution = Resolution {
    nodes: 49,
    max_nodes: 160,
    reach: 4.0,
    finest: 0.5,
    cut: 1e-7,
    resolved: 5.0,
    covered: 1e-6,
    end: 1e-2,
};

/// Largest distance between nodes at which the shape of the dynamics' noise is spread over nodes, in its deviations.
const COARSEST: f64 = 1.0;
/// A grid is made finer so often at most, and covers some nodes beside those that matter.
const PASSES: usize = 40;
const BESIDE: usize = 2;
/// Most nodes of the mixture of a narrow belief and a wide one.
const MAX_MIXED: usize = 2000;

/// Masses of equidistant nodes, of any sum.
struct Masses {
    first: f64,
    spacing: f64,
    masses: Vec<f64>,
}

impl Masses {
    fn belief(self) -> Result<PointMass, Error> {
        PointMass::from_density(UniformGrid::from_nodes(self.first, self.spacing, self.masses.len())?, self.masses)
    }

    /// Without the nodes at the ends that have no mass.
    fn cut(mut self, share: f64) -> Self {
        let negligible = share * self.masses.iter().sum::<f64>();
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
            share_out(&mut masses, i as f64 * ratio, *mass);
        }
        Self {
            first: self.first,
            spacing,
            masses,
        }
    }

    /// The sum with independent noise of this variance.
    fn with_noise(self, variance: f64, resolution: &Resolution) -> Self {
        let Resolution {
            nodes,
            max_nodes,
            reach,
            finest,
            cut,
            ..
        } = *resolution;
        let deviation = variance.sqrt();
        let mut grid = self;
        if deviation.is_nan() || deviation <= 0.0 {
            return grid;
        }
        if grid.spacing < finest * deviation {
            grid = grid.coarser(finest * deviation);
        }
        if grid.masses.len() > max_nodes {
            let spacing = grid.spacing * grid.masses.len() as f64 / nodes as f64;
            grid = grid.coarser(spacing);
        }
        let ratio = grid.spacing / deviation;
        // Where nodes are too far apart for the shape of the noise, its variance is kept: by three nodes.
        let kernel: Vec<f64> = if ratio > COARSEST {
            let side = 0.5 / (ratio * ratio);
            vec![side, 1.0 - 2.0 * side, side]
        } else {
            let half = (reach / ratio).ceil() as i32;
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
        .cut(cut)
    }
}

/// Shares a mass at a place, counted in nodes, between the two nodes beside it, so that the mean stays.
fn share_out(masses: &mut [f64], place: f64, mass: f64) {
    let below = place.floor();
    masses[below as usize] += mass * (1.0 - (place - below));
    masses[below as usize + 1] += mass * (place - below);
}

/// The mixture of two beliefs, of which the first has this share. Its grid has the distance of the finer of the two, unless that takes too
/// many nodes.
pub(crate) fn mixed(one: &PointMass, other: &PointMass, share: f64) -> Result<PointMass, Error> {
    let both = [(one, share), (other, 1.0 - share)];
    let last = |belief: &PointMass| belief.grid().node(belief.density().len() - 1);
    let first = one.grid().node(0).min(other.grid().node(0));
    let span = last(one).max(last(other)) - first;
    let finer = one.grid().spacing().min(other.grid().spacing());
    let spacing = finer.max(span / MAX_MIXED as f64);
    let mut masses = vec![0.0; (span / spacing).ceil() as usize + 2];
    for (belief, share) in both {
        let (grid, density) = (belief.grid(), belief.density());
        if grid.spacing() < spacing {
            for (i, density) in density.iter().enumerate() {
                share_out(&mut masses, (grid.node(i) - first) / spacing, share * density * grid.spacing());
            }
        } else {
            // The density between nodes is a line from each to the next.
            let (low, high) = (grid.node(0), last(belief));
            for (i, mass) in masses.iter_mut().enumerate() {
                let node = first + spacing * i as f64;
                if (low..=high).contains(&node) {
                    *mass += share * spacing * belief.log_density(&Vector1::new(node)).exp();
                }
            }
        }
    }
    Masses { first, spacing, masses }.belief()
}

/// The Gaussian on a grid of its own width.
pub(crate) fn start(law: &Gaussian<1>, Resolution { nodes, reach, .. }: &Resolution) -> Result<PointMass, Error> {
    let (mean, deviation) = (law.mean()[0], law.covariance()[0].sqrt());
    // What is known for certain is a grid of no width that matters.
    let deviation = deviation.max(1e-12 * mean.abs()).max(f64::MIN_POSITIVE.sqrt());
    let half = 0.5 * (*nodes as f64 - 1.0);
    let step = reach / half;
    let masses = (0..*nodes).map(|i| (-0.5 * ((i as f64 - half) * step).powi(2)).exp());
    let masses = Masses {
        first: mean - reach * deviation,
        spacing: step * deviation,
        masses: masses.collect(),
    };
    masses.belief()
}

/// The belief after dynamics that are linear over its width.
pub(crate) fn predicted(
    belief: &PointMass,
    dynamics: &dyn GaussianDynamics<1>,
    resolution: &Resolution,
) -> Result<PointMass, Error> {
    let mean = Belief::mean(belief);
    let slope = dynamics.jacobian(&mean)[0];
    let to = dynamics.mean(&mean)[0];
    let noise = dynamics.noise_covariance_at(&mean);
    let grid = belief.grid();
    let spacing = grid.spacing() * slope.abs();
    // What is forgotten leaves a point.
    if spacing <= f64::MIN_POSITIVE.sqrt() {
        return start(&Gaussian::new(Vector1::new(to), noise)?, resolution);
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
    moved.with_noise(noise[0], resolution).belief()
}

/// Whether the fourth moment is about that of a normal belief; the last silence of a sensor leaves less.
fn is_nearly_normal(belief: &PointMass) -> bool {
    let (mean, variance, grid) = (belief.mean(), belief.variance(), belief.grid());
    let density = belief.density().iter().enumerate();
    let fourth = density
        .map(|(i, p)| p * grid.spacing() * (grid.node(i) - mean).powi(4))
        .sum::<f64>();
    (fourth / (variance * variance) - 3.0).abs() < 0.5
}

/// The posterior on a grid that resolves it, and the log-likelihood of the observations. What is too far from a nearly normal belief for its grid
/// conditions a Gaussian of its moments.
pub(crate) fn updated(
    belief: &PointMass,
    observed: &[&dyn Likelihood<1>],
    resolution: &Resolution,
) -> Result<(PointMass, f64), Error> {
    let Resolution {
        nodes,
        cut,
        resolved,
        covered,
        end,
        ..
    } = *resolution;
    let mut prior = belief.clone();
    // Logarithm of the mass of the belief that the present grid covers.
    let mut log_covered = 0.0;
    let mut pass = 0;
    loop {
        let mut posterior = prior.clone();
        let log_likelihood = posterior.update(observed)?;
        let (density, h) = (posterior.density(), posterior.grid().spacing());
        let squares: f64 = density.iter().map(|p| (p * h).powi(2)).sum();
        let peak = density.iter().copied().fold(0.0, f64::max);
        if pass == 0 && density[0].max(density[density.len() - 1]) > end * peak && is_nearly_normal(belief) {
            let mut moments = Gaussian::new(Belief::mean(belief), belief.covariance())?;
            let evidence = observed.condition(&mut moments)?;
            return Ok((start(&moments, resolution)?, evidence.log_likelihood));
        }
        let least = covered * peak;
        let is_covered = |p: &f64| *p > least;
        let low = density.iter().position(is_covered).unwrap_or(0).saturating_sub(BESIDE);
        let high = density.iter().rposition(is_covered).unwrap_or(0) + BESIDE;
        let high = high.min(density.len() - 1);
        let spacing = h * (high - low) as f64 / (nodes - 1) as f64;
        // It is resolved, or the grid cannot be finer.
        if resolved * squares <= 1.0 || pass == PASSES || spacing >= h {
            let found = Masses {
                first: posterior.grid().node(0),
                spacing: h,
                masses: posterior.density().to_vec(),
            };
            return Ok((found.cut(cut).belief()?, log_covered + log_likelihood));
        }
        let grid = UniformGrid::from_nodes(prior.grid().node(low), spacing, nodes)?;
        // The density between nodes is a line from each to the next.
        let mut finer = PointMass::new(grid, |_| 0.0)?;
        let mean_density = finer.update_with(|x| prior.log_density(&Vector1::new(x)))?;
        log_covered += mean_density + (grid.spacing() * nodes as f64).ln();
        prior = finer;
        pass += 1;
    }
}
