//! A sensor's seat, and what the cells of its column mean.

use super::instant::Qualifier;
use crate::error::Error;
use crate::numbers::above_zero;
use crate::report::Report;
use fewbits_recipes::rounding;
use fewbits_recipes::stated::StatedReading;
use fewbits_table::Side;

/// Model of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seat {
    pub(super) sends: Report,
    /// Standard deviation of its measurement noise.
    pub(super) noise: f64,
    pub(super) threshold: Option<f64>,
    /// Share of its reports that do not arrive.
    pub(super) loss: f64,
    /// Offset that is subtracted from its measurements.
    pub(super) offset: f64,
    pub(super) meaning: Meaning,
}

/// What values mean beside a number with noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Meaning {
    /// They are rounded to multiples of this step.
    pub(super) step: Option<f64>,
    /// An empty cell says that the measurement is within this of the last value.
    pub(super) silent_within: Option<f64>,
    /// At or beyond these limits they say only that.
    pub(super) limits: (Option<f64>, Option<f64>),
    /// Rows state the accuracy of their values.
    pub(super) has_accuracy: bool,
    /// Cells may be limits.
    pub(super) has_limits: bool,
}

impl Meaning {
    fn is_stated(&self) -> bool {
        self.step.is_some()
            || self.silent_within.is_some()
            || self.has_accuracy
            || self.has_limits
            || self.limits.0.is_some()
            || self.limits.1.is_some()
    }
}

/// The width of silence, and the seconds between two of the sensor's measurements if they are said: `0.5`, `0.5/60s`.
pub(super) fn silence(text: &str) -> Result<(f64, Option<f64>), Error> {
    const EXPECTED: &str = "a width above 0, or also how often the sensor measures, as `0.5/60s`";
    let (width, time) = match text.split_once('/') {
        Some((width, time)) => (width, Some(time)),
        None => (text, None),
    };
    let refused = || Error::option("--silent-within", text, EXPECTED);
    let seconds = time
        .map(|time| humantime::parse_duration(time).map_err(|_| refused()))
        .transpose()?
        .map(|time| time.as_secs_f64());
    if seconds.is_some_and(|seconds| seconds <= 0.0) {
        return Err(refused());
    }
    Ok((above_zero("--silent-within", width, EXPECTED)?, seconds))
}

impl Seat {
    /// Standard deviation of the error of a value, rounding included.
    pub(super) fn usual(&self) -> f64 {
        self.noise.hypot(rounding::DEVIATION * self.meaning.step.unwrap_or(0.0))
    }

    /// Whether its reports are values that state their meaning.
    pub(super) fn is_stated(&self) -> bool {
        self.sends == Report::Value && self.meaning.is_stated()
    }

    /// What a cell of its column says; `None` if nothing.
    pub(super) fn reading(&self, cell: Option<f64>, qualifier: Qualifier, last: Option<f64>) -> Option<StatedReading> {
        let Some(value) = cell else {
            let (last, within) = (last?, self.meaning.silent_within?);
            return Some(StatedReading {
                lower: last - within,
                upper: last + within,
                deviation: self.noise,
            });
        };
        let deviation = qualifier
            .accuracy
            .filter(|accuracy| *accuracy > 0.0)
            .unwrap_or(self.noise);
        let mut reading = match self.meaning.step {
            Some(step) => StatedReading::rounded(value, step, deviation),
            None => StatedReading::value(value, deviation),
        };
        let (least, most) = self.meaning.limits;
        if let Some(least) = least.map(|least| least - self.offset).filter(|least| value <= *least) {
            (reading.lower, reading.upper) = (f64::NEG_INFINITY, least);
        }
        if let Some(most) = most.map(|most| most - self.offset).filter(|most| value >= *most) {
            (reading.lower, reading.upper) = (most, f64::INFINITY);
        }
        match qualifier.limit {
            Some(Side::Below) => (reading.lower, reading.upper) = (f64::NEG_INFINITY, value),
            Some(Side::Above) => (reading.lower, reading.upper) = (value, f64::INFINITY),
            None => {}
        }
        Some(reading)
    }
}
