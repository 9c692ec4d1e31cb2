//! Readings that each state what they mean: a value with its own accuracy, a value that was rounded, a value beyond a detection limit.
//!
//! ```text
//! value v of deviation s               N(v; m, s^2)
//! rounded to a step, v                 P(v - step/2 <= m + noise < v + step/2) / step
//! unchanged                            P(lower <= m + noise < upper) / width
//! beyond a limit                       P(lower <= m + noise)
//! ```
//! All but half-lines are densities of the reading.

use fewbits_core::factor::{Constant, Levels, Scalar, Value};
use fewbits_core::rand::Rng;
use fewbits_core::{
    BitReader, BitWriter, Cell, CodecError, Deterministic, Error, Link, MeasurementNoise, Message, NumberFormat,
    Observation, Scheme,
};
use fewbits_numerics::error::{finite, positive, refuse};
use nalgebra::{Matrix1, Vector1, Vector3};

/// Numbers beyond these stand for infinite ends.
const INFINITE: f64 = 1e300;

/// One reading: the measurement lies between two ends, which are equal for a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StatedReading {
    /// Lower end, perhaps minus infinity.
    pub(crate) lower: f64,
    /// Upper end, perhaps infinity.
    pub(crate) upper: f64,
    /// Standard deviation of the measurement's noise, above zero.
    pub(crate) deviation: f64,
}

impl StatedReading {
    /// A value whose noise has this standard deviation.
    pub(crate) fn value(value: f64, deviation: f64) -> Self {
        Self {
            lower: value,
            upper: value,
            deviation,
        }
    }

    /// A value that was rounded to multiples of a step.
    pub(crate) fn rounded(value: f64, step: f64, deviation: f64) -> Self {
        Self {
            lower: value - 0.5 * step,
            upper: value + 0.5 * step,
            deviation,
        }
    }
}

impl StatedReading {
    /// Width of the cell; 1 if it is a half-line, 0 of a value.
    pub(crate) fn width(&self) -> f64 {
        let width = self.upper - self.lower;
        if width.is_finite() { width } else { 1.0 }
    }
}

impl Message for StatedReading {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        let end = |end: f64| end.clamp(-f64::MAX, f64::MAX);
        Vector3::new(end(self.lower), end(self.upper), self.deviation).encode(format, writer)
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let [lower, upper, deviation] = Vector3::decode(format, reader)?.into();
        Ok(Self {
            lower: if lower < -INFINITE { f64::NEG_INFINITY } else { lower },
            upper: if upper > INFINITE { f64::INFINITY } else { upper },
            deviation,
        })
    }
}

/// The scheme of a sensor whose readings state their meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stating {
    usual_variance: f64,
}

impl Stating {
    /// A sensor whose values usually have an error of this variance, rounding included. Of a reading it is used only to judge whether it is
    /// wild.
    ///
    /// # Errors
    /// If the variance is not above 0.
    pub(crate) fn new(usual_variance: f64) -> Result<Self, Error> {
        Ok(Self {
            usual_variance: positive("usual_variance", usual_variance)?,
        })
    }
}

impl MeasurementNoise<1> for Stating {
    fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(self.usual_variance)
    }
}

impl Deterministic<1> for Stating {}

impl Scheme<1> for Stating {
    type State = ();
    type Feedback = ();
    type Report = StatedReading;
    type Factor = Scalar;

    fn feedback_format(&self) {}

    fn report_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn encode(
        &self,
        _: &mut dyn Rng,
        (): &mut (),
        measurement: &Vector1<f64>,
        (): &(),
    ) -> Result<Option<StatedReading>, Error> {
        let value = finite("measurement", measurement[0])?;
        Ok(Some(StatedReading::value(value, self.usual_variance.sqrt())))
    }

    /// What a reading says, as a density.
    fn factor(&self, (): &(), observation: &Observation<StatedReading>, link: &Link) -> Result<Scalar, Error> {
        let Observation::Received(reading) = observation else {
            return Ok(Constant::of_delivery(observation, link).into());
        };
        let StatedReading {
            lower,
            upper,
            deviation,
        } = *reading;
        let variance = positive("deviation", deviation)?.powi(2);
        let arrival = link.of_received()?.ln();
        if lower == upper {
            let value = Value::scalar(finite("reading", lower)?, variance)?;
            return Ok(value.times_exp(arrival)?.into());
        }
        if lower.is_nan() || upper.is_nan() || lower > upper {
            return refuse("reading", format!("from {lower} to {upper}"), "ends in order");
        }
        // A half-line has no width: its reading is a probability.
        let density = arrival - reading.width().ln();
        Ok(Levels::certain(Cell::new(lower, upper)?, variance)?
            .times_exp(density)?
            .into())
    }
}
