//! The scheme without compression: every measurement is sent as a number.

use crate::error::Error;
use crate::factor::{Constant, Factor, Scalar, Tilted, Value};
use crate::gaussian::Gaussian;
use crate::measurement_noise::MeasurementNoise;
use crate::number::NumberFormat;
use crate::observation::{Link, Observation};
use crate::scheme::{Deterministic, Scheme};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive, within};
use nalgebra::{Matrix1, SVector, Vector1};
use rand::Rng;

/// A sensor that sends its scalar measurement as a number, by default in 64 bits. A Kalman filter receives such values.
///
/// There is no factor for a link that inverts bits: a value with inverted bits has no useful likelihood. Protect it by a checksum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FullValue {
    noise_variance: f64,
    format: NumberFormat,
}

/// The factor of a sensor that always sends its value: a [`Value`] times the probability of arrival, or a constant if nothing arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SentValue {
    value: Option<Value<1>>,
    log_probability: f64,
}

impl FullValue {
    /// A sensor with this noise variance that sends 64-bit values.
    ///
    /// # Errors
    /// If the variance is not above 0.
    pub fn new(noise_variance: f64) -> Result<Self, ArgumentError> {
        Ok(Self {
            noise_variance: positive("noise_variance", noise_variance)?,
            format: NumberFormat::Double,
        })
    }

    /// The same sensor with values rounded to `format`.
    #[must_use]
    pub fn with_format(self, format: NumberFormat) -> Self {
        Self { format, ..self }
    }
}

impl MeasurementNoise<1> for FullValue {
    fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(self.noise_variance)
    }
}

impl Factor<1> for SentValue {
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.log_probability + self.value.map_or(0.0, |value| value.log_likelihood(m))
    }

    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        let Some(value) = self.value else {
            return Tilted::unchanged(prior, self.log_probability);
        };
        // The probability of arrival multiplies the evidence and does not depend on `m`.
        let own = value.tilted(prior)?;
        Ok(Tilted {
            log_evidence: own.log_evidence + self.log_probability,
            ..own
        })
    }

    fn as_scalar(&self) -> Option<(Scalar, f64)> {
        Some((self.value.map_or(Constant::ONE.into(), Scalar::from), self.log_probability))
    }
}

impl Deterministic<1> for FullValue {}

impl Scheme<1> for FullValue {
    type State = ();
    type Feedback = ();
    type Report = f64;
    type Factor = SentValue;

    fn feedback_format(&self) {}

    fn report_format(&self) -> NumberFormat {
        self.format
    }

    fn encode(&self, _: &mut dyn Rng, (): &mut (), measurement: &Vector1<f64>, (): &()) -> Result<Option<f64>, Error> {
        Ok(Some(self.format.rounded(finite("measurement", measurement[0])?)?))
    }

    fn factor(&self, (): &(), observation: &Observation<f64>, link: &Link) -> Result<SentValue, Error> {
        let (value, probability) = match observation {
            Observation::Received(value) => {
                // A value with inverted bits has no useful likelihood.
                within("crossover", link.crossover(), 0.0, 0.0)?;
                finite("report", *value)?;
                (Some(Value::scalar(*value, self.noise_variance)?), link.of_received()?)
            }
            Observation::Nothing | Observation::Lost => (None, link.delivery(observation)),
        };
        Ok(SentValue {
            value,
            log_probability: probability.ln(),
        })
    }
}
