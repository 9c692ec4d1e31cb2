//! Several observations of one measurement.

use super::moments::{Feature, tilted_by_quadrature};
use super::scalar::middle;
use super::{Factor, Scalar, Tilted, add_mapped};
use crate::columns::{Columns, lengths_agree};
use crate::error::Error;
use crate::gaussian::Gaussian;
use fewbits_numerics::error::{ArgumentError, at_least_one};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

/// The same observation from `count` sensors that share the noise-free measurement: `p(observation | m)^count`. Silences
/// and sign bits of identical sensors are fused exactly; the cost does not grow with their number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeated {
    factor: Scalar,
    count: usize,
}

impl Repeated {
    /// `factor` to the power `count`.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn new(factor: Scalar, count: usize) -> Result<Self, ArgumentError> {
        at_least_one("count", count)?;
        Ok(Self { factor, count })
    }

    /// The factor of a single observation.
    pub fn factor(&self) -> &Scalar {
        &self.factor
    }

    /// Number of observations.
    pub fn count(&self) -> usize {
        self.count
    }
}

impl Factor<1> for Repeated {
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.count as f64 * self.factor.log_likelihood(m)
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        let add = |means: &Columns<'_, 1>, logs: &mut [f64]| self.factor.add_log_likelihoods(means, logs);
        add_mapped(means, log_weights, add, |logs| logs.iter_mut().for_each(|log| *log *= self.count as f64));
    }

    fn location(&self) -> Option<SVector<f64, 1>> {
        self.factor.location()
    }

    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        if self.count == 1 {
            return self.factor.tilted(prior);
        }
        tilted_by_quadrature(prior, self.factor.features(), |m, logs| self.add_log_likelihoods(&[m], logs))
    }
}

/// Independent observations of one measurement: log likelihoods add.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Product {
    /// One kind needs no memory of the heap.
    factors: SmallVec<[Repeated; 1]>,
}

impl Product {
    /// Multiplies by the factor of one more observation. One that equals an earlier one raises its count.
    pub fn push(&mut self, factor: Scalar) {
        self.push_repeated(Repeated { factor, count: 1 });
    }

    /// Multiplies by the factor of several equal observations.
    pub fn push_repeated(&mut self, more: Repeated) {
        match self.factors.iter_mut().find(|known| known.factor == more.factor) {
            Some(known) => known.count += more.count,
            None => self.factors.push(more),
        }
    }

    /// The distinct factors, each with its count.
    pub fn factors(&self) -> &[Repeated] {
        &self.factors
    }

    /// The places where the likelihood changes.
    fn features(&self) -> impl Iterator<Item = Feature> + '_ {
        self.factors.iter().flat_map(|f| f.factor.features())
    }
}

impl FromIterator<Scalar> for Product {
    fn from_iter<I: IntoIterator<Item = Scalar>>(factors: I) -> Self {
        let mut product = Self::default();
        factors.into_iter().for_each(|factor| product.push(factor));
        product
    }
}

impl Factor<1> for Product {
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.factors.iter().map(|factor| factor.log_likelihood(m)).sum()
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        if lengths_agree(means, log_weights) {
            for factor in &self.factors {
                factor.add_log_likelihoods(means, log_weights);
            }
        }
    }

    fn location(&self) -> Option<SVector<f64, 1>> {
        middle(self.features())
    }

    /// A single factor uses its closed form if it has one; several factors use quadrature.
    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        match self.factors.as_slice() {
            [] => Tilted::unchanged(prior, 0.0),
            [factor] => factor.tilted(prior),
            _ => tilted_by_quadrature(prior, self.features(), |m, logs| self.add_log_likelihoods(&[m], logs)),
        }
    }
}
