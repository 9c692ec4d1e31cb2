//! The censoring rule, and the innovation covariance that it uses.

use crate::Error;
use crate::ellipsoid::Ellipsoid;
use fewbits_core::{Gaussian, GaussianDynamics, LinearSensing, Sensing};
use fewbits_filters::{assumed_density, kalman};
use fewbits_models::LinearSensor;
use fewbits_numerics::error::positive;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Send if and only if `nu' S^-1 nu >= eta`, with the innovation `nu = z - prediction`.
///
/// For scalar measurements this rule is equivalent to one that sends if the posterior's Kullback-Leibler divergence is large.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Ellipsoid<M>", into = "Ellipsoid<M>")]
pub struct CensoringRule<const M: usize> {
    region: Ellipsoid<M>,
    /// `sqrt(eta S_11)`.
    half_width: f64,
}

impl<const M: usize> From<CensoringRule<M>> for Ellipsoid<M> {
    fn from(rule: CensoringRule<M>) -> Self {
        rule.region
    }
}

impl<const M: usize> From<Ellipsoid<M>> for CensoringRule<M> {
    fn from(region: Ellipsoid<M>) -> Self {
        let (threshold, variance) = (region.threshold(), region.innovation_covariance()[(0, 0)]);
        let square = threshold * variance;
        Self {
            half_width: if square.is_finite() {
                square.sqrt()
            } else {
                threshold.sqrt() * variance.sqrt()
            },
            region,
        }
    }
}

impl<const M: usize> CensoringRule<M> {
    /// The rule with innovation covariance `S` (positive definite) and threshold `eta >= 0`.
    ///
    /// # Errors
    /// If `S` is not positive definite or the threshold negative.
    pub fn new(innovation_covariance: &SMatrix<f64, M, M>, threshold: f64) -> Result<Self, Error> {
        Ok(Ellipsoid::new(innovation_covariance, threshold)?.into())
    }

    /// The ellipsoid in which the innovation of a silent sensor lies.
    pub fn region(&self) -> &Ellipsoid<M> {
        &self.region
    }

    /// Whether a sensor with this innovation sends.
    #[inline]
    pub fn sends(&self, innovation: &SVector<f64, M>) -> bool {
        if M == 1 {
            // The scalar rule compares with the half-width, because the fusion centre uses the same interval.
            fewbits_node::censor::reaches(innovation[0], self.half_width)
        } else {
            self.region.statistic(innovation) >= self.region.threshold()
        }
    }

    /// Checks that the rule would have sent this innovation. Deviations by a relative 1e-9 are accepted, and by up to `rounding` in each
    /// component, the largest error of the number format.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the rule would not have sent it.
    pub fn check(&self, innovation: &SVector<f64, M>, rounding: &SVector<f64, M>) -> Result<(), Error> {
        let statistic = self.region.statistic(innovation);
        // By the triangle inequality, rounding moves the root of the statistic by at most the sum over the components.
        let slack: f64 = (0..M)
            .filter(|j| rounding[*j] > 0.0)
            .map(|j| {
                self.region
                    .statistic(&SVector::from_fn(|i, _| if i == j { rounding[j] } else { 0.0 }))
                    .sqrt()
            })
            .sum();
        if (statistic.sqrt() + slack).powi(2) < self.region.threshold() * (1.0 - 1e-9) {
            return Err(Error::Impossible);
        }
        Ok(())
    }

    /// Lower and upper end of the interval of silence about a prediction of the first component.
    #[doc(hidden)]
    pub fn interval(&self, prediction: f64) -> (f64, f64) {
        (prediction - self.half_width, prediction + self.half_width)
    }
}

impl CensoringRule<1> {
    /// `c = sqrt(eta s)`: a silent innovation lies in `(-c, c)`.
    ///
    /// The root is taken of `eta s` only. The formulas printed in the paper also put the offset `mu` of the prediction under the root,
    /// which is NaN for `mu > eta s` (erratum `cfwmd-1`).
    pub fn half_width(&self) -> f64 {
        self.half_width
    }

    /// The rule with innovation variance `s`.
    ///
    /// # Errors
    /// If `s` is not positive or the threshold negative.
    pub fn scalar(innovation_variance: f64, threshold: f64) -> Result<Self, Error> {
        positive("innovation_variance", innovation_variance)?;
        Self::new(&SMatrix::from([[innovation_variance]]), threshold)
    }
}

impl<const M: usize> CensoringRule<M> {
    /// The rule for a broadcast belief with covariance `P` (the paper's CFwMD2): `S = R + H (F P F' + Q) H'`. The dynamics are linearised
    /// at the belief's mean, the sensing at its prediction.
    ///
    /// # Errors
    /// If `S` is not positive definite or the threshold negative.
    pub fn under<const D: usize>(
        dynamics: &impl GaussianDynamics<D>,
        sensing: &impl Sensing<D, M>,
        belief: &Gaussian<D>,
        threshold: f64,
    ) -> Result<Self, Error> {
        let step = OwnRecursion::new(belief).advance(dynamics, sensing, belief.mean())?;
        Self::new(&step.innovation_covariance, threshold)
    }
}

/// The covariance recursion of one sensor's own (extended) Kalman filter, which uses all its own measurements.
///
/// A linear model needs no data for it, a nonlinear one needs the broadcast estimate as the point of linearisation. In both cases sensor
/// and fusion centre run the same recursion and get the same `S`.
///
/// ```text
/// P = F P F' + Q, linearised at the last estimate
/// S = H P H' + R,  H the Jacobian at the prediction
/// P = P - P H' S^-1 H P
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "Gaussian<D>", into = "Gaussian<D>")]
pub struct OwnRecursion<const D: usize> {
    covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> From<Gaussian<D>> for OwnRecursion<D> {
    fn from(start: Gaussian<D>) -> Self {
        Self::new(&start)
    }
}

impl<const D: usize> From<OwnRecursion<D>> for Gaussian<D> {
    fn from(recursion: OwnRecursion<D>) -> Self {
        Self::from_trusted_parts(SVector::zeros(), recursion.covariance)
    }
}

/// Covariances and gain of one step of [`OwnRecursion`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnStep<const D: usize, const M: usize> {
    /// Innovation covariance `S = R + H P H'`.
    pub innovation_covariance: SMatrix<f64, M, M>,
    /// Gain `W = P H' S^-1` of the sensor's own filter.
    pub gain: SMatrix<f64, D, M>,
    /// Predicted covariance, before the measurement.
    pub predicted: SMatrix<f64, D, D>,
}

impl<const D: usize> OwnRecursion<D> {
    /// The recursion from the covariance of `start`.
    pub fn new(start: &Gaussian<D>) -> Self {
        Self {
            covariance: *start.covariance(),
        }
    }

    /// Covariance after the last measurement.
    pub fn covariance(&self) -> &SMatrix<f64, D, D> {
        &self.covariance
    }

    /// One step. `estimate` is the state of the step before, at which the models are linearised; linear models ignore it.
    ///
    /// # Errors
    /// If an innovation covariance is not positive definite.
    pub fn advance<const M: usize>(
        &mut self,
        dynamics: &impl GaussianDynamics<D>,
        sensing: &impl Sensing<D, M>,
        estimate: &SVector<f64, D>,
    ) -> Result<OwnStep<D, M>, Error> {
        let before = Gaussian::from_trusted_parts(*estimate, self.covariance);
        let predicted = assumed_density::predict(dynamics, &before);
        let at = predicted.mean();
        let tangent = LinearSensor::new(sensing.jacobian(at), sensing.noise_covariance_at(at))?;
        // The value of the measurement is irrelevant: only covariances are used.
        let (after, info) = kalman::update(&tangent, &predicted, &(tangent.matrix() * at))?;
        self.covariance = *after.covariance();
        Ok(OwnStep {
            innovation_covariance: info.innovation_covariance,
            gain: info.gain,
            predicted: *predicted.covariance(),
        })
    }
}
