//! Intervals ("cells") of the measurement axis.

use crate::sign::Sign;
use fewbits_numerics::error::{self, ArgumentError};
use fewbits_numerics::normal;
use serde::{Deserialize, Serialize};

/// A half-open interval `[lower, upper)` that is known to hold a measurement; either end may be infinite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Ends", into = "Ends")]
pub struct Cell {
    lower: f64,
    upper: f64,
}

#[cold]
#[inline(never)]
fn refused(lower: f64, upper: f64) -> ArgumentError {
    ArgumentError::new("cell", format!("[{lower}, {upper})"), "lower < upper")
}

impl Cell {
    /// The cell `[lower, upper)`.
    ///
    /// # Errors
    /// If `lower < upper` does not hold (NaN included).
    #[inline]
    pub fn new(lower: f64, upper: f64) -> Result<Self, ArgumentError> {
        if lower < upper {
            Ok(Self { lower, upper })
        } else {
            Err(refused(lower, upper))
        }
    }

    /// The half-line in which a measurement with this sign relative to `threshold` is: `[threshold, inf)` for `Above`.
    ///
    /// # Errors
    /// If the threshold is not finite.
    #[inline]
    pub(crate) fn of_sign(sign: Sign, threshold: f64) -> Result<Self, ArgumentError> {
        error::finite("threshold", threshold)?;
        match sign {
            Sign::Above => Self::new(threshold, f64::INFINITY),
            Sign::Below => Self::new(f64::NEG_INFINITY, threshold),
        }
    }

    /// Lower end, included.
    pub fn lower(&self) -> f64 {
        self.lower
    }

    /// Upper end, excluded.
    pub fn upper(&self) -> f64 {
        self.upper
    }

    /// Whether the cell holds `value`.
    pub fn contains(&self, value: f64) -> bool {
        self.lower <= value && value < self.upper
    }

    /// `ln P(mean + n in cell)` for noise `n ~ N(0, standard_deviation^2)`.
    #[inline]
    pub fn log_probability(&self, mean: f64, standard_deviation: f64) -> f64 {
        normal::log_interval((self.lower - mean) / standard_deviation, (self.upper - mean) / standard_deviation)
    }
}

/// The stored form. An infinite end is the text `inf` or `-inf` in JSON; where it was left out it is read too.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Ends {
    #[serde(default, with = "fewbits_numerics::stored")]
    lower: Option<f64>,
    #[serde(default, with = "fewbits_numerics::stored")]
    upper: Option<f64>,
}

impl From<Cell> for Ends {
    fn from(cell: Cell) -> Self {
        Self {
            lower: Some(cell.lower),
            upper: Some(cell.upper),
        }
    }
}

impl TryFrom<Ends> for Cell {
    type Error = ArgumentError;

    fn try_from(ends: Ends) -> Result<Self, ArgumentError> {
        Self::new(ends.lower.unwrap_or(f64::NEG_INFINITY), ends.upper.unwrap_or(f64::INFINITY))
    }
}
