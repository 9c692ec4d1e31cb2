//! Likelihood of a censoring sensor's report or silence, as a function of its noise-free measurement.

use crate::Error;
use crate::missing::{EllipsoidMissing, Missing};
use crate::rule::CensoringRule;
use fewbits_core::columns::lengths_agree;
use fewbits_core::factor::{Levels, Product, Repeated, Scalar, Value};
use fewbits_core::number;
use fewbits_core::{Cell, Columns, Factor, Gaussian, Link, Tilted};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::at_least_one;
use nalgebra::{SMatrix, SVector};

#[doc(hidden)]
pub use crate::missing::mix;

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
    pub(crate) fn constant(probability: f64) -> Result<Self, ArgumentError> {
        Ok(Self::scalar(Levels::constant(probability)?))
    }

    /// The measurement itself, which arrives with probability `arrival`.
    ///
    /// # Errors
    /// If a number is not finite or `R` not positive definite.
    pub(crate) fn value(
        value: &SVector<f64, M>,
        noise: &SMatrix<f64, M, M>,
        arrival: f64,
    ) -> Result<Self, ArgumentError> {
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
        let mut product = Product::default();
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
    pub(crate) fn level(
        value: f64,
        levels: &number::EvenLevels,
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
    fn location(&self) -> Option<SVector<f64, M>> {
        match &self.kind {
            Kind::Value(factor) => factor.location(),
            Kind::Ellipsoid(factor) => factor.location(),
            Kind::Scalar(factor) => factor.location().map(|at| SVector::repeat(at[0])),
        }
    }

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

    fn as_scalar(&self) -> Option<Scalar> {
        match &self.kind {
            Kind::Value(value) => value.as_scalar(),
            Kind::Scalar(product) => match product.factors() {
                [one] if one.count() == 1 => Some(one.factor().clone()),
                _ => None,
            },
            Kind::Ellipsoid(_) => None,
        }
    }

    fn as_value(&self) -> Option<(SVector<f64, M>, SMatrix<f64, M, M>, f64)> {
        match &self.kind {
            Kind::Value(value) => Some((*value.value(), *value.noise_covariance(), value.log_scale())),
            _ => None,
        }
    }
}
