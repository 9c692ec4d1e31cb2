//! Beliefs that nodes send to each other (other than raw records), and the prior of an update.

use crate::added_density::AddedDensity;
use crate::rate::RateRange;
use crate::search_box::{SearchBox, bounds};
use fewbits_core::Gaussian;
use fewbits_densities::Mixture;
use nalgebra::SVector;
use std::sync::Arc;

/// A belief that is sent to the next node, other than raw records.
#[derive(Debug, Clone)]
pub enum SentBelief<const D: usize> {
    /// A Gaussian mixture.
    Mixture(Mixture<D>),
    /// A density of [`Form::Other`](crate::Form::Other).
    Other(Arc<dyn AddedDensity<D>>),
}

impl<const D: usize> PartialEq for SentBelief<D> {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Mixture(own), Self::Mixture(other)) => own == other,
            (Self::Other(own), Self::Other(other)) => own.numbers() == other.numbers(),
            _ => false,
        }
    }
}

/// Prior of an update over cells.
#[derive(Debug, Clone, PartialEq)]
pub enum Prior {
    /// A position prior; the likelihood holds all records. Nothing is approximated.
    Exact(Gaussian<2>),
    /// A belief of the position, received from the node before.
    Position(SentBelief<2>),
    /// A belief of position and rate, received from the node before, and the range of the rate.
    WithRate(SentBelief<3>, RateRange),
}

impl<const D: usize> SentBelief<D> {
    pub(crate) fn bounds(&self) -> SearchBox {
        match self {
            Self::Mixture(mixture) => bounds(mixture.components()),
            Self::Other(density) => density.bounds(),
        }
    }

    /// Mean and covariance.
    pub(crate) fn gaussian(&self) -> Gaussian<D> {
        match self {
            Self::Mixture(mixture) => mixture.moment_matched(),
            Self::Other(density) => density.gaussian(),
        }
    }

    /// Log density.
    pub fn log_density(&self, x: &SVector<f64, D>) -> f64 {
        match self {
            Self::Mixture(mixture) => mixture.log_pdf(x),
            Self::Other(density) => density.log_density(x),
        }
    }
}

impl SentBelief<3> {
    /// Mean and covariance of the position.
    pub fn position(&self) -> Gaussian<2> {
        let both = self.gaussian();
        Gaussian::from_trusted_parts(both.mean().xy(), both.covariance().fixed_view::<2, 2>(0, 0).into_owned())
    }
}

/// A belief in a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Travelling {
    /// A belief about the position.
    Position(SentBelief<2>),
    /// A belief about position and rate.
    WithRate(SentBelief<3>),
}

impl Travelling {
    /// Mean and covariance of the position.
    pub fn gaussian(&self) -> Gaussian<2> {
        match self {
            Self::Position(belief) => belief.gaussian(),
            Self::WithRate(belief) => belief.position(),
        }
    }
}
