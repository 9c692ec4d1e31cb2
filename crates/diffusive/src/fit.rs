//! Goodness of fit: whether the samples are consistent with the model.

use fewbits_numerics::normal::quantile;
use serde::{Deserialize, Serialize};

/// Sum of squared residuals over the noise variance, averaged over the posterior.
///
/// If the model is right, a draw of the posterior has, together with these samples, the same distribution as the true source. The sum
/// for one draw is then chi-squared with one degree of freedom per sample. Its average over the posterior has the same mean and a
/// smaller variance. No number of fitted parameters and no Gaussian belief is needed.
///
/// If a mixture of Gaussians was received, the distance of the position from it counts as two samples more: the samples behind the
/// mixture are not available, but a belief that every node moves far is wrong. If belief and model are right, the squared distance from
/// the nearest Gaussian, in its standard deviations, is at most chi-squared with two degrees of freedom.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Sum of squared residuals over the noise variance. It is about `samples` if the model is right.
    pub chi_squared: f64,
    /// Number of samples, plus two for every mixture that was received.
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

    /// Whether the sum exceeds the quantile that a chi-squared variable exceeds with probability `level`. The quantile is that of Wilson
    /// and Hilferty (1931): the cube root is nearly normal. From five samples on it is accurate to one per cent.
    pub(crate) fn is_refused(&self, level: f64) -> bool {
        let spread = 2.0 / (9.0 * self.samples as f64);
        let limit = (1.0 - spread + quantile(1.0 - level) * spread.sqrt()).max(0.0).powi(3);
        // A sum that is NaN counts as refused.
        self.per_sample().is_nan() || self.per_sample() > limit
    }

    /// The sum of two fits.
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
