//! A missing report of a sensor that is silent inside an ellipsoid.

use crate::Error;
use crate::ellipsoid::{EllipsoidMoments, GaussianInEllipsoid};
use crate::rule::CensoringRule;
use fewbits_core::columns::state_at;
use fewbits_core::factor::add_mapped;
use fewbits_core::{Columns, Factor, Gaussian, Link, Tilted};
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::{ArgumentError, kernels};
use nalgebra::{Cholesky, SMatrix, SVector};

/// The two ways in which a report can be missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Missing {
    /// Nothing arrived: the innovation lies in the region of silence, or the report was lost and the centre does not know it.
    Nothing { loss: f64 },
    /// A report is known to be lost: the innovation lies outside the region of silence. `scale` is [`Link::lost_given_sent`].
    Lost { scale: f64 },
}

impl Missing {
    pub(crate) fn nothing(link: &Link) -> Self {
        Self::Nothing { loss: link.loss() }
    }

    pub(crate) fn lost(link: &Link) -> Self {
        Self::Lost {
            scale: link.lost_given_sent(),
        }
    }

    /// Moments of the innovation `nu ~ N(mu, V)` of a sensor with this rule, given that its report is missing.
    ///
    /// # Errors
    /// [`Error::Impossible`] if a missing report has probability zero.
    pub(crate) fn innovation_moments<const M: usize>(
        self,
        rule: &CensoringRule<M>,
        mu: &SVector<f64, M>,
        covariance: &SMatrix<f64, M, M>,
    ) -> Result<EllipsoidMoments<M>, Error> {
        let under = rule.region().under(covariance)?;
        // A silence is either a censored measurement or a lost report.
        let loss = match self {
            Self::Nothing { loss } => loss,
            Self::Lost { scale } => {
                let mut outside = under.moments_outside(mu).ok_or(Error::Impossible)?;
                outside.log_mass += scale.ln();
                return Ok(outside);
            }
        };
        let inside = under.moments(mu);
        // Over a link without loss the logarithm of the mass is kept, which may be below that of the smallest number.
        if loss == 0.0 {
            return inside.ok_or(Error::Impossible);
        }
        let share = inside.map_or(0.0, |inside| (1.0 - loss) * inside.log_mass.exp());
        let total = loss + share;
        // A lost report leaves the innovation as it was before.
        let lost = EllipsoidMoments {
            log_mass: total.ln(),
            mean: *mu,
            covariance: *covariance,
        };
        Ok(inside.map_or(lost, |inside| lost.mixed(&inside, share / total)))
    }
}

/// A missing report of a sensor that is silent if its innovation lies in an ellipsoid about zero. With `n ~ N(0, R)` and
/// `s(m) = P(m + n - prediction in ellipsoid)`:
///
/// `p(nothing | m) = loss + (1 - loss) s(m)` and `p(lost | m) = e (1 - s(m))`, `e` the link's [`lost_given_sent`](Link::lost_given_sent).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EllipsoidMissing<const M: usize> {
    rule: CensoringRule<M>,
    prediction: SVector<f64, M>,
    noise: SMatrix<f64, M, M>,
    inside: GaussianInEllipsoid<M>,
    missing: Missing,
}

impl<const M: usize> EllipsoidMissing<M> {
    pub(crate) fn new(
        rule: &CensoringRule<M>,
        prediction: &SVector<f64, M>,
        noise: &SMatrix<f64, M, M>,
        missing: Missing,
    ) -> Result<Self, ArgumentError> {
        fewbits_numerics::error::all_finite("prediction", prediction.as_slice())?;
        Ok(Self {
            inside: rule.region().under(noise)?,
            rule: rule.clone(),
            prediction: *prediction,
            noise: *noise,
            missing,
        })
    }
}

impl<const M: usize> Factor<M> for EllipsoidMissing<M> {
    fn location(&self) -> Option<SVector<f64, M>> {
        Some(self.prediction)
    }

    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        let mu = m - self.prediction;
        match self.missing {
            Missing::Nothing { loss: 0.0 } => self.inside.log_probability(&mu),
            Missing::Nothing { loss } => (loss + (1.0 - loss) * self.inside.log_probability(&mu).exp()).ln(),
            Missing::Lost { scale } => scale.ln() + self.inside.log_probability_outside(&mu),
        }
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        let (floor, log_share, outside) = match self.missing {
            Missing::Nothing { loss } => (loss, (1.0 - loss).ln(), false),
            Missing::Lost { scale } => (0.0, scale.ln(), true),
        };
        let add = |means: &Columns<'_, M>, logs: &mut [f64]| {
            for (i, log) in logs.iter_mut().enumerate() {
                let mu = state_at(means, i) - self.prediction;
                *log += if outside {
                    self.inside.log_probability_outside(&mu)
                } else {
                    self.inside.log_probability(&mu)
                };
            }
        };
        add_mapped(means, log_weights, add, |logs| mix(floor, log_share, logs));
    }

    /// The posterior follows from the innovation `nu = m + n - prediction`, whose covariance is `S = V + R`. Let `E`, `C` be its mean and
    /// covariance given that the report is missing, `E0 nu` its prior mean and `K = V S^-1`. Then the mean is `mu + K (E - E0 nu)` and the
    /// covariance `(I - K) V (I - K)' + K R K' + K C K'`.
    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        let spread = prior.covariance();
        let total = symmetrised(&(spread + self.noise));
        let mu = prior.mean() - self.prediction;
        let after = self.missing.innovation_moments(&self.rule, &mu, &total)?;
        let what = "the posterior of a missing report";
        let factor = Cholesky::new(total).ok_or(Error::NotANumber { what })?;
        let gain = factor.solve(spread).transpose();
        let keep = SMatrix::<f64, M, M>::identity() - gain;
        let mean = prior.mean() + gain * (after.mean - mu);
        let covariance = keep * spread * keep.transpose() + gain * (self.noise + after.covariance) * gain.transpose();
        if mean.iter().chain(covariance.iter()).any(|x| !x.is_finite()) {
            return Err(Error::NotANumber { what });
        }
        Ok(Tilted {
            log_evidence: after.log_mass,
            mean,
            covariance,
        })
    }
}

/// Replaces each `log_p` of `logs` by `ln(floor + exp(log_share + log_p))`.
#[doc(hidden)]
pub fn mix(floor: f64, log_share: f64, logs: &mut [f64]) {
    logs.iter_mut().for_each(|log| *log += log_share);
    if floor > 0.0 {
        kernels::exp(logs);
        logs.iter_mut().for_each(|p| *p += floor);
        kernels::ln(logs);
    }
}
