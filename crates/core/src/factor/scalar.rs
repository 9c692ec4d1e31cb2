//! The likelihood of any observation of a scalar measurement.

use super::moments::Feature;
use super::{Factor, Levels, Tilted, Value};
use crate::columns::Columns;
use crate::error::Error;
use crate::gaussian::Gaussian;
use crate::observation::{Link, Observation};
use fewbits_numerics::error::ArgumentError;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// An observation whose probability is the same for every measurement: a loss, a random silence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Constant {
    probability: f64,
}

impl Constant {
    /// An observation of the given probability under every measurement. Zero makes it impossible.
    ///
    /// # Errors
    /// If `probability` is outside `[0, 1]`.
    pub fn new(probability: f64) -> Result<Self, ArgumentError> {
        fewbits_numerics::error::within("probability", probability, 0.0, 1.0)?;
        Ok(Self { probability })
    }

    /// The factor of a missing report of a sensor that always sends. Whether the loss was noticed (`Lost`) or not (`Nothing`), it does not
    /// depend on `m`.
    pub fn of_delivery<R>(observation: &Observation<R>, link: &Link) -> Self {
        Self {
            probability: link.delivery(observation),
        }
    }
}

impl<const M: usize> Factor<M> for Constant {
    fn log_likelihood(&self, _: &SVector<f64, M>) -> f64 {
        self.probability.ln()
    }

    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        Tilted::unchanged(prior, self.probability.ln())
    }

    fn location(&self) -> Option<SVector<f64, M>> {
        None
    }

    fn as_scalar(&self) -> Option<Scalar> {
        Some((*self).into())
    }
}

/// Any factor of a scalar measurement in Gaussian noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scalar {
    /// The measurement itself was observed.
    Value(Value<1>),
    /// A piecewise constant likelihood of the noisy measurement: cells, silence, symbols, losses.
    Levels(Levels),
}

impl Scalar {
    /// The places where the likelihood changes.
    pub(crate) fn features(&self) -> Vec<Feature> {
        match self {
            Self::Value(value) => vec![Feature {
                location: value.value()[0],
                width: value.noise_covariance()[0].sqrt(),
            }],
            Self::Levels(factor) => factor.features(),
        }
    }
}

macro_rules! delegate {
    ($self:expr, $factor:ident => $call:expr) => {
        match $self {
            Scalar::Value($factor) => $call,
            Scalar::Levels($factor) => $call,
        }
    };
}

impl Factor<1> for Scalar {
    #[inline]
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        delegate!(self, factor => factor.log_likelihood(m))
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        delegate!(self, factor => factor.add_log_likelihoods(means, log_weights));
    }

    #[inline]
    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        delegate!(self, factor => factor.tilted(prior))
    }

    fn location(&self) -> Option<SVector<f64, 1>> {
        middle(self.features().into_iter())
    }

    fn as_scalar(&self) -> Option<Scalar> {
        match self {
            Self::Value(value) => value.as_scalar(),
            Self::Levels(levels) => levels.as_scalar(),
        }
    }
}

/// The middle between the first and the last of the places where a likelihood changes.
pub(super) fn middle(features: impl Iterator<Item = Feature>) -> Option<SVector<f64, 1>> {
    let ends = features.fold(None, |ends: Option<(f64, f64)>, feature| {
        let (low, high) = ends.unwrap_or((feature.location, feature.location));
        Some((low.min(feature.location), high.max(feature.location)))
    });
    ends.map(|(low, high)| [0.5 * (low + high)].into())
}

impl From<Value<1>> for Scalar {
    fn from(factor: Value<1>) -> Self {
        Self::Value(factor)
    }
}

impl From<Levels> for Scalar {
    fn from(factor: Levels) -> Self {
        Self::Levels(factor)
    }
}

impl From<Constant> for Scalar {
    fn from(factor: Constant) -> Self {
        Self::Levels(Levels::of_probability(factor.probability))
    }
}
