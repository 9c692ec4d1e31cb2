//! A value observed in Gaussian noise.

use super::{Factor, Scalar, Tilted};
use crate::columns::{Columns, lengths_agree};
use crate::error::Error;
use crate::gaussian::{FactoredGaussian, Gaussian};
use fewbits_numerics::error::{ArgumentError, all_finite, finite};
use fewbits_numerics::kernels::vectorised;
use nalgebra::{Cholesky, SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// The measurement itself, `z ~ N(m, R)`, times a constant such as the probability that it arrives. With it, the assumed-density update is
/// the Kalman filter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts<M>", into = "Parts<M>")]
pub struct Value<const M: usize> {
    noise: FactoredGaussian<M>,
    log_scale: f64,
}

/// The stored form of [`Value`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts<const M: usize> {
    noise: Gaussian<M>,
    #[serde(default)]
    log_scale: f64,
}

impl<const M: usize> Value<M> {
    /// The value `z` in noise of covariance `R`.
    ///
    /// # Errors
    /// If an entry is not finite or `R` is not symmetric positive definite.
    pub fn new(value: SVector<f64, M>, noise_covariance: SMatrix<f64, M, M>) -> Result<Self, ArgumentError> {
        all_finite("value", value.as_slice())?;
        let noise = Gaussian::new(value, noise_covariance)
            .and_then(|noise| noise.factored())
            .map_err(|error| ArgumentError {
                name: "noise_covariance",
                ..error
            })?;
        Ok(Self { noise, log_scale: 0.0 })
    }

    /// The same, with `log` added to every log likelihood.
    ///
    /// # Errors
    /// If it is not finite.
    pub fn times_exp(self, log: f64) -> Result<Self, ArgumentError> {
        let log_scale = finite("log", self.log_scale + log)?;
        Ok(Self { log_scale, ..self })
    }

    /// The same noise about another value, which is finite.
    pub(crate) fn of_value(self, value: SVector<f64, M>) -> Self {
        let noise = self.noise.with_mean(value);
        Self { noise, ..self }
    }

    /// Observed value `z`.
    pub fn value(&self) -> &SVector<f64, M> {
        self.noise.mean()
    }

    /// Logarithm of the constant that multiplies the density.
    pub fn log_scale(&self) -> f64 {
        self.log_scale
    }

    /// Noise covariance `R`.
    pub fn noise_covariance(&self) -> &SMatrix<f64, M, M> {
        self.noise.gaussian().covariance()
    }
}

impl Value<1> {
    /// A scalar value in noise of the given variance.
    ///
    /// # Errors
    /// If a number is not finite or the variance not positive.
    pub fn scalar(value: f64, noise_variance: f64) -> Result<Self, ArgumentError> {
        fewbits_numerics::error::positive("noise_variance", noise_variance)?;
        Self::new([value].into(), [[noise_variance]].into())
    }
}

impl<const M: usize> From<Value<M>> for Parts<M> {
    fn from(value: Value<M>) -> Self {
        Self {
            noise: *value.noise.gaussian(),
            log_scale: value.log_scale,
        }
    }
}

impl<const M: usize> TryFrom<Parts<M>> for Value<M> {
    type Error = ArgumentError;

    fn try_from(parts: Parts<M>) -> Result<Self, ArgumentError> {
        Self::new(*parts.noise.mean(), *parts.noise.covariance())?.times_exp(parts.log_scale)
    }
}

impl<const M: usize> Factor<M> for Value<M> {
    #[inline]
    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        self.log_scale + self.noise.log_pdf(m)
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        if !lengths_agree(means, log_weights) {
            return;
        }
        let half_precision = 0.5 / self.noise_covariance().iter().next().unwrap_or(&0.0);
        // Variances below 1e-308 are subnormal and have lost precision.
        if M == 1 && half_precision.is_finite() {
            // A plain quadratic without branches, so that the loop vectorises.
            let (value, constant) = (self.value()[0], self.noise.log_peak() + self.log_scale);
            vectorised(
                #[inline(always)]
                || {
                    for (log_weight, m) in log_weights.iter_mut().zip(means[0]) {
                        *log_weight += constant - half_precision * (value - m) * (value - m);
                    }
                },
            );
        } else {
            self.noise.add_log_pdfs(means, log_weights);
            log_weights
                .iter_mut()
                .for_each(|log_weight| *log_weight += self.log_scale);
        }
    }

    fn location(&self) -> Option<SVector<f64, M>> {
        Some(*self.value())
    }

    fn as_scalar(&self) -> Option<Scalar> {
        let variance = self.noise_covariance().iter().next().filter(|_| M == 1)?;
        let one = Value::scalar(self.value()[0], *variance).and_then(|one| one.times_exp(self.log_scale));
        Some(one.ok()?.into())
    }

    /// `S = V + R`, gain `K = V S^-1`: mean `mu + K (z - mu)`, covariance `(I - K) V (I - K)' + K R K'`, evidence
    /// `N(z; mu, S)`.
    #[inline]
    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        let (spread, noise) = (prior.covariance(), self.noise_covariance());
        let factor = Cholesky::new(spread + noise).ok_or(Error::NotANumber {
            what: "the prior's covariance",
        })?;
        let gain = factor.solve(spread).transpose();
        let keep = SMatrix::<f64, M, M>::identity() - gain;
        let innovation = self.value() - prior.mean();
        let log_root_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let squared = innovation.dot(&factor.solve(&innovation));
        let log_evidence = -0.5 * squared - log_root_determinant - M as f64 * fewbits_numerics::normal::LN_SQRT_2PI;
        let log_evidence = log_evidence + self.log_scale;
        let mean = prior.mean() + gain * innovation;
        // Joseph form: stays positive semidefinite under rounding.
        let covariance = keep * spread * keep.transpose() + gain * noise * gain.transpose();
        let finite = log_evidence.is_finite() && mean.iter().chain(covariance.iter()).all(|x| x.is_finite());
        if !finite {
            return Err(Error::unlikely_or_no_number(log_evidence, "the posterior of a value"));
        }
        Ok(Tilted {
            log_evidence,
            mean,
            covariance,
        })
    }
}
