//! A density over the plane.

use super::axis::WIDEST;
use super::line::{TRIANGULAR_VARIANCE, absorb, check_density, normalise, triangular};
use crate::Error;
use crate::particles::weights::Categorical;
use fewbits_core::columns::change_each;
use fewbits_core::{Belief, ColumnsMut, Density, Gaussian, Likelihood};
use fewbits_numerics::error::{ArgumentError, all_finite, refuse};
use fewbits_numerics::stored;
use nalgebra::{Cholesky, Matrix2, Vector2};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Deviations of a belief that its lattice covers.
const REACH: f64 = 7.0;
/// Most nodes of a lattice.
const MOST_NODES: usize = 1_000_000;

/// A density over the plane, held at the nodes `B n` of a lattice: `B` is the basis, `n` runs over a rectangle of whole
/// numbers. Between the nodes it is bilinear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct PlaneMass {
    #[serde(with = "fewbits_numerics::stored")]
    basis: Matrix2<f64>,
    /// Whole numbers of the first node.
    first: [i64; 2],
    /// Nodes along each axis; the second runs fastest.
    size: [usize; 2],
    #[serde(with = "fewbits_numerics::stored")]
    density: Vec<f64>,
}

stored! { #[serde(rename = "PlaneMass")] PlaneMass as Stored {
    #[serde(with = "fewbits_numerics::stored")]
    basis: Matrix2<f64>,
    first: [i64; 2],
    size: [usize; 2],
    #[serde(with = "fewbits_numerics::stored")]
    density: Vec<f64>,
} => {
    let mass = PlaneMass::empty(&basis, first, size)?;
    check_density(&density, mass.density.len(), mass.area())?;
    Ok(PlaneMass { density, ..mass })
}, Error }

impl PlaneMass {
    fn empty(basis: &Matrix2<f64>, first: [i64; 2], size: [usize; 2]) -> Result<Self, Error> {
        all_finite("basis", basis.as_slice())?;
        // Densities are at most one over the area of a node.
        if !basis.determinant().is_normal() {
            return refuse("basis", format!("{basis:?}"), "a regular matrix");
        }
        let nodes = size[0].saturating_mul(size[1]);
        if nodes == 0 || nodes > MOST_NODES || first.iter().any(|n| n.unsigned_abs() > 1 << 50) {
            let text = format!("{} x {} nodes", size[0], size[1]);
            return refuse("belief", text, "a belief that a million nodes can hold");
        }
        Ok(Self {
            basis: *basis,
            first,
            size,
            density: vec![0.0; nodes],
        })
    }

    /// A lattice of the given basis that covers seven deviations of a belief, filled node by node (the second whole number
    /// runs fastest) and scaled to integrate to one.
    ///
    /// # Errors
    /// If `basis` is singular or the lattice needs more than a million nodes; [`fewbits_core::Error::Impossible`] if nothing
    /// is filled in or the belief has left the range of numbers.
    pub fn covering(
        basis: &Matrix2<f64>,
        belief: &Gaussian<2>,
        fill: impl FnOnce(&Self, &mut [f64]),
    ) -> Result<Self, Error> {
        if !(belief.mean().amax() <= WIDEST && belief.covariance().amax() <= WIDEST * WIDEST) {
            return Err(fewbits_core::Error::Impossible.into());
        }
        let refuse = || ArgumentError::new("basis", format!("{basis:?}"), "a regular matrix");
        let inverse = basis.try_inverse().ok_or_else(refuse)?;
        let (centre, spread) = (inverse * belief.mean(), inverse * belief.covariance() * inverse.transpose());
        let (mut first, mut size) = ([0; 2], [0; 2]);
        for axis in 0..2 {
            let reach = REACH * spread[(axis, axis)].sqrt();
            let (low, high) = (centre[axis] - reach, centre[axis] + reach);
            if !(low.abs() < 1e15 && high.abs() < 1e15) {
                return Err(fewbits_core::Error::Impossible.into());
            }
            first[axis] = low.floor() as i64;
            size[axis] = (high.ceil() - low.floor()) as usize + 1;
        }
        let mut mass = Self::empty(basis, first, size)?;
        let mut density = std::mem::take(&mut mass.density);
        fill(&mass, &mut density);
        normalise(&mut density, mass.area())?;
        mass.density = density;
        Ok(mass)
    }

    /// A normal density.
    ///
    /// # Errors
    /// As [`PlaneMass::covering`]; if the covariance is singular.
    pub fn normal(basis: &Matrix2<f64>, belief: &Gaussian<2>) -> Result<Self, Error> {
        let refuse = |what| ArgumentError::new(what, format!("{belief:?}"), "a positive definite covariance");
        let inverse = basis.try_inverse().ok_or_else(|| refuse("basis"))?;
        let spread = Cholesky::new(inverse * belief.covariance() * inverse.transpose());
        let spread = spread.ok_or_else(|| refuse("covariance"))?;
        let centre = inverse * belief.mean();
        Self::covering(basis, belief, |lattice, density| {
            for (n, p) in lattice.nodes().zip(density) {
                let offset = n - centre;
                *p = (-0.5 * offset.dot(&spread.solve(&offset))).exp();
            }
        })
    }

    /// The basis: its columns are the steps between neighbouring nodes, in state units.
    pub fn basis(&self) -> &Matrix2<f64> {
        &self.basis
    }

    /// Whole numbers of the first node.
    pub fn first(&self) -> [i64; 2] {
        self.first
    }

    /// Nodes along each axis.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Densities at the nodes, the second axis fastest; they sum to one over [`area`](Self::area).
    pub fn density(&self) -> &[f64] {
        &self.density
    }

    /// Area that belongs to one node, in state units squared.
    pub fn area(&self) -> f64 {
        self.basis.determinant().abs()
    }

    /// Whole numbers of every node, in storage order.
    pub fn nodes(&self) -> impl Iterator<Item = Vector2<f64>> + '_ {
        let place = |axis: usize, i: usize| (self.first[axis] + i as i64) as f64;
        (0..self.size[0]).flat_map(move |i| (0..self.size[1]).map(move |j| Vector2::new(place(0, i), place(1, j))))
    }

    /// Bayes' rule with any likelihood; returns `ln p(observed | past)`.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if the product with the belief is zero at every node; the belief is then as before.
    pub fn update(&mut self, observed: &(impl Likelihood<2> + ?Sized)) -> Result<f64, Error> {
        let states: Vec<Vector2<f64>> = self.nodes().map(|n| self.basis * n).collect();
        let columns: [Vec<f64>; 2] = std::array::from_fn(|d| states.iter().map(|x| x[d]).collect());
        let mut logs = vec![0.0; states.len()];
        observed.add_log_likelihoods(columns.each_ref().map(Vec::as_slice), &mut logs);
        let area = self.area();
        absorb(&mut self.density, &logs, area)
    }

    /// The same with the log likelihood as a function of the state.
    ///
    /// # Errors
    /// As [`PlaneMass::update`].
    pub fn update_with(&mut self, log_likelihood: impl Fn(&Vector2<f64>) -> f64) -> Result<f64, Error> {
        let logs: Vec<f64> = self.nodes().map(|n| log_likelihood(&(self.basis * n))).collect();
        let area = self.area();
        absorb(&mut self.density, &logs, area)
    }

    /// Mean and covariance in state units.
    pub fn moments(&self) -> Gaussian<2> {
        let (mean, covariance) = self.lattice_moments();
        Gaussian::from_trusted_parts(self.basis * mean, self.basis * covariance * self.basis.transpose())
    }

    /// Mean and covariance in whole numbers.
    fn lattice_moments(&self) -> (Vector2<f64>, Matrix2<f64>) {
        let area = self.area();
        let weighted = || self.nodes().zip(&self.density);
        let mean = weighted().map(|(n, p)| n * *p).sum::<Vector2<f64>>() * area;
        let spread = |(n, p): (Vector2<f64>, &f64)| (n - mean) * (n - mean).transpose() * *p;
        (mean, weighted().map(spread).sum::<Matrix2<f64>>() * area)
    }

    /// The density at node `(i, j)` of the rectangle; zero outside.
    fn at(&self, i: f64, j: f64) -> f64 {
        let inside = i >= 0.0 && j >= 0.0 && i < self.size[0] as f64 && j < self.size[1] as f64;
        if inside {
            self.density[i as usize * self.size[1] + j as usize]
        } else {
            0.0
        }
    }
}

impl Belief<2> for PlaneMass {
    fn mean(&self) -> Vector2<f64> {
        *self.moments().mean()
    }

    fn covariance(&self) -> Matrix2<f64> {
        *self.moments().covariance()
    }

    /// Draws of the bilinear interpolant, drawn towards the mean by what interpolation adds to the covariance.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, 2>) {
        let cumulative = Categorical::new(&self.density);
        let (mean, covariance) = self.lattice_moments();
        let widened = covariance + Matrix2::identity() * TRIANGULAR_VARIANCE;
        let shrink = match (Cholesky::new(covariance), Cholesky::new(widened)) {
            (Some(own), Some(wide)) => own.l() * wide.l().try_inverse().unwrap_or_else(Matrix2::identity),
            _ => Matrix2::zeros(),
        };
        change_each(states, |_| {
            let node = cumulative.draw(rng);
            let (row, column) = (node / self.size[1], node % self.size[1]);
            let at = |axis: usize, n: usize| (self.first[axis] + n as i64) as f64;
            let offset = Vector2::new(triangular(rng), triangular(rng));
            let drawn = Vector2::new(at(0, row), at(1, column)) + offset;
            self.basis * (mean + shrink * (drawn - mean))
        });
    }
}

impl Density<2> for PlaneMass {
    /// Bilinear between the nodes, zero outside.
    fn log_density(&self, state: &Vector2<f64>) -> f64 {
        let Some(inverse) = self.basis.try_inverse() else {
            return f64::NEG_INFINITY;
        };
        let at = inverse * state - Vector2::new(self.first[0] as f64, self.first[1] as f64);
        if state.iter().all(|x| x.is_finite()) && !at.iter().all(|x| x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let below = at.map(f64::floor);
        let share = at - below;
        let mut value = 0.0;
        for (i, wi) in [(0.0, 1.0 - share[0]), (1.0, share[0])] {
            for (j, wj) in [(0.0, 1.0 - share[1]), (1.0, share[1])] {
                value += wi * wj * self.at(below[0] + i, below[1] + j);
            }
        }
        value.ln()
    }
}
