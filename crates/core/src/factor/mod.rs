//! The likelihood of an observation as a function of the noise-free measurement.
//!
//! A [`Factor`] is `p(observation | h(x) = m)` as a function of `m`. Each kind of observation (a value, a sign bit over a noisy link, a
//! quantizer cell, the silence of a censoring sensor) is a small type that implements it, and every filter accepts it. Particle and grid
//! filters call [`Factor::log_likelihood`]; the assumed-density filter calls [`Factor::tilted`] for the moments of the posterior.
//!
//! | factor | type |
//! |---|---|
//! | a value in Gaussian noise | [`Value`] |
//! | cells with weights and a constant: sign bits, quantizer cells, silence, symbols, over lossy and flipping links | [`Levels`] |
//! | an observation that does not depend on `m` | [`Constant`] |
//! | any of the three above, of a scalar | [`Scalar`] |
//! | several observations of one `m` | [`Product`], [`Repeated`] |

mod levels;
mod moments;
mod product;
mod scalar;
mod value;

pub use levels::Levels;
pub use moments::{Feature, tilted_by_quadrature};
pub use product::{Product, Repeated};
pub use scalar::{Constant, Scalar};
pub use value::Value;

use crate::columns::{Columns, lengths_agree, state_at};
use crate::error::Error;
use crate::gaussian::Gaussian;
use nalgebra::{SMatrix, SVector};

/// `p(observation | h(x) = m)` for the `M` components of a noise-free measurement `m`.
///
/// Laws ([`crate::laws::factor`]):
/// 1. `log_likelihood` is finite or `-inf` for every finite `m`. If `m` is NaN, the result is NaN or at most the smallest value at any
///    number, so that a NaN never raises a weight;
/// 2. `add_log_likelihoods` adds what `log_likelihood` returns, up to rounding. If lengths differ, all of `log_weights` becomes NaN
///    ([`crate::columns::lengths_agree`]);
/// 3. `tilted` agrees with quadrature of `log_likelihood` against the prior.
pub trait Factor<const M: usize>: Send + Sync {
    /// `ln p(observation | h(x) = m)`.
    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64;

    /// Adds the log likelihood of every column of `means` to `log_weights`. Override it if a sweep over columns is faster than single
    /// calls.
    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        if lengths_agree(means, log_weights) {
            for (i, log_weight) in log_weights.iter_mut().enumerate() {
                *log_weight += self.log_likelihood(&state_at(means, i));
            }
        }
    }

    /// Evidence, mean and covariance of the posterior of `m ~ prior`.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observation has probability zero under the prior; [`Error::NotANumber`] if the prior or the likelihood
    /// is not finite; [`Error::NotConverged`] if a quadrature does not reach its accuracy.
    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error>;

    /// The value, or the middle of the edges, about which measurements on a circle are taken ([`crate::circle`]); `None` if there is none. By
    /// default that of [`as_value`](Self::as_value) or [`as_scalar`](Self::as_scalar).
    fn location(&self) -> Option<SVector<f64, M>> {
        let of_scalar = || self.as_scalar()?.location().map(|at| SVector::repeat(at[0]));
        self.as_value().map(|(value, ..)| value).or_else(of_scalar)
    }

    /// This factor as a [`Scalar`]; `None` if it is none. Filters that impute measurements call it.
    fn as_scalar(&self) -> Option<Scalar> {
        None
    }

    /// The value `z`, its noise covariance `R` and the logarithm of a constant, if the factor is `N(z; m, R)` times the constant and a Gaussian
    /// is to be updated by the Kalman filter in place of [`tilted`](Self::tilted): the same moments in less time.
    fn as_value(&self) -> Option<(SVector<f64, M>, SMatrix<f64, M, M>, f64)> {
        None
    }
}

/// Adds transformed log likelihoods to `log_weights`, block by block. `add(means, logs)` adds the log likelihoods of a block to `logs`,
/// which is zero before; `map` is applied to each. If lengths differ, all of `log_weights` becomes NaN.
pub fn add_mapped<const M: usize>(
    means: &Columns<'_, M>,
    log_weights: &mut [f64],
    add: impl Fn(&Columns<'_, M>, &mut [f64]),
    map: impl Fn(&mut [f64]),
) {
    const BLOCK: usize = 128;
    if !lengths_agree(means, log_weights) {
        return;
    }
    let mut logs = [0.0; BLOCK];
    for (start, log_weights) in (0..).step_by(BLOCK).zip(log_weights.chunks_mut(BLOCK)) {
        let logs = &mut logs[..log_weights.len()];
        logs.fill(0.0);
        add(&means.map(|column| &column[start..start + logs.len()]), logs);
        map(logs);
        let pairs = log_weights.iter_mut().zip(logs);
        pairs.for_each(|(log_weight, log)| *log_weight += *log);
    }
}

/// The posterior of a noise-free measurement `m`: density `N(m; prior) p(observation | m) / evidence`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tilted<const M: usize> {
    /// `ln` of the evidence, `ln integral N(m; prior) p(observation | m) dm`.
    pub log_evidence: f64,
    /// Mean of the posterior.
    pub mean: SVector<f64, M>,
    /// Covariance of the posterior.
    pub covariance: SMatrix<f64, M, M>,
}

impl<const M: usize> Tilted<M> {
    /// The posterior of an observation that does not depend on `m` and has probability `exp(log_evidence)`: the prior itself.
    ///
    /// # Errors
    /// [`Error::Impossible`] for a probability of zero, [`Error::NotANumber`] for NaN or an infinite likelihood.
    pub fn unchanged(prior: &Gaussian<M>, log_evidence: f64) -> Result<Self, Error> {
        if log_evidence == f64::NEG_INFINITY {
            return Err(Error::Impossible);
        }
        if !log_evidence.is_finite() {
            return Err(Error::NotANumber { what: "the likelihood" });
        }
        Ok(Self {
            log_evidence,
            mean: *prior.mean(),
            covariance: *prior.covariance(),
        })
    }
}

impl Tilted<1> {
    /// A scalar posterior; an error if a number is not finite. Under a finite prior the factors of this crate give such numbers only if the
    /// probability of the observation underflows.
    #[inline]
    pub(crate) fn scalar(log_evidence: f64, mean: f64, variance: f64) -> Result<Self, Error> {
        if !(log_evidence.is_finite() && mean.is_finite() && variance.is_finite()) {
            return Err(Error::Impossible);
        }
        Ok(Self {
            log_evidence,
            mean: [mean].into(),
            covariance: [[variance.max(0.0)]].into(),
        })
    }
}

impl<const M: usize, F: Factor<M> + ?Sized> Factor<M> for &F {
    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        (**self).log_likelihood(m)
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        (**self).add_log_likelihoods(means, log_weights);
    }

    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        (**self).tilted(prior)
    }

    fn location(&self) -> Option<SVector<f64, M>> {
        (**self).location()
    }

    fn as_scalar(&self) -> Option<Scalar> {
        (**self).as_scalar()
    }
}
