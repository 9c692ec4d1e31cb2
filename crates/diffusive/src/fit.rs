//! Goodness of fit: whether the samples are what the model says they are.

use fewbits_numerics::normal::quantile;
use serde::{Deserialize, Serialize};

/// Sum of squared residuals over the noise variance, averaged over the posterior.
///
/// If the model is right, source and samples are one draw of the prior and the model, and a draw of the posterior has the same law
/// together with these samples. A single draw's sum is then chi-squared with one degree of freedom per sample, and the average over
/// the posterior has the same mean and less spread. Averaging over the posterior counts no parameters and needs no Gaussian belief.
///
/// Where a mixture of Gaussians was received, the distance of the position from it counts as two numbers more: its samples are gone, but
/// a belief that every node moves far is wrong. The squared distance from the nearest Gaussian, in its deviations, is no larger than
/// chi-squared with two degrees of freedom if belief and model are right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The sum. About `samples` if the model is right.
    pub chi_squared: f64,
    /// Number of samples, and two for every mixture that was received.
    pub samples: usize,
}

impl Fit {
    /// The sum per sample: about one if the model is right. Infinite without samples.
    pub fn per_sample(&self) -> f64 {
        if self.samples == 0 {
            f64::INFINITY
        } else {
            self.chi_squared / self.samples as f64
        }
    }

    /// Whether the sum is above the quantile that a chi-squared variable exceeds with probability `level` (Wilson and Hilferty 1931:
    /// its cube root is nearly normal, within one per cent of the quantile from five samples on).
    pub fn is_refused(&self, level: f64) -> bool {
        let spread = 2.0 / (9.0 * self.samples as f64);
        let limit = (1.0 - spread + quantile(1.0 - level) * spread.sqrt()).max(0.0).powi(3);
        // A sum that is not a number fits nothing.
        self.per_sample().is_nan() || self.per_sample() > limit
    }

    /// Both together.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        Self {
            chi_squared: self.chi_squared + other.chi_squared,
            samples: self.samples + other.samples,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of tables of the chi-squared distribution.
    #[test]
    fn refusal_is_at_the_chi_squared_quantile() {
        for (samples, level, quantile) in [
            (5, 0.01, 15.086),
            (10, 0.001, 29.588),
            (30, 0.001, 59.703),
            (100, 0.01, 135.807),
        ] {
            let at = |share: f64| Fit {
                chi_squared: share * quantile,
                samples,
            };
            assert!(at(1.01).is_refused(level) && !at(0.99).is_refused(level), "{samples} {level}");
        }
        assert!(
            Fit {
                chi_squared: f64::NAN,
                samples: 5
            }
            .is_refused(0.01)
        );
    }
}
