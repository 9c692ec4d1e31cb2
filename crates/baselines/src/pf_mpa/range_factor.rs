//! What a range sensor reported, as the printed trackers use it: a level with the interval from which they draw, or the range itself.

use fewbits_core::columns::lengths_agree;
use fewbits_core::factor::{Factor, Feature, Levels, Tilted, Value, tilted_by_quadrature};
use fewbits_core::{Cell, Columns, Error, Gaussian, RangeNoise};
use fewbits_numerics::error::{ArgumentError, finite};
use fewbits_numerics::kernels::{scalar, vectorised};
use fewbits_numerics::normal;
use fewbits_pf_mpa::{QuantizedRange, RangeReference};
use fewbits_quantizers::Symbol;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// The finite interval from which message passing draws for a received level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IntervalRule {
    /// The cell: `centre + half_width (q -+ Delta / 2)`.
    #[default]
    Correct,
    /// Equation 3.18 as printed, `centre (1 + q -+ Delta / 2)`: scaled by the range and not by its innovation (erratum `mpa-1`).
    Printed,
}

/// The likelihood of a report at the hypothesised distance `d`. The measurement is `z = d + v`, `v ~ N(0, sigma(d)^2)`.
#[derive(Debug, Clone, PartialEq)]
pub struct RangeFactor {
    noise: RangeNoise,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Value(f64),
    /// A level, and the interval from which message passing draws.
    Level(Levels, [f64; 2]),
}

impl RangeFactor {
    /// An unquantized range.
    ///
    /// # Errors
    /// If it is not finite.
    pub fn value(range: f64, noise: RangeNoise) -> Result<Self, ArgumentError> {
        let kind = Kind::Value(finite("range", range)?);
        Ok(Self { noise, kind })
    }

    /// A level that was received. Message passing draws from an interval by `rule`, and the reconstruction is its middle. The likelihood
    /// is that of the true cell.
    ///
    /// # Errors
    /// If there is no such level, the reference is not valid, or the interval is not one.
    pub fn level(
        scheme: &QuantizedRange,
        level: Symbol,
        reference: &RangeReference,
        rule: IntervalRule,
    ) -> Result<Self, ArgumentError> {
        let (levels, nominal) = (scheme.levels(), reference.nominal_cell(level.0, scheme.levels())?);
        let nominal = match rule {
            IntervalRule::Correct => [nominal.lower(), nominal.upper()],
            IntervalRule::Printed => [level.0, level.0 + 1].map(|q| reference.centre * 2.0 * q as f64 / levels as f64),
        };
        finite("nominal", nominal[0])?;
        finite("nominal", nominal[1])?;
        Cell::new(nominal[0], nominal[1])?;
        Ok(Self {
            noise: *scheme.noise(),
            kind: Kind::Level(scheme.received(level, reference)?, nominal),
        })
    }

    /// The noise of the range.
    pub fn noise(&self) -> &RangeNoise {
        &self.noise
    }

    /// The interval from which message passing draws; `None` of a value.
    pub fn nominal_cell(&self) -> Option<[f64; 2]> {
        match &self.kind {
            Kind::Level(_, nominal) => Some(*nominal),
            Kind::Value(_) => None,
        }
    }

    /// The observation as a value with an additional variance: the middle of the cell and `width^2 / 12`. `None` if a number is not finite.
    pub fn reconstruction(&self) -> Option<(f64, f64)> {
        let (mean, variance) = match &self.kind {
            Kind::Value(range) => (*range, 0.0),
            Kind::Level(_, [a, b]) => (0.5 * (a + b), (b - a) * (b - a) / 12.0),
        };
        (mean.is_finite() && variance.is_finite()).then_some((mean, variance))
    }
}

impl Factor<1> for RangeFactor {
    #[inline]
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        match &self.kind {
            Kind::Value(range) => {
                let deviation = self.noise.deviation(m[0]);
                normal::log_pdf((range - m[0]) / deviation) - deviation.ln()
            }
            Kind::Level(factor, _) => factor.log_likelihood(m),
        }
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        let range = match &self.kind {
            Kind::Value(range) => *range,
            Kind::Level(factor, _) => return factor.add_log_likelihoods(means, log_weights),
        };
        if !lengths_agree(means, log_weights) {
            return;
        }
        let noise = self.noise;
        vectorised(
            #[inline(always)]
            || {
                for (log_weight, d) in log_weights.iter_mut().zip(means[0]) {
                    let deviation = noise.deviation(*d);
                    let t = (range - d) / deviation;
                    *log_weight += -(0.5 * t * t + normal::LN_SQRT_2PI + scalar::ln(deviation));
                }
            },
        );
    }

    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        let range = match &self.kind {
            Kind::Value(range) => *range,
            Kind::Level(factor, _) => return factor.tilted(prior),
        };
        // Noise that does not depend on the distance has a closed form.
        if self.noise.relative() == 0.0 {
            let variance = self.noise.at_sensor() * self.noise.at_sensor();
            return Value::scalar(range, variance)?.tilted(prior);
        }
        // Noise that grows with the distance has a kink at distance zero.
        let width = self.noise.deviation(range);
        let features = [range, 0.0].map(|location| Feature { location, width });
        tilted_by_quadrature(prior, features, |d, logs| self.add_log_likelihoods(&[d], logs))
    }
}
