//! The ellipsoid in which the innovation of a silent vector sensor lies, and the moments of a Gaussian inside it.

mod inside;
mod integrate;
mod quadrature;

pub use inside::GaussianInEllipsoid;
pub use quadrature::EllipsoidMoments;

use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::non_negative;
use fewbits_numerics::factored::Factored;
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// The region of silence `nu' S^-1 nu < eta` of an innovation of `M` components.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers<M>")]
pub struct Ellipsoid<const M: usize> {
    /// `L` with `S = L L'`.
    #[serde(skip_serializing)]
    lower: SMatrix<f64, M, M>,
    #[serde(with = "fewbits_numerics::stored")]
    innovation_covariance: SMatrix<f64, M, M>,
    threshold: f64,
}

/// The stored form of [`Ellipsoid`].
#[derive(Deserialize)]
#[serde(rename = "Ellipsoid")]
#[serde(deny_unknown_fields)]
struct Numbers<const M: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    innovation_covariance: SMatrix<f64, M, M>,
    threshold: f64,
}

impl<const M: usize> TryFrom<Numbers<M>> for Ellipsoid<M> {
    type Error = ArgumentError;

    fn try_from(parts: Numbers<M>) -> Result<Self, ArgumentError> {
        Ellipsoid::new(&parts.innovation_covariance, parts.threshold)
    }
}

impl<const M: usize> Ellipsoid<M> {
    /// The region for innovation covariance `S` (positive definite) and threshold `eta >= 0`.
    ///
    /// # Errors
    /// If an entry is not finite, `S` is not positive definite or the threshold is negative.
    pub fn new(innovation_covariance: &SMatrix<f64, M, M>, threshold: f64) -> Result<Self, ArgumentError> {
        Ok(Self {
            lower: Factored::new("innovation_covariance", innovation_covariance)?.lower,
            innovation_covariance: symmetrised(innovation_covariance),
            threshold: non_negative("threshold", threshold)?,
        })
    }

    /// Innovation covariance `S`.
    pub fn innovation_covariance(&self) -> &SMatrix<f64, M, M> {
        &self.innovation_covariance
    }

    /// Threshold `eta`.
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// `nu' S^-1 nu`, the normalised innovation squared.
    #[inline]
    pub fn statistic(&self, innovation: &SVector<f64, M>) -> f64 {
        match self.lower.solve_lower_triangular(innovation) {
            Some(white) => white.norm_squared(),
            None => f64::INFINITY,
        }
    }

    /// The image of a point of the unit ball: `sqrt(eta) L point`.
    #[doc(hidden)]
    pub fn from_ball(&self, point: &SVector<f64, M>) -> SVector<f64, M> {
        self.lower * point * self.threshold.sqrt()
    }

    /// `ln` of the ellipsoid's volume, `ln det(S)/2 + M/2 ln(eta) + ln V_M`. The unit ball has `V_M = V_{M-2} 2 pi/M`.
    #[doc(hidden)]
    pub fn log_volume(&self) -> f64 {
        let log_determinant: f64 = self.lower.diagonal().iter().map(|d| d.ln()).sum();
        let (mut ball, mut dimension) = if M % 2 == 1 { (2.0, 1) } else { (1.0, 0) };
        while dimension < M {
            dimension += 2;
            ball *= std::f64::consts::TAU / dimension as f64;
        }
        log_determinant + 0.5 * M as f64 * self.threshold.ln() + f64::ln(ball)
    }

    /// Prepares probabilities and moments of `N(mu, V)` inside the region, for any `mu`. `V` may be singular.
    ///
    /// # Errors
    /// If an entry of `V` is not finite, or an eigenvalue is negative by more than rounding.
    pub fn under(&self, covariance: &SMatrix<f64, M, M>) -> Result<GaussianInEllipsoid<M>, ArgumentError> {
        GaussianInEllipsoid::new(&self.lower, self.threshold, covariance)
    }
}
