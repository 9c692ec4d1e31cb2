//! A linear Gaussian state heard through cells, Rao-Blackwellised.

use crate::particle::{ParticleFilter, ParticleInfo, Workspace};
use crate::{Error, kalman};
use fewbits_core::factor::Scalar;
use fewbits_core::{Gaussian, LinearDynamics};
use fewbits_densities::Particles;
use fewbits_models::LinearSensor;
use fewbits_numerics::normal;
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};

/// A belief about a linear Gaussian state that heard bits, cells, silence or values of scalar measurements.
///
/// Given the measurements themselves the state is Gaussian, and its covariance does not depend on their values. So a particle
/// is a Kalman mean with the measurements it imagined, all particles share one covariance, and far fewer are needed than of
/// states. A value has no freedom and leaves no noise at all: with values only this is the Kalman filter.
///
/// ```text
/// update, with s = h'Ph + r and K = Ph/s, for each particle mean m:
///     w *= p(heard | m) = sum over pieces (cell, share) of share * P(z in cell), z ~ N(h'm, s)
///     z ~ N(h'm, s) restricted to a piece, the piece drawn by its share of p
///     m += K (z - h'm)
/// P -= K s K'
/// ```
/// A bit through a noisy link and the silence of a lossy one are two pieces each: the likelihood of `z` is piecewise constant.
/// (Chen and Liu 2000, mixture Kalman filters; here with imputation from the optimal proposal.)
#[derive(Debug, Clone, PartialEq)]
pub struct RaoBlackwellised<const D: usize> {
    means: Particles<D>,
    covariance: SMatrix<f64, D, D>,
}

/// A part of the line with the probability that what was heard follows from a measurement there.
type Piece = (fewbits_core::Cell, f64);

impl<const D: usize> RaoBlackwellised<D> {
    /// `count` particles that agree on a Gaussian belief.
    ///
    /// # Errors
    /// No particle.
    pub fn new(belief: &Gaussian<D>, count: usize) -> Result<Self, Error> {
        Ok(Self {
            means: Particles::from_draws(count, || *belief.mean())?,
            covariance: *belief.covariance(),
        })
    }

    /// The conditional means, weighted.
    pub fn means(&self) -> &Particles<D> {
        &self.means
    }

    /// The covariance that all particles share.
    pub fn shared_covariance(&self) -> &SMatrix<f64, D, D> {
        &self.covariance
    }

    /// Mean and covariance of the whole belief: the shared covariance plus the spread of the means.
    pub fn gaussian(&self) -> Gaussian<D> {
        let mean = self.means.mean();
        Gaussian::from_trusted_parts(mean, self.covariance + self.means.covariance_about(&mean))
    }

    /// Resamples if `filter` says so and moves every mean by the dynamics.
    ///
    /// # Errors
    /// As [`ParticleFilter::resample`].
    pub fn predict<R: Rng + ?Sized>(
        &mut self,
        rng: &mut R,
        filter: &ParticleFilter,
        dynamics: &impl LinearDynamics<D>,
        workspace: &mut Workspace,
    ) -> Result<(), Error> {
        filter.resample(rng, &mut self.means, workspace)?;
        let columns = self.means.columns_mut();
        for i in 0..columns[0].len() {
            let mean = dynamics.transition() * SVector::<f64, D>::from_fn(|d, _| columns[d][i]);
            for d in 0..D {
                columns[d][i] = mean[d];
            }
        }
        let shared = Gaussian::from_trusted_parts(SVector::zeros(), self.covariance);
        self.covariance = *kalman::predict(dynamics, &shared).covariance();
        Ok(())
    }

    /// Hears a scalar sensor.
    ///
    /// # Errors
    /// [`Error::Density`] if what was heard is impossible for every particle (the belief is then as it was); numbers out of
    /// range.
    pub fn update<R: Rng + ?Sized>(
        &mut self,
        rng: &mut R,
        sensor: &LinearSensor<D, 1>,
        observed: &Scalar,
    ) -> Result<ParticleInfo, Error> {
        let row = fewbits_core::LinearSensing::matrix(sensor).transpose();
        let shared = Gaussian::from_trusted_parts(SVector::zeros(), self.covariance);
        let (updated, info) = kalman::update(sensor, &shared, &SVector::zeros())?;
        let (gain, deviation) = (info.gain.column(0).into_owned(), info.innovation_covariance[(0, 0)].sqrt());
        let pieces = match observed {
            Scalar::Value(value) => {
                let value = value.value()[0];
                let log_likelihood =
                    self.reweigh(&row, |predicted| normal::log_pdf((value - predicted) / deviation) - deviation.ln())?;
                self.absorb(&row, &gain, |_| value);
                self.covariance = *updated.covariance();
                return Ok(self.info(log_likelihood));
            }
            other => other.pieces(),
        };
        let log_likelihood = self.reweigh(&row, |predicted| log_sum(log_shares(&pieces, predicted, deviation)))?;
        self.absorb(&row, &gain, |predicted| {
            let (lower, upper) = choose(rng, &pieces, predicted, deviation);
            // A piece of positive mass holds numbers: it is never refused.
            normal::sample_truncated(rng, (lower - predicted) / deviation, (upper - predicted) / deviation)
                .map_or(predicted, |z| predicted + deviation * z)
        });
        self.covariance = *updated.covariance();
        Ok(self.info(log_likelihood))
    }

    fn info(&self, log_likelihood: f64) -> ParticleInfo {
        ParticleInfo {
            log_likelihood,
            effective_sample_size: self.means.effective_sample_size(),
        }
    }

    fn reweigh(&mut self, row: &SVector<f64, D>, log_likelihood: impl Fn(f64) -> f64) -> Result<f64, Error> {
        Ok(self.means.reweigh(|columns, log_weights| {
            for (i, log_weight) in log_weights.iter_mut().enumerate() {
                *log_weight += log_likelihood((0..D).map(|d| row[d] * columns[d][i]).sum());
            }
        })?)
    }

    /// Updates each mean with its own measurement, a function of the predicted one.
    fn absorb(&mut self, row: &SVector<f64, D>, gain: &SVector<f64, D>, mut measurement: impl FnMut(f64) -> f64) {
        let columns = self.means.columns_mut();
        for i in 0..columns[0].len() {
            let predicted: f64 = (0..D).map(|d| row[d] * columns[d][i]).sum();
            let innovation = measurement(predicted) - predicted;
            for d in 0..D {
                columns[d][i] += gain[d] * innovation;
            }
        }
    }
}

/// `ln(share P(z in piece))` of each piece.
#[inline]
fn log_shares(pieces: &[Piece], predicted: f64, deviation: f64) -> impl Iterator<Item = f64> + Clone + '_ {
    pieces.iter().map(move |(cell, share)| {
        normal::log_interval((cell.lower() - predicted) / deviation, (cell.upper() - predicted) / deviation)
            + share.ln()
    })
}

/// `ln sum exp`.
#[inline]
fn log_sum(terms: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = terms.clone().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + terms.map(|t| (t - largest).exp()).sum::<f64>().ln()
}

/// Ends of a piece drawn in proportion to its share; no uniform is spent where there is no choice.
#[inline]
fn choose<R: Rng + ?Sized>(rng: &mut R, pieces: &[Piece], predicted: f64, deviation: f64) -> (f64, f64) {
    let ends = |i: usize| {
        pieces
            .get(i)
            .map_or((f64::NEG_INFINITY, f64::INFINITY), |p| (p.0.lower(), p.0.upper()))
    };
    if pieces.len() == 1 {
        return ends(0);
    }
    let terms = log_shares(pieces, predicted, deviation);
    let total = log_sum(terms.clone());
    let mut left = rng.random::<f64>();
    let mut chosen = 0;
    for (i, term) in terms.enumerate() {
        let share = (term - total).exp();
        if share > 0.0 {
            chosen = i;
            if left < share {
                break;
            }
            left -= share;
        }
    }
    ends(chosen)
}
