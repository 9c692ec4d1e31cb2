//! The unknown before anything is received.

use super::continuous::{Continuous, Shape, components};
use crate::error::Error;
use fewbits_numerics::error::entries;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// Prior of the scalar unknown, in any unit.
///
/// | the unknown is | constructor |
/// |---|---|
/// | normal | [`Prior::normal`] |
/// | uniform | [`Prior::uniform`] |
/// | known from measurements | [`Prior::sample`] |
/// | of any smooth density | [`Prior::density`] |
/// | in one of several states, each normal | [`Prior::mixture`] |
/// | one of finitely many values | [`Prior::discrete`], [`Prior::binary`] |
///
/// ```
/// use fewbits_quantizer_design::Prior;
/// let months = Prior::mixture(&[(0.7, 4.0, 3.0), (0.3, 19.0, 2.5)])?;
/// let ramp = Prior::density(|x| x, 0.0..=2.0)?;
/// assert!((months.mean() - 8.5).abs() < 1e-12 && (ramp.mean() - 4.0 / 3.0).abs() < 1e-12);
/// # Ok::<(), fewbits_quantizer_design::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredPrior", into = "StoredPrior")]
#[non_exhaustive]
pub enum Prior {
    /// Normal.
    #[non_exhaustive]
    Gaussian {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        deviation: f64,
    },
    /// Another density.
    Continuous(Continuous),
    /// Finitely many values, such as the hypotheses of a detection problem.
    #[non_exhaustive]
    Discrete {
        /// The values.
        values: Vec<f64>,
        /// Their probabilities.
        probabilities: Vec<f64>,
    },
}

/// The stored form of a prior.
#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum StoredPrior {
    Gaussian {
        #[serde(default)]
        mean: f64,
        deviation: f64,
    },
    Uniform {
        low: f64,
        high: f64,
    },
    Mixture {
        weights: Vec<f64>,
        means: Vec<f64>,
        deviations: Vec<f64>,
    },
    Sample {
        values: Vec<f64>,
    },
    Table {
        low: f64,
        high: f64,
        densities: Vec<f64>,
    },
    Discrete {
        values: Vec<f64>,
        probabilities: Vec<f64>,
    },
}

impl From<Prior> for StoredPrior {
    fn from(prior: Prior) -> Self {
        match prior {
            Prior::Gaussian { mean, deviation } => Self::Gaussian { mean, deviation },
            Prior::Discrete { values, probabilities } => Self::Discrete { values, probabilities },
            Prior::Continuous(density) => match density.shape {
                Shape::Uniform { low, high } => Self::Uniform { low, high },
                Shape::Mixture {
                    weights,
                    means,
                    deviations,
                } => Self::Mixture {
                    weights,
                    means,
                    deviations,
                },
                Shape::Sample { values, .. } => Self::Sample { values },
                Shape::Table { low, high, densities } => Self::Table { low, high, densities },
            },
        }
    }
}

impl TryFrom<StoredPrior> for Prior {
    type Error = Error;

    fn try_from(stored: StoredPrior) -> Result<Self, Error> {
        match stored {
            StoredPrior::Gaussian { mean, deviation } => Self::normal(mean, deviation),
            StoredPrior::Discrete { values, probabilities } => Self::discrete(values, probabilities),
            StoredPrior::Uniform { low, high } => Self::uniform(low, high),
            StoredPrior::Mixture {
                weights,
                means,
                deviations,
            } => Ok(Self::Continuous(Continuous::mixture(weights, means, deviations)?)),
            StoredPrior::Sample { values } => Self::sample(&values),
            StoredPrior::Table { low, high, densities } => {
                Ok(Self::Continuous(Continuous::table(low, high, densities)?))
            }
        }
    }
}

impl Prior {
    /// Normal with this mean and standard deviation.
    ///
    /// # Errors
    /// If `mean` is not finite or `deviation` is not a positive number.
    pub fn normal(mean: f64, deviation: f64) -> Result<Self, Error> {
        Ok(Self::Gaussian {
            mean: fewbits_numerics::error::finite("mean", mean)?,
            deviation: fewbits_numerics::error::positive("deviation", deviation)?,
        })
    }

    /// Normal with mean 0 and the given standard deviation.
    ///
    /// # Errors
    /// If `deviation` is not a positive number.
    pub fn gaussian_with_deviation(deviation: f64) -> Result<Self, Error> {
        Self::normal(0.0, deviation)
    }

    /// Uniform on `[low, high]`.
    ///
    /// # Errors
    /// If an end is not finite or `low >= high`.
    pub fn uniform(low: f64, high: f64) -> Result<Self, Error> {
        Ok(Self::Continuous(Continuous::uniform(low, high)?))
    }

    /// The smooth density of a sample: a normal bell at every value, of a width that shrinks with their number (Silverman), drawn
    /// together so that mean and variance are the sample's. [`Prior::sample_fit`](Self::sample_fit) says how large the errors are.
    ///
    /// # Errors
    /// If there are fewer than five values, one is not finite, or all are equal.
    pub fn sample(values: &[f64]) -> Result<Self, Error> {
        Ok(Self::Continuous(Continuous::sample(values)?))
    }

    /// The density proportional to `density` on the interval `support`.
    ///
    /// The function is evaluated at once, at some thousand places, and stored as a table.
    ///
    /// # Errors
    /// If the interval is empty or not finite, or the function is negative, not finite, zero, or not smooth: its integral by 64
    /// panels differs from that by 32 panels by more than 1e-6.
    pub fn density(density: impl Fn(f64) -> f64, support: RangeInclusive<f64>) -> Result<Self, Error> {
        Ok(Self::Continuous(Continuous::function(density, *support.start(), *support.end())?))
    }

    /// A mixture of normal densities, each given as `(weight, mean, standard deviation)`.
    ///
    /// # Errors
    /// If there is none, the weights are negative or do not sum to 1 within 1e-9, a mean is not finite or a deviation not positive.
    pub fn mixture(parts: &[(f64, f64, f64)]) -> Result<Self, Error> {
        let [weights, means, deviations] = components(parts)?;
        Ok(Self::Continuous(Continuous::mixture(weights, means, deviations)?))
    }

    /// How well the smooth density of a sample stands for the sample and the sample for its source; `None` for other priors.
    pub fn sample_fit(&self) -> Option<&super::SampleFit> {
        match self {
            Self::Continuous(density) => density.sample_fit(),
            _ => None,
        }
    }

    /// Finitely many values with probabilities: hypotheses, or the nodes and weights of a quadrature rule for a density. Which of
    /// the two it is the caller says by the criterion.
    ///
    /// # Errors
    /// If the lengths differ, a value is not finite, or the probabilities are negative or do not sum to 1 within 1e-9.
    pub fn discrete(values: Vec<f64>, probabilities: Vec<f64>) -> Result<Self, Error> {
        fewbits_numerics::error::all_finite("values", &values)?;
        fewbits_numerics::error::probabilities("probabilities", &probabilities)?;
        entries("values", values.len(), probabilities.len())?;
        Ok(Self::Discrete { values, probabilities })
    }

    /// The two hypotheses 0 and `signal`, the latter with probability `probability`.
    ///
    /// # Errors
    /// If `signal` is not finite or `probability` not in `[0, 1]`.
    pub fn binary(signal: f64, probability: f64) -> Result<Self, Error> {
        fewbits_numerics::error::within("probability", probability, 0.0, 1.0)?;
        Self::discrete(vec![0.0, signal], vec![1.0 - probability, probability])
    }

    /// The prior of `X + offset`.
    pub(crate) fn shifted(&self, offset: f64) -> Result<Self, Error> {
        match self {
            Self::Gaussian { mean, deviation } => Self::normal(mean + offset, *deviation),
            Self::Continuous(density) => Ok(Self::Continuous(density.shifted(offset)?)),
            Self::Discrete { values, probabilities } => {
                Self::discrete(values.iter().map(|x| x + offset).collect(), probabilities.clone())
            }
        }
    }

    /// The prior of `factor * X`.
    pub(crate) fn rescaled(&self, factor: f64) -> Result<Self, Error> {
        match self {
            Self::Gaussian { mean, deviation } => Self::normal(factor * mean, factor * deviation),
            Self::Continuous(density) => Ok(Self::Continuous(density.rescaled(factor)?)),
            Self::Discrete { values, probabilities } => {
                Self::discrete(values.iter().map(|x| factor * x).collect(), probabilities.clone())
            }
        }
    }

    /// Mean of the unknown.
    pub fn mean(&self) -> f64 {
        match self {
            Self::Gaussian { mean, .. } => *mean,
            Self::Continuous(density) => density.mean(),
            Self::Discrete { values, probabilities } => {
                // About the first value, so that an offset shared by all costs no digit.
                let first = values.first().copied().unwrap_or(0.0);
                let total: f64 = probabilities.iter().sum();
                first
                    + values
                        .iter()
                        .zip(probabilities)
                        .map(|(x, p)| p * (x - first))
                        .sum::<f64>()
                        / total
            }
        }
    }

    /// Standard deviation of the unknown.
    pub fn deviation(&self) -> f64 {
        match self {
            Self::Gaussian { deviation, .. } => *deviation,
            Self::Continuous(density) => density.deviation(),
            Self::Discrete { values, probabilities } => {
                let mean = self.mean();
                values
                    .iter()
                    .zip(probabilities)
                    .map(|(x, p)| p * (x - mean) * (x - mean))
                    .sum::<f64>()
                    .sqrt()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_priors_are_those_of_their_formulas() {
        let cases = [
            (Prior::uniform(2.0, 5.0).unwrap(), 3.5, 0.75_f64.sqrt()),
            (Prior::density(|x| (-x).exp(), 0.0..=40.0).unwrap(), 1.0, 1.0),
            (Prior::mixture(&[(0.5, -1.0, 0.5), (0.5, 1.0, 0.5)]).unwrap(), 0.0, 1.25_f64.sqrt()),
        ];
        for (prior, mean, deviation) in cases {
            assert!((prior.mean() - mean).abs() < 1e-11 && (prior.deviation() - deviation).abs() < 1e-11, "{prior:?}");
            let json = serde_json::to_string(&prior).unwrap();
            let again: Prior = serde_json::from_str(&json).unwrap();
            assert!((again.mean() - mean).abs() < 1e-11);
        }
    }

    #[test]
    fn a_sample_keeps_its_mean_and_variance() {
        let values: Vec<f64> = (0..5000)
            .map(|i| 3.0 + 2.0 * fewbits_numerics::normal::quantile((f64::from(i) + 0.5) / 5000.0))
            .collect();
        let prior = Prior::sample(&values).unwrap();
        assert!((prior.mean() - 3.0).abs() < 1e-10 && (prior.deviation() - 2.0).abs() < 2e-3);
        let fit = prior.sample_fit().unwrap();
        // Smoothing changes less than the sample leaves open.
        assert!(fit.smoothing_error < fit.sampling_error && (fit.sampling_error - 0.0192).abs() < 1e-4);
        assert!((fit.deviation_standard_error / (2.0 / 1e4_f64.sqrt()) - 1.0).abs() < 0.01);
        assert!(Prior::sample(&[1.0; 10]).is_err() && Prior::sample(&[1.0, 2.0]).is_err());
    }

    #[test]
    fn rough_or_negative_densities_are_refused() {
        assert!(Prior::density(|x| x, -1.0..=1.0).is_err());
        assert!(Prior::density(|x| if x < 0.123 { 0.0 } else { 1.0 }, 0.0..=1.0).is_err());
        assert!(Prior::density(|_| f64::NAN, 0.0..=1.0).is_err());
        assert!(Prior::density(|_| 1.0, 1.0..=0.0).is_err());
        assert!(Prior::mixture(&[]).is_err() && Prior::mixture(&[(0.5, 0.0, 1.0)]).is_err());
    }
}
