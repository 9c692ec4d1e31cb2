//! The likelihood of any observation of a scalar measurement.

use super::moments::Feature;
use super::{Factor, InCell, Partition, Tilted, Value};
use crate::cell::Cell;
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
    #[serde(with = "fewbits_numerics::stored")]
    probability: f64,
}

impl Constant {
    /// An observation that carries no information, of probability 1.
    pub const ONE: Self = Self { probability: 1.0 };

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

    /// The probability of the observation.
    pub fn probability(&self) -> f64 {
        self.probability
    }
}

impl<const M: usize> Factor<M> for Constant {
    fn log_likelihood(&self, _: &SVector<f64, M>) -> f64 {
        self.probability.ln()
    }

    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        Tilted::unchanged(prior, self.probability.ln())
    }

    fn as_scalar(&self) -> Option<(Scalar, f64)> {
        Some(((*self).into(), 0.0))
    }
}

/// Any factor of a scalar measurement in Gaussian noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Scalar {
    /// The measurement itself was observed.
    Value(Value<1>),
    /// The measurement is in a cell.
    InCell(InCell),
    /// Each cell of a partition has a probability.
    Partition(Partition),
    /// The observation does not depend on the measurement.
    Constant(Constant),
}

impl Scalar {
    /// `p(observation | m) = p P(m + n outside cell)`: a known loss from a sensor that is silent if and only if its measurement lies
    /// in `cell`, with `p` the link's [`lost_given_sent`](crate::Link::lost_given_sent). Impossible if `cell` is the whole line.
    ///
    /// # Errors
    /// If `r` is not positive or `p` is outside `(0, 1]`.
    pub fn outside(cell: &Cell, noise_variance: f64, p: f64) -> Result<Self, ArgumentError> {
        let lower = (cell.lower() > f64::NEG_INFINITY).then_some(cell.lower());
        let upper = (cell.upper() < f64::INFINITY).then_some(cell.upper());
        let (edges, given_cell) = match (lower, upper) {
            (None, None) => return Ok(Constant::new(0.0)?.into()),
            (Some(lower), None) => (vec![lower], vec![p, 0.0]),
            (None, Some(upper)) => (vec![upper], vec![0.0, p]),
            (Some(lower), Some(upper)) => (vec![lower, upper], vec![p, 0.0, p]),
        };
        Ok(Partition::new(edges, given_cell, noise_variance)?.into())
    }

    /// `p(observation | measurement)` as a piecewise constant function of the noisy measurement: cells with their
    /// probabilities, those of probability zero left out. Empty for a [`Value`], which is a point.
    pub fn pieces(&self) -> Vec<(Cell, f64)> {
        let whole = (f64::NEG_INFINITY, f64::INFINITY);
        let (edges, shares) = match self {
            Self::Value(_) => return Vec::new(),
            Self::Constant(factor) => (vec![whole.0, whole.1], vec![factor.probability]),
            Self::InCell(factor) => (
                vec![whole.0, factor.cell().lower(), factor.cell().upper(), whole.1],
                vec![factor.floor(), factor.floor() + factor.share(), factor.floor()],
            ),
            Self::Partition(factor) => (
                [whole.0]
                    .into_iter()
                    .chain(factor.edges().iter().copied())
                    .chain([whole.1])
                    .collect(),
                factor.given_cell().to_vec(),
            ),
        };
        // Cells that cannot have caused the observation are left out.
        let ends = edges.windows(2).map(|pair| Cell::new(pair[0], pair[1]));
        ends.zip(shares)
            .filter_map(|(cell, p)| Some((cell.ok()?, p)))
            .filter(|(_, p)| *p > 0.0)
            .collect()
    }

    /// The places where the likelihood changes.
    pub(crate) fn features(&self) -> Vec<Feature> {
        match self {
            Self::Value(value) => vec![Feature {
                location: value.value()[0],
                width: value.noise_covariance()[0].sqrt(),
            }],
            Self::InCell(factor) => [factor.cell().lower(), factor.cell().upper()]
                .into_iter()
                .filter(|edge| edge.is_finite())
                .map(|location| Feature {
                    location,
                    width: factor.noise_variance().sqrt(),
                })
                .collect(),
            Self::Partition(factor) => factor.features().collect(),
            Self::Constant(_) => Vec::new(),
        }
    }
}

macro_rules! delegate {
    ($self:expr, $factor:ident => $call:expr) => {
        match $self {
            Scalar::Value($factor) => $call,
            Scalar::InCell($factor) => $call,
            Scalar::Partition($factor) => $call,
            Scalar::Constant($factor) => $call,
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

    fn as_scalar(&self) -> Option<(Scalar, f64)> {
        Some((self.clone(), 0.0))
    }
}

macro_rules! from {
    ($($factor:ty => $kind:ident),+) => {$(
        impl From<$factor> for Scalar {
            fn from(factor: $factor) -> Self {
                Self::$kind(factor)
            }
        }
    )+};
}

from!(Value<1> => Value, InCell => InCell, Partition => Partition, Constant => Constant);
