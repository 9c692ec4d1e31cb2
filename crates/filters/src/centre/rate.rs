//! Whether the unlikely bits of a sensor come as often as they were predicted.

use serde::{Deserialize, Serialize};

/// Bits whose outcomes were unequally likely, over a whole run: Spiegelhalter's test of predicted probabilities (1986).
///
/// ```text
/// p = probability of the less likely outcome;   excess = sum (1 - 2 p) (it came - p);   variance = sum (1 - 2 p)^2 p (1 - p)
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Rate {
    #[serde(with = "fewbits_numerics::stored")]
    excess: f64,
    #[serde(with = "fewbits_numerics::stored")]
    variance: f64,
}

/// Below this variance few unlikely bits were expected, and their number is not normal.
const MIN_VARIANCE: f64 = 4.0;

impl Rate {
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Adds a bit. The square of its residual is the odds of the other outcome.
    pub(crate) fn add(&mut self, residual: f64) {
        let came = 1.0 / (1.0 + residual * residual);
        let unlikely = came.min(1.0 - came);
        let (weight, is_unlikely) = (1.0 - 2.0 * unlikely, f64::from(u8::from(came < 0.5)));
        self.excess += weight * (is_unlikely - unlikely);
        self.variance += weight * weight * unlikely * (1.0 - unlikely);
    }

    /// The excess in standard deviations.
    pub(crate) fn score(&self) -> Option<f64> {
        (self.variance >= MIN_VARIANCE).then(|| self.excess / self.variance.sqrt())
    }
}
