//! A probability density on a line, given by its values on a grid.

use super::axis::UniformGrid;
use crate::Error;
use crate::particles::weights::Categorical;
use fewbits_core::{Belief, ColumnsMut, Density, Likelihood};
use fewbits_numerics::error::{entries, finite, positive, refuse};
use fewbits_numerics::normal::log_pdf_with;
use nalgebra::{Matrix1, Vector1};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// A probability density on a line, given by its values at the nodes of a [`UniformGrid`] and linear between the nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct PointMass {
    grid: UniformGrid,
    density: Vec<f64>,
}

/// The stored form of [`PointMass`].
#[derive(Deserialize)]
#[serde(rename = "PointMass")]
#[serde(deny_unknown_fields)]
struct Stored {
    grid: UniformGrid,
    density: Vec<f64>,
}

impl TryFrom<Stored> for PointMass {
    type Error = Error;

    fn try_from(Stored { grid, density }: Stored) -> Result<Self, Error> {
        check_density(&density, grid.points(), grid.spacing()).map(|()| PointMass { grid, density })
    }
}

/// Checks densities at `nodes` nodes of the given volume each: finite, non-negative, integrating to one.
pub(crate) fn check_density(density: &[f64], nodes: usize, volume: f64) -> Result<(), Error> {
    let bad = density.iter().find(|p| !(**p >= 0.0 && p.is_finite()));
    let total = density.iter().sum::<f64>() * volume;
    if bad.is_some() || density.len() != nodes || (total - 1.0).abs() > 1e-9 {
        let text = format!("{} numbers with integral {total}", density.len());
        return refuse("density", text, format!("{nodes} densities that integrate to 1"));
    }
    Ok(())
}

/// Multiplies the values of a density by the exponentials of `logs` and normalises it; each node has the given volume. Returns the
/// logarithm of the integral before normalisation. On failure nothing is changed.
pub(crate) fn absorb(density: &mut [f64], logs: &[f64], volume: f64) -> Result<f64, Error> {
    let reachable = logs.iter().zip(&*density).filter(|(_, p)| **p > 0.0);
    let peak = reachable.map(|(l, _)| *l).fold(f64::NEG_INFINITY, f64::max);
    // Where the density is zero, the likelihood may have any value, NaN included.
    let product = |(l, p): (&f64, &f64)| if *p > 0.0 { p * (l - peak).exp() } else { 0.0 };
    let sum = logs.iter().zip(&*density).map(product).sum::<f64>();
    let no_number = logs.iter().zip(&*density).any(|(l, p)| *p > 0.0 && l.is_nan());
    if no_number || peak == f64::INFINITY {
        return Err(Error::NotANumber { what: "the likelihood" });
    }
    // If all logarithms are `-inf`, the sum is NaN.
    if !(sum > 0.0 && sum.is_finite()) {
        return Err(Error::Impossible);
    }
    for (p, l) in density.iter_mut().zip(logs) {
        *p = product((l, p)) / sum / volume;
    }
    Ok(sum.ln() + peak + volume.ln())
}

/// The density at so many nodes of a volume each that is proportional to these numbers.
pub(crate) fn normalised(mut density: Vec<f64>, nodes: usize, volume: f64) -> Result<Vec<f64>, Error> {
    entries("density", density.len(), nodes)?;
    if let Some(bad) = density.iter().find(|p| !(**p >= 0.0 && p.is_finite())) {
        return refuse("density", bad, "finite numbers, 0 or above");
    }
    let total = density.iter().sum::<f64>() * volume;
    if !(total > 0.0 && total.is_finite()) {
        return Err(Error::Impossible);
    }
    density.iter_mut().for_each(|p| *p /= total);
    Ok(density)
}

impl PointMass {
    /// The density proportional to `exp(log_density(x))`.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the density is zero at every node.
    pub fn new(grid: UniformGrid, log_density: impl Fn(f64) -> f64) -> Result<Self, Error> {
        let mut mass = Self {
            grid,
            density: vec![1.0; grid.points()],
        };
        mass.update_with(log_density)?;
        Ok(mass)
    }

    /// The density proportional to these numbers at the nodes.
    ///
    /// # Errors
    /// If there is not one per node, or one is negative or not finite; [`Error::Impossible`] if all are zero.
    pub fn from_density(grid: UniformGrid, density: Vec<f64>) -> Result<Self, Error> {
        let density = normalised(density, grid.points(), grid.spacing())?;
        Ok(Self { grid, density })
    }

    /// A normal density, evaluated at the nodes.
    ///
    /// # Errors
    /// If the variance is not positive; [`Error::Impossible`] if the density is zero at every node.
    pub fn normal(grid: UniformGrid, mean: f64, variance: f64) -> Result<Self, Error> {
        finite("mean", mean)?;
        positive("variance", variance)?;
        Self::new(grid, |x| log_pdf_with(x, mean, variance))
    }

    /// The grid of nodes.
    pub fn grid(&self) -> &UniformGrid {
        &self.grid
    }

    /// Density at the nodes. Their sum times the spacing is one.
    pub fn density(&self) -> &[f64] {
        &self.density
    }

    /// Mean.
    pub fn mean(&self) -> f64 {
        self.expectation(|x| x)
    }

    /// Variance.
    pub fn variance(&self) -> f64 {
        let mean = self.mean();
        self.expectation(|x| (x - mean) * (x - mean))
    }

    /// `E f(x)`, by the trapezoid rule.
    pub fn expectation(&self, f: impl Fn(f64) -> f64) -> f64 {
        let sum: f64 = self.grid.nodes().zip(&self.density).map(|(x, p)| p * f(x)).sum();
        sum * self.grid.spacing()
    }

    /// Multiplies by a likelihood (Bayes' rule); returns `ln p(observed | past)`.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the product is zero at every node; the belief is then unchanged.
    pub fn update(&mut self, observed: &(impl Likelihood<1> + ?Sized)) -> Result<f64, Error> {
        let nodes: Vec<f64> = self.grid.nodes().collect();
        let mut logs = vec![0.0; nodes.len()];
        observed.add_log_likelihoods([&nodes], &mut logs);
        absorb(&mut self.density, &logs, self.grid.spacing())
    }

    /// As [`update`](Self::update), with the log likelihood as a function of the state.
    ///
    /// # Errors
    /// As [`PointMass::update`].
    pub fn update_with(&mut self, log_likelihood: impl Fn(f64) -> f64) -> Result<f64, Error> {
        let logs: Vec<f64> = self.grid.nodes().map(log_likelihood).collect();
        absorb(&mut self.density, &logs, self.grid.spacing())
    }

    /// As [`update`](Self::update), with the log likelihoods at the nodes.
    ///
    /// # Errors
    /// As [`PointMass::update`], or if there is not one per node; [`Error::NotANumber`] if one is NaN or infinite where the density is
    /// positive.
    pub fn update_at_nodes(&mut self, log_likelihoods: &[f64]) -> Result<f64, Error> {
        entries("log_likelihoods", log_likelihoods.len(), self.density.len())?;
        absorb(&mut self.density, log_likelihoods, self.grid.spacing())
    }

    /// As [`update`](Self::update), with the likelihood given at the nodes up to a constant factor, without allocation. Returns
    /// the evidence up to that factor, not its logarithm. Use [`PointMass::update`] if the likelihood may underflow.
    ///
    /// # Errors
    /// If the table has the wrong length; [`Error::NotANumber`] if the evidence is not finite;
    /// [`Error::Impossible`] if it is zero. The belief is then unchanged.
    pub fn reweight(&mut self, likelihood: &[f64]) -> Result<f64, Error> {
        entries("likelihood", likelihood.len(), self.density.len())?;
        let sum: f64 = self.density.iter().zip(likelihood).map(|(p, l)| p * l).sum();
        let evidence = sum * self.grid.spacing();
        if !evidence.is_finite() {
            return Err(Error::NotANumber { what: "the likelihood" });
        }
        if evidence <= 0.0 {
            return Err(Error::Impossible);
        }
        for (p, l) in self.density.iter_mut().zip(likelihood) {
            *p *= l / evidence;
        }
        Ok(evidence)
    }
}

/// A draw with triangular density on `(-1, 1)`: the offset, in spacings, of a draw of a linear interpolant from its node.
pub(crate) fn triangular<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    rng.random::<f64>() - rng.random::<f64>()
}

/// Variance of [`triangular`].
pub(crate) const TRIANGULAR_VARIANCE: f64 = 1.0 / 6.0;

impl Belief<1> for PointMass {
    fn mean(&self) -> Vector1<f64> {
        Vector1::new(self.mean())
    }

    fn covariance(&self) -> Matrix1<f64> {
        Matrix1::new(self.variance())
    }

    /// Draws from the linear interpolant, shrunk towards the mean so that the variance is that of the nodes.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, [states]: ColumnsMut<'_, 1>) {
        let cumulative = Categorical::new(&self.density);
        let (mean, variance, h) = (self.mean(), self.variance(), self.grid.spacing());
        // A draw within its spacing has the variance of the nodes plus that of the offset.
        let shrink = (variance / (variance + TRIANGULAR_VARIANCE * h * h)).sqrt();
        for x in states {
            let drawn = self.grid.node(cumulative.draw(rng)) + h * triangular(rng);
            *x = mean + shrink * (drawn - mean);
        }
    }
}

impl Density<1> for PointMass {
    /// Linear between the nodes, zero outside.
    fn log_density(&self, state: &Vector1<f64>) -> f64 {
        let at = (state[0] - self.grid.node(0)) / self.grid.spacing();
        if at.is_infinite() {
            return f64::NEG_INFINITY;
        }
        let below = at.floor();
        let value = |i: f64| {
            let inside = i >= 0.0 && i < self.density.len() as f64;
            if inside { self.density[i as usize] } else { 0.0 }
        };
        let share = at - below;
        ((1.0 - share) * value(below) + share * value(below + 1.0)).ln()
    }
}
