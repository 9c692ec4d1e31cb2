//! Reports that may be outliers, unrelated to the measurement.

use super::{Factor, Tilted, add_mapped};
use crate::columns::Columns;
use crate::error::Error;
use crate::gaussian::Gaussian;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::within;
use nalgebra::SVector;

/// `(1 - e) p(observation | m) + e c`: with probability `e` the report is an outlier, whose probability or density is `c` for every `m`.
///
/// The posterior is the mixture of the factor's own posterior and the prior, so evidence and moments are as exact as those of the factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Robust<F> {
    /// The factor of the report if it is not an outlier.
    pub factor: F,
    log_genuine: f64,
    log_outlier: f64,
}

impl<F> Robust<F> {
    /// `share` is the probability `e` of an outlier. `density` is `c`: the probability of the word, or the density of the value, under an
    /// outlier.
    ///
    /// # Errors
    /// If the share is outside `[0, 1)`, or the density is negative or not finite.
    pub fn new(factor: F, share: f64, density: f64) -> Result<Self, ArgumentError> {
        within("share", share, 0.0, 1.0 - f64::EPSILON)?;
        fewbits_numerics::error::non_negative("density", density)?;
        Ok(Self {
            factor,
            log_genuine: (-share).ln_1p(),
            log_outlier: share.ln() + density.ln(),
        })
    }

    /// `ln` of the mixture, from the logarithm of the inner factor.
    #[inline]
    fn mixed(&self, log: f64) -> f64 {
        let own = log + self.log_genuine;
        // A likelihood of NaN must not raise a weight.
        if own.is_nan() {
            return f64::NEG_INFINITY;
        }
        let (high, low) = if own > self.log_outlier {
            (own, self.log_outlier)
        } else {
            (self.log_outlier, own)
        };
        if low == f64::NEG_INFINITY {
            high
        } else {
            high + (low - high).exp().ln_1p()
        }
    }
}

impl<const M: usize, F: Factor<M>> Factor<M> for Robust<F> {
    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        self.mixed(self.factor.log_likelihood(m))
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        let add = |means: &Columns<'_, M>, logs: &mut [f64]| self.factor.add_log_likelihoods(means, logs);
        add_mapped(means, log_weights, add, |logs| logs.iter_mut().for_each(|log| *log = self.mixed(*log)));
    }

    fn location(&self) -> Option<SVector<f64, M>> {
        self.factor.location()
    }

    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        let own = match self.factor.tilted(prior) {
            Ok(own) => own,
            Err(Error::Impossible) => return Tilted::unchanged(prior, self.log_outlier),
            Err(error) => return Err(error),
        };
        let log_evidence = self.mixed(own.log_evidence);
        // Posterior probability that the report is no outlier. An outlier leaves the prior unchanged.
        let share = (own.log_evidence + self.log_genuine - log_evidence).exp();
        let offset = own.mean - prior.mean();
        let mean = prior.mean() + offset * share;
        // Moments of the mixture of both cases; the last term is the spread between their means.
        let covariance = own.covariance * share
            + prior.covariance() * (1.0 - share)
            + offset * offset.transpose() * (share * (1.0 - share));
        if !(log_evidence.is_finite() && mean.iter().chain(covariance.iter()).all(|x| x.is_finite())) {
            return Err(Error::NotANumber { what: "the posterior" });
        }
        Ok(Tilted {
            log_evidence,
            mean,
            covariance,
        })
    }
}
