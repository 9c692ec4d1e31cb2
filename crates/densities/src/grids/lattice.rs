//! A probability density over several numbers, given by its values on a lattice.

use super::axis::UniformGrid;
use super::line::{absorb, normalised};
use crate::Error;
use fewbits_numerics::error::{entries, finite, positive, refuse};
use fewbits_numerics::normal::log_pdf_with;

/// Largest number of nodes of a lattice.
const MAX_NODES: usize = 1 << 22;

/// A probability density over several numbers, given by its values at the nodes of a lattice: one [`UniformGrid`] per number. The number of axes
/// is known at run time. Values are in the order of the nodes, the last axis fastest; their sum times the product of the spacings is one.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    axes: Vec<UniformGrid>,
    volume: f64,
    density: Vec<f64>,
}

impl Lattice {
    /// The uniform density on these axes.
    ///
    /// # Errors
    /// If there is no axis, there are more than 2^22 nodes, or the product of the spacings is not a normal number.
    pub fn uniform(axes: Vec<UniformGrid>) -> Result<Self, Error> {
        let nodes = axes
            .iter()
            .try_fold(1_usize, |nodes, axis| nodes.checked_mul(axis.points()))
            .filter(|nodes| *nodes <= MAX_NODES && !axes.is_empty());
        let Some(nodes) = nodes else {
            let points: Vec<usize> = axes.iter().map(UniformGrid::points).collect();
            return refuse(
                "axes",
                format!("{points:?} nodes"),
                format!("at least one axis, at most {MAX_NODES} nodes"),
            );
        };
        let volume: f64 = axes.iter().map(UniformGrid::spacing).product();
        if !volume.is_normal() {
            return refuse(
                "axes",
                format!("spacings with product {volume}"),
                "spacings whose product is a normal number",
            );
        }
        let density = normalised(vec![1.0; nodes], nodes, volume)?;
        Ok(Self { axes, volume, density })
    }

    /// Independent normal numbers of these means and standard deviations, evaluated at the nodes.
    ///
    /// # Errors
    /// As [`Lattice::uniform`]; if there is not one mean and one positive deviation per axis; [`Error::Impossible`] if the density is zero
    /// at every node.
    pub fn normal(axes: Vec<UniformGrid>, mean: &[f64], deviation: &[f64]) -> Result<Self, Error> {
        let mut made = Self::uniform(axes)?;
        entries("mean", mean.len(), made.axes.len())?;
        entries("deviation", deviation.len(), made.axes.len())?;
        for (mean, deviation) in mean.iter().zip(deviation) {
            finite("mean", *mean)?;
            positive("deviation", *deviation)?;
        }
        let logs: Vec<Vec<f64>> = (made.axes.iter().zip(mean).zip(deviation))
            .map(|((axis, mean), s)| axis.nodes().map(|x| log_pdf_with(x, *mean, s * s)).collect())
            .collect();
        let sums = made.over_nodes(|at| at.iter().zip(&logs).map(|(i, logs)| logs[*i]).sum());
        made.update(&sums)?;
        Ok(made)
    }

    /// What a function gives at every node, in order; it takes the node's index on each axis.
    fn over_nodes(&self, of: impl Fn(&[usize]) -> f64) -> Vec<f64> {
        let mut at = vec![0; self.axes.len()];
        let each = (0..self.density.len()).map(|node| {
            if node > 0 {
                step(&mut at, &self.axes);
            }
            of(&at)
        });
        each.collect()
    }

    /// The axes.
    pub fn axes(&self) -> &[UniformGrid] {
        &self.axes
    }

    /// Values at the nodes.
    pub fn density(&self) -> &[f64] {
        &self.density
    }

    /// Positions of all nodes along one axis, in the order of the nodes; empty if there is no such axis.
    pub fn positions(&self, axis: usize) -> Vec<f64> {
        let Some(grid) = self.axes.get(axis) else {
            return Vec::new();
        };
        self.over_nodes(|at| grid.node(at[axis]))
    }

    /// The density of one number, at the nodes of its axis; empty if there is no such axis.
    pub fn marginal(&self, axis: usize) -> Vec<f64> {
        let Some(grid) = self.axes.get(axis) else {
            return Vec::new();
        };
        let inner: usize = self.axes[axis + 1..].iter().map(UniformGrid::points).product();
        let mut sums = vec![0.0; grid.points()];
        for (block, values) in self.density.chunks_exact(inner).enumerate() {
            sums[block % grid.points()] += values.iter().sum::<f64>();
        }
        let others = self.volume / grid.spacing();
        sums.iter_mut().for_each(|sum| *sum *= others);
        sums
    }

    /// Mean and variance of each number.
    pub fn moments(&self) -> Vec<(f64, f64)> {
        let of = |(axis, grid): (usize, &UniformGrid)| {
            let marginal = self.marginal(axis);
            let expectation = |f: &dyn Fn(f64) -> f64| {
                let sum: f64 = grid.nodes().zip(&marginal).map(|(x, p)| p * f(x)).sum();
                sum * grid.spacing()
            };
            let mean = expectation(&|x| x);
            (mean, expectation(&|x| (x - mean) * (x - mean)))
        };
        self.axes.iter().enumerate().map(of).collect()
    }

    /// Multiplies by a likelihood, given by its logarithms at the nodes; returns `ln p(observed | past)`.
    ///
    /// # Errors
    /// If there is not one per node; [`Error::NotANumber`] if one is NaN or infinite where the density is positive; [`Error::Impossible`] if
    /// the product is zero at every node. The density is then unchanged.
    pub fn update(&mut self, log_likelihoods: &[f64]) -> Result<f64, Error> {
        entries("log_likelihoods", log_likelihoods.len(), self.density.len())?;
        absorb(&mut self.density, log_likelihoods, self.volume)
    }

    /// The same nodes with other values, up to a common factor.
    ///
    /// # Errors
    /// If there is not one per node, or one is negative or not finite; [`Error::Impossible`] if all are zero.
    pub fn with_density(&self, density: Vec<f64>) -> Result<Self, Error> {
        Ok(Self {
            axes: self.axes.clone(),
            density: normalised(density, self.density.len(), self.volume)?,
            ..*self
        })
    }
}

/// The next node, the last axis fastest.
fn step(at: &mut [usize], axes: &[UniformGrid]) {
    for (i, axis) in at.iter_mut().zip(axes).rev() {
        *i += 1;
        if *i < axis.points() {
            return;
        }
        *i = 0;
    }
}
