//! Weighted Gaussians that share one covariance.

use super::Particles;
use super::weights::Categorical;
use crate::Error;
use fewbits_core::columns::{change_each, state_at};
use fewbits_core::{Belief, ColumnsMut, Gaussian};
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// A density `sum_i w_i N(m_i, P)`. A Rao-Blackwellised filter uses it: its particles are conditional means `m_i`, and all share the
/// conditional covariance `P`, which may be singular.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored<D>")]
pub struct GaussianCloud<const D: usize> {
    /// The conditional means with their weights.
    pub means: Particles<D>,
    /// The covariance that all particles share. What changes it must keep it symmetric positive semidefinite.
    #[serde(rename = "covariance", with = "fewbits_numerics::stored")]
    pub shared_covariance: SMatrix<f64, D, D>,
}

/// The stored form of [`GaussianCloud`].
#[derive(Deserialize)]
#[serde(rename = "GaussianCloud")]
#[serde(deny_unknown_fields)]
struct Stored<const D: usize> {
    means: Particles<D>,
    #[serde(with = "fewbits_numerics::stored")]
    covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> TryFrom<Stored<D>> for GaussianCloud<D> {
    type Error = Error;

    fn try_from(parts: Stored<D>) -> Result<Self, Error> {
        GaussianCloud::new(parts.means, parts.covariance)
    }
}

impl<const D: usize> GaussianCloud<D> {
    /// Gaussians of one covariance around the given means.
    ///
    /// # Errors
    /// If `covariance` is not symmetric positive semidefinite.
    pub fn new(means: Particles<D>, covariance: SMatrix<f64, D, D>) -> Result<Self, Error> {
        let shared_covariance = *Gaussian::new(SVector::zeros(), covariance)?.covariance();
        Ok(Self {
            means,
            shared_covariance,
        })
    }

    /// `count` particles that all have the mean and covariance of `belief`.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn agreed(belief: &Gaussian<D>, count: usize) -> Result<Self, Error> {
        Self::new(Particles::from_draws(count, || *belief.mean())?, *belief.covariance())
    }

    /// The Gaussian of the same mean and covariance: the covariance is the shared one plus that of the means.
    pub fn gaussian(&self) -> Gaussian<D> {
        let mean = self.means.mean();
        Gaussian::from_trusted_parts(mean, self.shared_covariance + self.means.covariance_about(&mean))
    }
}

impl<const D: usize> Belief<D> for GaussianCloud<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.means.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        *self.gaussian().covariance()
    }

    /// Draws a particle by its weight, then a state from its Gaussian.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        let spread = Gaussian::from_trusted_parts(SVector::zeros(), self.shared_covariance);
        spread.sample_columns(rng, states.each_mut().map(|column| &mut **column));
        let cumulative = Categorical::new(self.means.weights());
        change_each(states, |offset| state_at(&self.means.columns(), cumulative.draw(rng)) + offset);
    }
}
