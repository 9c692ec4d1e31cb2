//! Beliefs that nodes send to each other (other than raw records), and the prior of an update.

use crate::density::Lpg;
use crate::rate::RateRange;
use fewbits_core::{Belief, Density, Gaussian};
use fewbits_densities::{Component, Mixture};
use nalgebra::SVector;

/// Half width, in standard deviations, of the box that is taken to contain a Gaussian.
const ENDS: f64 = 6.5;
/// A Gaussian times a polynomial is wider: its box is that of a Gaussian with this many times the variance.
const LPG_REACH: f64 = 1.7;

/// Box that contains the source, m. The first cells cover it; later cells are limited to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchBox {
    /// Lower corner.
    pub lower: [f64; 2],
    /// Upper corner.
    pub upper: [f64; 2],
}

impl SearchBox {
    /// The intersection with another box. If it is empty, the corner of the other box that is nearest.
    pub(crate) fn within(&self, other: &Self) -> Self {
        let lower: [f64; 2] = std::array::from_fn(|d| self.lower[d].max(other.lower[d]));
        let upper: [f64; 2] = std::array::from_fn(|d| self.upper[d].min(other.upper[d]));
        if lower[0] < upper[0] && lower[1] < upper[1] {
            Self { lower, upper }
        } else {
            *other
        }
    }
}

/// A belief that is sent to the next node, other than raw records.
#[derive(Debug, Clone, PartialEq)]
pub enum SentBelief<const D: usize> {
    /// A Gaussian mixture.
    Mixture(Mixture<D>),
    /// Polynomial Gaussians.
    Lpg(Lpg<D>),
}

/// A belief about the position.
pub type PositionBelief = SentBelief<2>;

/// A belief about position and rate.
pub type JointBelief = SentBelief<3>;

/// Prior of an update over cells.
#[derive(Debug, Clone, PartialEq)]
pub enum Prior {
    /// A position prior; the likelihood holds all records. Nothing is approximated.
    Exact(Gaussian<2>),
    /// A belief of the position, received from the node before.
    Position(PositionBelief),
    /// A belief of position and rate, received from the node before, and the range of the rate.
    WithRate(JointBelief, RateRange),
}

/// The box of the first two coordinates of all Gaussians. Their variances are multiplied by `widening`.
fn bounds<'a, const D: usize>(parts: impl Iterator<Item = &'a Component<D>>, widening: f64) -> SearchBox {
    let mut hull = SearchBox {
        lower: [f64::INFINITY; 2],
        upper: [f64::NEG_INFINITY; 2],
    };
    for part in parts {
        for d in 0..2 {
            let reach = ENDS * (widening * part.covariance()[(d, d)]).sqrt();
            hull.lower[d] = hull.lower[d].min(part.mean()[d] - reach);
            hull.upper[d] = hull.upper[d].max(part.mean()[d] + reach);
        }
    }
    hull
}

impl<const D: usize> SentBelief<D> {
    pub(crate) fn bounds(&self) -> SearchBox {
        match self {
            Self::Mixture(mixture) => bounds(mixture.components().iter(), 1.0),
            Self::Lpg(lpg) => bounds(lpg.gaussians(), LPG_REACH),
        }
    }

    /// Mean and covariance.
    pub fn gaussian(&self) -> Gaussian<D> {
        match self {
            Self::Mixture(mixture) => mixture.moment_matched(),
            Self::Lpg(lpg) => Gaussian::from_trusted_parts(lpg.mean(), lpg.covariance()),
        }
    }

    /// Log density.
    pub fn log_density(&self, x: &SVector<f64, D>) -> f64 {
        match self {
            Self::Mixture(mixture) => mixture.log_pdf(x),
            Self::Lpg(lpg) => lpg.log_density(x),
        }
    }
}

impl JointBelief {
    /// Mean and covariance of the position.
    pub fn position(&self) -> Gaussian<2> {
        let both = self.gaussian();
        Gaussian::from_trusted_parts(both.mean().xy(), both.covariance().fixed_view::<2, 2>(0, 0).into_owned())
    }
}
