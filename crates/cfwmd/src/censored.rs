//! What a censoring sensor, reporting or silent, says about its noise-free measurement.

use crate::Error;
use crate::ellipsoid::{EllipsoidMoments, GaussianInEllipsoid};
use crate::rule::CensoringRule;
use fewbits_core::columns::state_at;
use fewbits_core::factor::{Constant, InCell, Partition, Repeated, Scalar, Value};
use fewbits_core::number::Levels;
use fewbits_core::{Cell, Columns, Factor, Gaussian, Link, Tilted};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::kernels;
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{Cholesky, SMatrix, SVector};

/// Nothing arrived from a sensor that is silent if its innovation lies in an ellipsoid about zero:
///
/// `p(nothing | m) = loss + (1 - loss) P(m + n - prediction in ellipsoid)`, `n ~ N(0, R)`.
#[derive(Debug, Clone, PartialEq)]
pub struct EllipsoidSilence<const M: usize> {
    rule: CensoringRule<M>,
    prediction: SVector<f64, M>,
    noise: SMatrix<f64, M, M>,
    inside: GaussianInEllipsoid<M>,
    loss: f64,
}

impl<const M: usize> EllipsoidSilence<M> {
    /// Silence under `rule` about `prediction`, over a link that loses reports; noise covariance `R`.
    ///
    /// # Errors
    /// If `R` is not a covariance or the prediction not finite.
    pub fn new(
        rule: &CensoringRule<M>,
        prediction: &SVector<f64, M>,
        noise: &SMatrix<f64, M, M>,
        link: &Link,
    ) -> Result<Self, ArgumentError> {
        fewbits_numerics::error::all_finite("prediction", prediction.as_slice())?;
        Ok(Self {
            inside: rule.region().under(noise)?,
            rule: rule.clone(),
            prediction: *prediction,
            noise: *noise,
            loss: link.loss(),
        })
    }

    /// Moments of the innovation `nu ~ N(mu, V)` given that nothing arrived: inside the region, or outside and lost.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if the silence has probability zero.
    pub fn innovation_moments(
        rule: &CensoringRule<M>,
        mu: &SVector<f64, M>,
        covariance: &SMatrix<f64, M, M>,
        loss: f64,
    ) -> Result<EllipsoidMoments<M>, fewbits_core::Error> {
        let inside = rule.region().under(covariance)?.moments(mu);
        let Some(inside) = inside else {
            return if loss > 0.0 {
                Ok(EllipsoidMoments {
                    log_mass: loss.ln(),
                    mean: *mu,
                    covariance: *covariance,
                })
            } else {
                Err(fewbits_core::Error::Impossible)
            };
        };
        if loss == 0.0 {
            return Ok(inside);
        }
        let share = (1.0 - loss) * inside.log_mass.exp();
        let total = loss + share;
        let weight = share / total;
        let step = inside.mean - mu;
        Ok(EllipsoidMoments {
            log_mass: total.ln(),
            mean: mu + step * weight,
            covariance: (covariance + step * step.transpose() * weight) * (1.0 - weight) + inside.covariance * weight,
        })
    }
}

impl<const M: usize> Factor<M> for EllipsoidSilence<M> {
    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        let inside = self.inside.log_probability(&(m - self.prediction));
        if self.loss == 0.0 {
            inside
        } else {
            (self.loss + (1.0 - self.loss) * inside.exp()).ln()
        }
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        add_mixed(self.loss, (1.0 - self.loss).ln(), log_weights, |from, logs| {
            for (i, log) in logs.iter_mut().enumerate() {
                *log += self
                    .inside
                    .log_probability(&(state_at(means, from + i) - self.prediction));
            }
        });
    }

    /// With `nu = m + n - prediction` of covariance `S = V + R` and moments `E`, `C` given silence, `K = V S^-1`:
    /// mean `mu + K (E - E0 nu)`, covariance `(I - K) V (I - K)' + K R K' + K C K'`.
    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, fewbits_core::Error> {
        let spread = prior.covariance();
        let total = symmetrised(&(spread + self.noise));
        let mu = prior.mean() - self.prediction;
        let after = Self::innovation_moments(&self.rule, &mu, &total, self.loss)?;
        let factor = Cholesky::new(total).ok_or(fewbits_core::Error::Impossible)?;
        let gain = factor.solve(spread).transpose();
        let keep = SMatrix::<f64, M, M>::identity() - gain;
        Ok(Tilted {
            log_evidence: after.log_mass,
            mean: prior.mean() + gain * (after.mean - mu),
            covariance: keep * spread * keep.transpose() + gain * (self.noise + after.covariance) * gain.transpose(),
        })
    }
}

/// Adds `ln(floor + exp(log_share + log_p))` to the log weights, block by block: `add(from, logs)` adds `log_p` of the elements
/// that begin at `from`.
pub(crate) fn add_mixed(floor: f64, log_share: f64, log_weights: &mut [f64], add: impl Fn(usize, &mut [f64])) {
    const BLOCK: usize = 128;
    let mut logs = [0.0; BLOCK];
    for (from, log_weights) in (0..).step_by(BLOCK).zip(log_weights.chunks_mut(BLOCK)) {
        let logs = &mut logs[..log_weights.len()];
        logs.fill(log_share);
        add(from, logs);
        if floor > 0.0 {
            kernels::exp(logs);
            logs.iter_mut().for_each(|p| *p += floor);
            kernels::ln(logs);
        }
        log_weights
            .iter_mut()
            .zip(logs)
            .for_each(|(weight, log)| *weight += *log);
    }
}

/// The factor of one censoring sensor, or of several that are identical: `ln p(observation | m)`.
///
/// | observation | scalar | vector |
/// |---|---|---|
/// | a value | [`Value`] | [`Value`] |
/// | a value in fixed format | the cell of its level outside the interval of silence, [`InCell`] or [`Partition`] | |
/// | nothing | [`InCell`]: the interval of silence, mixed with the loss of the link | [`EllipsoidSilence`] |
/// | a report known to be lost | [`Constant`] | [`Constant`] |
#[derive(Debug, Clone, PartialEq)]
pub struct Censored<const M: usize> {
    kind: Kind<M>,
    /// Added to every log likelihood.
    log_scale: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind<const M: usize> {
    Value(Value<M>),
    Ellipsoid(Box<EllipsoidSilence<M>>),
    /// Of the only component; `M` is 1.
    Scalar(Repeated),
}

impl<const M: usize> Censored<M> {
    fn scalar(factor: Scalar, count: usize) -> Result<Self, ArgumentError> {
        Ok(Self {
            kind: Kind::Scalar(Repeated::new(factor, count)?),
            log_scale: 0.0,
        })
    }

    /// An observation of the same probability whatever the measurement.
    ///
    /// # Errors
    /// If `probability` is outside `[0, 1]`.
    pub fn constant(probability: f64) -> Result<Self, ArgumentError> {
        Self::scalar(Constant::new(probability)?.into(), 1)
    }

    /// The measurement itself, which arrives with probability `arrival`.
    ///
    /// # Errors
    /// If a number is not finite or `R` not positive definite.
    pub fn value(value: &SVector<f64, M>, noise: &SMatrix<f64, M, M>, arrival: f64) -> Result<Self, ArgumentError> {
        Ok(Self {
            kind: Kind::Value(Value::new(*value, *noise)?),
            log_scale: arrival.ln(),
        })
    }

    /// `values` of identical sensors, each of which arrived with probability `arrival`: by their mean,
    /// `prod N(z_i; m, R) = N(mean; m, R/n) exp(constant)`.
    ///
    /// # Errors
    /// If there is no value, a number is not finite or `R` not positive definite.
    pub fn values(values: &[SVector<f64, M>], noise: &SMatrix<f64, M, M>, arrival: f64) -> Result<Self, ArgumentError> {
        let count = fewbits_numerics::error::at_least_one("values", values.len())? as f64;
        let mean = values.iter().sum::<SVector<f64, M>>() / count;
        let mut all = Self::value(&mean, &(noise / count), 1.0)?;
        let single = Value::new(mean, *noise)?;
        let separate: f64 = values.iter().map(|z| single.log_likelihood(z)).sum();
        let Kind::Value(joint) = &all.kind else { return Ok(all) };
        all.log_scale = separate - joint.log_likelihood(&mean) + count * arrival.ln();
        Ok(all)
    }

    /// Nothing arrived from `count` identical sensors, each silent by `rule` about `prediction`, in noise `R`.
    ///
    /// # Errors
    /// If a number is not finite, `R` not a covariance, `count` zero, or `count` above one for a vector measurement.
    pub fn silence(
        rule: &CensoringRule<M>,
        prediction: &SVector<f64, M>,
        noise: &SMatrix<f64, M, M>,
        link: &Link,
        count: usize,
    ) -> Result<Self, ArgumentError> {
        if M != 1 {
            fewbits_numerics::error::within("count", count as f64, 1.0, 1.0)?;
            return Ok(Self {
                kind: Kind::Ellipsoid(Box::new(EllipsoidSilence::new(rule, prediction, noise, link)?)),
                log_scale: 0.0,
            });
        }
        fewbits_numerics::error::finite("prediction", prediction[0])?;
        let (low, high) = rule.interval(prediction[0]);
        let factor: Scalar = match Cell::new(low, high) {
            Ok(cell) => InCell::silence(cell, noise[(0, 0)], link)?.into(),
            // Everything is sent: only the link can be to blame.
            Err(_) => Constant::new(link.loss())?.into(),
        };
        Self::scalar(factor, count)
    }

    /// A value that arrived as one of a few levels, from a scalar sensor with this rule and prediction.
    ///
    /// # Errors
    /// If a number is not finite, or no measurement that is sent has this level.
    pub fn level(
        value: f64,
        levels: &Levels,
        rule: &CensoringRule<M>,
        prediction: f64,
        noise_variance: f64,
        arrival: f64,
    ) -> Result<Self, ArgumentError> {
        let cell = levels.cell(value)?;
        let (low, high) = rule.interval(prediction);
        let below = Cell::new(cell.lower(), cell.upper().min(low));
        let above = Cell::new(cell.lower().max(high), cell.upper());
        let factor: Scalar = match (below, above) {
            _ if low >= high => InCell::new(cell, noise_variance, 0.0, arrival)?.into(),
            (Ok(below), Ok(above)) => {
                let edges = [below.lower(), below.upper(), above.lower(), above.upper()];
                let shares = [0.0, arrival, 0.0, arrival, 0.0];
                let inner = edges.iter().filter(|e| e.is_finite()).copied().collect();
                let from = usize::from(!edges[0].is_finite());
                let to = shares.len() - usize::from(!edges[3].is_finite());
                Partition::new(inner, shares[from..to].to_vec(), noise_variance)?.into()
            }
            (Ok(one), Err(_)) | (Err(_), Ok(one)) => InCell::new(one, noise_variance, 0.0, arrival)?.into(),
            (Err(_), Err(_)) => {
                return Err(ArgumentError::new(
                    "report",
                    value,
                    format!("a level of a measurement outside ({low}, {high})"),
                ));
            }
        };
        Self::scalar(factor, 1)
    }
}

impl<const M: usize> Factor<M> for Censored<M> {
    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        self.log_scale
            + match &self.kind {
                Kind::Value(factor) => factor.log_likelihood(m),
                Kind::Ellipsoid(factor) => factor.log_likelihood(m),
                Kind::Scalar(factor) => factor.log_likelihood(&[m[0]].into()),
            }
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        if self.log_scale != 0.0 {
            log_weights.iter_mut().for_each(|w| *w += self.log_scale);
        }
        match &self.kind {
            Kind::Value(factor) => factor.add_log_likelihoods(means, log_weights),
            Kind::Ellipsoid(factor) => factor.add_log_likelihoods(means, log_weights),
            Kind::Scalar(factor) => factor.add_log_likelihoods(&[means[0]], log_weights),
        }
    }

    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, fewbits_core::Error> {
        let mut tilted = match &self.kind {
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
            // Only a constant is a factor of a vector and none of a single component.
            Kind::Scalar(factor) => Tilted::unchanged(prior, factor.log_likelihood(&[prior.mean()[0]].into())),
        }?;
        tilted.log_evidence += self.log_scale;
        Ok(tilted)
    }
}

/// A sensor's refusal to encode or a receiver's to decode, without the sensor's number.
pub(crate) fn as_core(error: Error) -> fewbits_core::Error {
    match error {
        Error::Core(error) => error,
        other => ArgumentError::new("report", other.to_string(), "a report that the rule sends").into(),
    }
}
