//! A simulated number and its standard error, as one cell of a row.

use fewbits_monte_carlo::Moments;
use serde::{Deserialize, Serialize};
use std::ops::Sub;

/// A simulated number and its standard error: two columns (`mse`, `mse_se`) of a table, one mark with its error bar in a plot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The estimate.
    pub value: f64,
    /// Its standard error; none from a single trial.
    pub standard_error: Option<f64>,
}

impl Measured {
    /// An estimate and its standard error, if it has one.
    pub fn new(value: f64, standard_error: impl Into<Option<f64>>) -> Self {
        let standard_error = standard_error.into();
        Self { value, standard_error }
    }

    /// The root of the mean: an RMSE from squared errors.
    pub fn root_mean(moments: &Moments) -> Self {
        let root = moments.root_mean();
        Self::new(root.value, (moments.count() > 1).then_some(root.standard_error))
    }

    /// The standard error; 0 without one.
    pub fn error(self) -> f64 {
        self.standard_error.unwrap_or(0.0)
    }

    /// The same in another unit, or against a reference without error.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self::new(self.value * factor, self.standard_error.map(|s| s * factor.abs()))
    }

    /// Deviation from `expected` in standard errors; none without a standard error.
    pub fn z_score(self, expected: f64) -> Option<f64> {
        let deviation = self.value - expected;
        if deviation == 0.0 {
            return Some(0.0);
        }
        self.standard_error.map(|error| deviation / error)
    }
}

/// The mean of what was added.
impl From<Moments> for Measured {
    fn from(moments: Moments) -> Self {
        Self::new(moments.mean(), (moments.count() > 1).then(|| moments.standard_error()))
    }
}

/// The mean of the numbers.
impl FromIterator<f64> for Measured {
    fn from_iter<I: IntoIterator<Item = f64>>(numbers: I) -> Self {
        numbers.into_iter().collect::<Moments>().into()
    }
}

/// The estimate less an exact number.
impl Sub<f64> for Measured {
    type Output = Self;

    fn sub(self, exact: f64) -> Self {
        Self::new(self.value - exact, self.standard_error)
    }
}

impl From<Measured> for Option<f64> {
    fn from(measured: Measured) -> Self {
        Some(measured.value)
    }
}

/// A mark with an error bar of one standard error.
impl fewbits_plot::Mark for Measured {
    fn mark(&self) -> Option<(f64, f64)> {
        Some((self.value, self.error()))
    }
}
