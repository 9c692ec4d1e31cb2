//! The scheme without compression: every measurement is sent as a number.

use crate::error::Error;
use crate::factor::{Constant, Scalar, Value};
use crate::measurement_noise::MeasurementNoise;
use crate::number::NumberFormat;
use crate::observation::{Link, Observation};
use crate::scheme::{Deterministic, Scheme};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive, within};
use nalgebra::{Matrix1, Vector1};
use rand::Rng;

/// A sensor that sends its scalar measurement as a number, by default in 64 bits. A Kalman filter receives such values.
///
/// There is no factor for a link that inverts bits: a value with inverted bits has no useful likelihood. Protect it by a checksum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FullValue {
    /// The likelihood of a value of 0.
    of_zero: Value<1>,
    format: NumberFormat,
}

impl FullValue {
    /// A sensor with this noise variance that sends 64-bit values.
    ///
    /// # Errors
    /// If the variance is not above 0.
    pub fn new(noise_variance: f64) -> Result<Self, ArgumentError> {
        Ok(Self {
            of_zero: Value::scalar(0.0, positive("noise_variance", noise_variance)?)?,
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
        *self.of_zero.noise_covariance()
    }
}

impl Deterministic<1> for FullValue {}

impl Scheme<1> for FullValue {
    type State = ();
    type Feedback = ();
    type Report = f64;
    type Factor = Scalar;

    fn feedback_format(&self) {}

    fn report_format(&self) -> NumberFormat {
        self.format
    }

    fn encode(&self, _: &mut dyn Rng, (): &mut (), measurement: &Vector1<f64>, (): &()) -> Result<Option<f64>, Error> {
        Ok(Some(self.format.rounded(finite("measurement", measurement[0])?)?))
    }

    #[inline]
    fn factor(&self, (): &(), observation: &Observation<f64>, link: &Link) -> Result<Scalar, Error> {
        let Observation::Received(value) = observation else {
            return Ok(Constant::of_delivery(observation, link).into());
        };
        // A value with inverted bits has no useful likelihood.
        within("crossover", link.crossover(), 0.0, 0.0)?;
        let value = self.of_zero.of_value([finite("report", *value)?].into());
        let log_arrival = match link.of_received()? {
            1.0 => 0.0,
            arrival => arrival.ln(),
        };
        Ok(value.times_exp(log_arrival)?.into())
    }
}
