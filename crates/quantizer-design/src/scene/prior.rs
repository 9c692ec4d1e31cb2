//! The unknown before anything is received.

use crate::error::{Error, refuse};
use serde::{Deserialize, Serialize};

/// Prior of the scalar unknown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredPrior", into = "StoredPrior")]
pub enum Prior {
    /// Normal with mean 0 and the given standard deviation.
    #[non_exhaustive]
    Gaussian {
        /// Standard deviation.
        deviation: f64,
    },
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
    Gaussian { deviation: f64 },
    Discrete { values: Vec<f64>, probabilities: Vec<f64> },
}

impl From<Prior> for StoredPrior {
    fn from(prior: Prior) -> Self {
        match prior {
            Prior::Gaussian { deviation } => Self::Gaussian { deviation },
            Prior::Discrete { values, probabilities } => Self::Discrete { values, probabilities },
        }
    }
}

impl TryFrom<StoredPrior> for Prior {
    type Error = Error;

    fn try_from(stored: StoredPrior) -> Result<Self, Error> {
        match stored {
            StoredPrior::Gaussian { deviation } => Self::gaussian_with_deviation(deviation),
            StoredPrior::Discrete { values, probabilities } => Self::discrete(values, probabilities),
        }
    }
}

impl Prior {
    /// Normal prior with mean 0 and the given standard deviation.
    ///
    /// # Errors
    /// If `deviation` is not a positive number.
    pub fn gaussian_with_deviation(deviation: f64) -> Result<Self, Error> {
        Ok(Self::Gaussian {
            deviation: fewbits_numerics::error::positive("deviation", deviation)?,
        })
    }

    /// Finitely many values with probabilities, or the nodes and weights of a quadrature rule for a density.
    ///
    /// # Errors
    /// If the lengths differ, a value is not finite, or the probabilities are negative or do not sum to 1 within 1e-9.
    pub fn discrete(values: Vec<f64>, probabilities: Vec<f64>) -> Result<Self, Error> {
        fewbits_numerics::error::all_finite("values", &values)?;
        fewbits_numerics::error::probabilities("probabilities", &probabilities)?;
        if values.len() != probabilities.len() {
            return refuse("values", format!("{} values", values.len()), format!("{} values", probabilities.len()));
        }
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

    /// The prior of `factor * X`.
    pub(super) fn rescaled(&self, factor: f64) -> Result<Self, Error> {
        match self {
            Self::Gaussian { deviation } => Self::gaussian_with_deviation(factor * deviation),
            Self::Discrete { values, probabilities } => {
                Self::discrete(values.iter().map(|x| factor * x).collect(), probabilities.clone())
            }
        }
    }

    pub(super) fn mean(&self) -> f64 {
        match self {
            Self::Gaussian { .. } => 0.0,
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

    pub(super) fn spread(&self) -> f64 {
        match self {
            Self::Gaussian { deviation } => *deviation,
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
