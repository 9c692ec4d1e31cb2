//! Likelihood of a censoring sensor's report or silence, as a function of its noise-free measurement.

use crate::Error;
use crate::ellipsoid::{EllipsoidMoments, GaussianInEllipsoid};
use crate::rule::CensoringRule;
use fewbits_core::columns::{lengths_agree, state_at};
use fewbits_core::factor::{Levels, Product, Repeated, Value, add_mapped};
use fewbits_core::number;
use fewbits_core::{Cell, Columns, Factor, Gaussian, Link, Tilted};
use fewbits_numerics::error::at_least_one;
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
    fn new(
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

/// Numbers of missing reports of identical sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MissingReports {
    /// Number of sensors from which nothing arrived ([`Observation::Nothing`](fewbits_core::Observation::Nothing)).
    pub nothing: usize,
    /// Number of sensors whose report is known to be lost ([`Observation::Lost`](fewbits_core::Observation::Lost)).
    pub lost: usize,
}

/// The factor of one censoring sensor, or of several that are identical: `ln p(observation | m)`, `m` the noise-free measurement.
///
/// | observation | scalar | vector |
/// |---|---|---|
/// | a value | [`Value`] | [`Value`] |
/// | a value in fixed format | the cell of its level outside the interval of silence, [`Levels`] | |
/// | nothing | [`Levels`]: the interval of silence, mixed with the loss of the link | an [`Ellipsoid`](crate::ellipsoid::Ellipsoid), mixed with the loss |
/// | a report known to be lost | [`Levels`]: outside the interval of silence | outside the ellipsoid |
#[derive(Debug, Clone, PartialEq)]
pub struct Censored<const M: usize> {
    kind: Kind<M>,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind<const M: usize> {
    Value(Value<M>),
    Ellipsoid(Box<EllipsoidMissing<M>>),
    /// A factor of the one component of a scalar measurement (`M` is 1).
    Scalar(Product),
}

impl<const M: usize> Censored<M> {
    fn scalar(factor: Levels) -> Self {
        Self {
            kind: Kind::Scalar(Product::from_iter([factor.into()])),
        }
    }

    /// A value times `exp(log_scale)`. Values whose probability underflows are impossible, not an argument that is refused.
    fn scaled(value: Value<M>, log_scale: f64) -> Result<Self, ArgumentError> {
        if log_scale == f64::NEG_INFINITY {
            return Self::constant(0.0);
        }
        Ok(Self {
            kind: Kind::Value(value.times_exp(log_scale)?),
        })
    }

    /// An observation that has the same probability for every measurement, so it leaves the belief as it is.
    ///
    /// # Errors
    /// If `probability` is outside `[0, 1]`.
    pub fn constant(probability: f64) -> Result<Self, ArgumentError> {
        Ok(Self::scalar(Levels::constant(probability)?))
    }

    /// The measurement itself, which arrives with probability `arrival`.
    ///
    /// # Errors
    /// If a number is not finite or `R` not positive definite.
    pub fn value(value: &SVector<f64, M>, noise: &SMatrix<f64, M, M>, arrival: f64) -> Result<Self, ArgumentError> {
        Self::scaled(Value::new(*value, *noise)?, arrival.ln())
    }

    /// `values` of identical sensors, each of which arrived with probability `arrival`. They act as one measurement, their mean:
    /// `prod N(z_i; m, R) = N(mean; m, R/n) exp(constant)`.
    ///
    /// # Errors
    /// If there is no value, a number is not finite or `R` not positive definite.
    pub fn values(values: &[SVector<f64, M>], noise: &SMatrix<f64, M, M>, arrival: f64) -> Result<Self, ArgumentError> {
        let count = at_least_one("values", values.len())? as f64;
        let mean = values.iter().sum::<SVector<f64, M>>() / count;
        // The factor of the mean has the right shape. Its constant follows from both forms at one point, `m = mean`.
        let joint = Value::new(mean, noise / count)?;
        let single = Value::new(mean, *noise)?;
        let separate: f64 = values.iter().map(|z| single.log_likelihood(z)).sum();
        Self::scaled(joint, separate - joint.log_likelihood(&mean) + count * arrival.ln())
    }

    /// Nothing arrived from `count` identical sensors. Each is silent by `rule` about `prediction`; its noise covariance is `R = noise`.
    ///
    /// # Errors
    /// As [`Censored::missing`].
    pub fn silence(
        rule: &CensoringRule<M>,
        prediction: &SVector<f64, M>,
        noise: &SMatrix<f64, M, M>,
        link: &Link,
        count: usize,
    ) -> Result<Self, ArgumentError> {
        let silent = MissingReports {
            nothing: count,
            lost: 0,
        };
        Self::missing(rule, prediction, noise, link, silent)
    }

    /// Missing reports of identical sensors. Each is silent by `rule` about `prediction`; its noise covariance is `R = noise`.
    ///
    /// # Errors
    /// If a number is not finite, `R` is not a covariance, no report is missing, or several are missing and `M > 1`.
    pub fn missing(
        rule: &CensoringRule<M>,
        prediction: &SVector<f64, M>,
        noise: &SMatrix<f64, M, M>,
        link: &Link,
        reports: MissingReports,
    ) -> Result<Self, ArgumentError> {
        let count = at_least_one("reports", reports.nothing.saturating_add(reports.lost))?;
        if M != 1 {
            fewbits_numerics::error::within("reports", count as f64, 1.0, 1.0)?;
            let kind = if reports.lost == 1 {
                Missing::lost(link)
            } else {
                Missing::nothing(link)
            };
            return Ok(Self {
                kind: Kind::Ellipsoid(Box::new(EllipsoidMissing::new(rule, prediction, noise, kind)?)),
            });
        }
        fewbits_numerics::error::finite("prediction", prediction[0])?;
        let (low, high) = rule.interval(prediction[0]);
        // No interval (threshold 0): every measurement is sent, so a missing report was lost on the link.
        let cell = Cell::new(low, high).ok();
        let mut product = Product::new();
        if reports.nothing > 0 {
            let factor = match cell {
                Some(cell) => Levels::silence(cell, noise[(0, 0)], link)?,
                None => Levels::constant(link.loss())?,
            };
            product.push_repeated(Repeated::new(factor.into(), reports.nothing)?);
        }
        if reports.lost > 0 {
            let scale = link.lost_given_sent();
            let factor = match cell {
                Some(cell) => Levels::outside(&cell, noise[(0, 0)], scale)?,
                None => Levels::constant(scale)?,
            };
            product.push_repeated(Repeated::new(factor.into(), reports.lost)?);
        }
        Ok(Self {
            kind: Kind::Scalar(product),
        })
    }

    /// A value that arrived as one of a few levels, from a scalar sensor with this rule and prediction. The measurement lies in the
    /// level's cell and outside the interval of silence.
    ///
    /// # Errors
    /// If a number is not finite, or the level's cell lies within the interval of silence.
    pub fn level(
        value: f64,
        levels: &number::Levels,
        rule: &CensoringRule<M>,
        prediction: f64,
        noise_variance: f64,
        arrival: f64,
    ) -> Result<Self, ArgumentError> {
        let cell = levels.cell(value)?;
        let (low, high) = rule.interval(prediction);
        // The cell without the interval of silence consists of two pieces, one or none.
        let below = Cell::new(cell.lower(), cell.upper().min(low));
        let above = Cell::new(cell.lower().max(high), cell.upper());
        let factor = match (below, above) {
            // The rule censors nothing: the whole cell can have been sent.
            _ if low >= high => Levels::new(cell, noise_variance, 0.0, arrival)?,
            (Ok(below), Ok(above)) => {
                let edges = [below.lower(), below.upper(), above.lower(), above.upper()];
                let shares = [0.0, arrival, 0.0, arrival, 0.0];
                let inner: Vec<f64> = edges.iter().filter(|e| e.is_finite()).copied().collect();
                let from = usize::from(!edges[0].is_finite());
                let to = shares.len() - usize::from(!edges[3].is_finite());
                Levels::partition(&inner, &shares[from..to], noise_variance)?
            }
            (Ok(one), Err(_)) | (Err(_), Ok(one)) => Levels::new(one, noise_variance, 0.0, arrival)?,
            (Err(_), Err(_)) => {
                return Err(ArgumentError::new(
                    "report",
                    value,
                    format!("a level of a measurement outside ({low}, {high})"),
                ));
            }
        };
        Ok(Self::scalar(factor))
    }
}

impl<const M: usize> Factor<M> for Censored<M> {
    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        match &self.kind {
            Kind::Value(factor) => factor.log_likelihood(m),
            Kind::Ellipsoid(factor) => factor.log_likelihood(m),
            Kind::Scalar(factor) => factor.log_likelihood(&[m[0]].into()),
        }
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        if !lengths_agree(means, log_weights) {
            return;
        }
        match &self.kind {
            Kind::Value(factor) => factor.add_log_likelihoods(means, log_weights),
            Kind::Ellipsoid(factor) => factor.add_log_likelihoods(means, log_weights),
            Kind::Scalar(factor) => factor.add_log_likelihoods(&[means[0]], log_weights),
        }
    }

    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        match &self.kind {
            Kind::Value(factor) => factor.tilted(prior),
            Kind::Ellipsoid(factor) => factor.tilted(prior),
            Kind::Scalar(factor) if M == 1 => {
                let first = Gaussian::scalar(prior.mean()[0], prior.covariance()[(0, 0)].max(0.0))?;
                let tilted = factor.tilted(&first)?;
                Ok(Tilted {
                    log_evidence: tilted.log_evidence,
                    mean: SVector::repeat(tilted.mean[0]),
                    covariance: SMatrix::repeat(tilted.covariance[0]),
                })
            }
            // A factor without a component is a constant: it changes only the evidence.
            Kind::Scalar(factor) => Tilted::unchanged(prior, factor.log_likelihood(&[prior.mean()[0]].into())),
        }
    }
}
