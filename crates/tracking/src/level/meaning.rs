//! A sensor's seat, and what the cells of its column mean.

use crate::first::rounding;
use crate::level::report::Report;
use crate::level::stated::StatedReading;
use crate::rows::instant::Qualifier;
use fewbits_table::Side;

/// Model of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Seat {
    pub(crate) sends: Report,
    /// Standard deviation of its measurement noise.
    pub(crate) noise: f64,
    pub(crate) threshold: Option<f64>,
    /// Share of its reports that do not arrive.
    pub(crate) loss: f64,
    /// Offset that is subtracted from its measurements.
    pub(crate) offset: f64,
    pub(crate) meaning: Meaning,
}

/// What values mean beside a number with noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Meaning {
    /// They are rounded to multiples of this step.
    pub(crate) step: Option<f64>,
    /// An empty cell says that the measurement is within this of the last value.
    pub(crate) silent_within: Option<f64>,
    /// At or beyond these limits they say only that.
    pub(crate) limits: (Option<f64>, Option<f64>),
    /// Rows state the accuracy of their values.
    pub(crate) has_accuracy: bool,
    /// Cells may be limits.
    pub(crate) has_limits: bool,
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

impl Seat {
    /// Standard deviation of the error of a value, rounding included.
    pub(crate) fn usual(&self) -> f64 {
        self.noise.hypot(rounding::DEVIATION * self.meaning.step.unwrap_or(0.0))
    }

    /// Whether its reports are values that state their meaning.
    pub(crate) fn is_stated(&self) -> bool {
        self.sends == Report::Value && self.meaning.is_stated()
    }

    /// What a cell of its column says; `None` if nothing.
    pub(crate) fn reading(&self, cell: Option<f64>, qualifier: Qualifier, last: Option<f64>) -> Option<StatedReading> {
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
