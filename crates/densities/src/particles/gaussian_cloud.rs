//! Weighted Gaussians that share one covariance.

use super::Particles;
use super::weights::Categorical;
use crate::Error;
use fewbits_core::columns::{change_each, state_at};
use fewbits_core::{Belief, ColumnsMut, Gaussian};
use fewbits_numerics::stored;
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// A mixture `sum_i w_i N(m_i, P)`: the belief of a Rao-Blackwellised filter, whose particles are conditional means and whose
/// conditional covariance is the same for all. A singular `P` is fine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored<D>")]
pub struct GaussianCloud<const D: usize> {
    means: Particles<D>,
    #[serde(with = "fewbits_numerics::stored")]
    covariance: SMatrix<f64, D, D>,
}

stored! { #[serde(rename = "GaussianCloud")] [const D: usize] GaussianCloud as Stored {
    means: Particles<D>,
    #[serde(with = "fewbits_numerics::stored")]
    covariance: SMatrix<f64, D, D>,
} => GaussianCloud::new(means, covariance), Error }

impl<const D: usize> GaussianCloud<D> {
    /// Gaussians of one covariance around the given means.
    ///
    /// # Errors
    /// If `covariance` is not symmetric positive semidefinite.
    pub fn new(means: Particles<D>, covariance: SMatrix<f64, D, D>) -> Result<Self, Error> {
        let covariance = *Gaussian::new(SVector::zeros(), covariance)?.covariance();
        Ok(Self { means, covariance })
    }

    /// `count` particles that agree on a Gaussian belief.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn agreed(belief: &Gaussian<D>, count: usize) -> Result<Self, Error> {
        Self::new(Particles::from_draws(count, || *belief.mean())?, *belief.covariance())
    }

    /// The conditional means, weighted.
    pub fn means(&self) -> &Particles<D> {
        &self.means
    }

    /// The conditional means for work in place.
    pub fn means_mut(&mut self) -> &mut Particles<D> {
        &mut self.means
    }

    /// The covariance that all particles share.
    pub fn shared_covariance(&self) -> &SMatrix<f64, D, D> {
        &self.covariance
    }

    /// Replaces the shared covariance by one of an update that preserves its properties by construction.
    pub fn set_shared_covariance(&mut self, covariance: SMatrix<f64, D, D>) {
        self.covariance = covariance;
    }

    /// Mean and covariance of the whole belief: the shared covariance plus the spread of the means.
    pub fn gaussian(&self) -> Gaussian<D> {
        let mean = self.means.mean();
        Gaussian::from_trusted_parts(mean, self.covariance + self.means.covariance_about(&mean))
    }
}

impl<const D: usize> Belief<D> for GaussianCloud<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.means.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        *self.gaussian().covariance()
    }

    /// A particle by its weight, then its Gaussian.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        let spread = Gaussian::from_trusted_parts(SVector::zeros(), self.covariance);
        spread.sample_columns(rng, states.each_mut().map(|column| &mut **column));
        let cumulative = Categorical::new(self.means.weights());
        change_each(states, |offset| state_at(&self.means.columns(), cumulative.draw(rng)) + offset);
    }
}
