//! The extended Kalman filter: the Kalman filter of the tangent.

use crate::Error;
use crate::kalman::{self, KalmanInfo};
use fewbits_core::{Belief, Gaussian, GaussianDynamics, LinearSensing, Sensing};
use fewbits_numerics::linalg::congruence;
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Time update about the mean: `f(m)`, `F P F' + Q` with `F` the Jacobian at `m`.
pub fn predict<const D: usize>(dynamics: &impl GaussianDynamics<D>, belief: &Gaussian<D>) -> Gaussian<D> {
    let jacobian = dynamics.jacobian(belief.mean());
    let covariance = congruence(&jacobian, belief.covariance()) + dynamics.noise_covariance_at(belief.mean());
    Gaussian::from_trusted_parts(dynamics.mean(belief.mean()), covariance)
}

/// Measurement update with the sensing linearised at the belief's mean, in Joseph form.
///
/// # Errors
/// As [`kalman::update`].
pub fn update<const D: usize, const M: usize>(
    sensing: &impl Sensing<D, M>,
    belief: &Gaussian<D>,
    measurement: &SVector<f64, M>,
) -> Result<(Gaussian<D>, KalmanInfo<D, M>), Error> {
    let tangent = Tangent::at(sensing, belief.mean());
    // The tangent is H x; what the measurement says beyond it is moved to the other side.
    let shifted = measurement - sensing.mean(belief.mean()) + tangent.matrix * belief.mean();
    kalman::update(&tangent, belief, &shifted)
}

/// One cycle: [`predict`], then [`update`].
///
/// # Errors
/// As [`update`].
pub fn step<const D: usize, const M: usize>(
    dynamics: &impl GaussianDynamics<D>,
    sensing: &impl Sensing<D, M>,
    belief: &Gaussian<D>,
    measurement: &SVector<f64, M>,
) -> Result<(Gaussian<D>, KalmanInfo<D, M>), Error> {
    update(sensing, &predict(dynamics, belief), measurement)
}

/// A sensing model replaced by its tangent at one state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tangent<const D: usize, const M: usize> {
    matrix: SMatrix<f64, M, D>,
    noise_covariance: SMatrix<f64, M, M>,
}

impl<const D: usize, const M: usize> Tangent<D, M> {
    /// The tangent of `sensing` at `state`.
    pub fn at(sensing: &impl Sensing<D, M>, state: &SVector<f64, D>) -> Self {
        Self {
            matrix: sensing.jacobian(state),
            noise_covariance: sensing.noise_covariance_at(state),
        }
    }
}

impl<const D: usize, const M: usize> Sensing<D, M> for Tangent<D, M> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.matrix * state
    }

    fn jacobian(&self, _: &SVector<f64, D>) -> SMatrix<f64, M, D> {
        self.matrix
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> SMatrix<f64, M, M> {
        self.noise_covariance
    }

    fn sample<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> SVector<f64, M> {
        Gaussian::from_trusted_parts(self.matrix * state, self.noise_covariance).sample(rng)
    }
}

impl<const D: usize, const M: usize> LinearSensing<D, M> for Tangent<D, M> {
    fn matrix(&self) -> &SMatrix<f64, M, D> {
        &self.matrix
    }

    fn noise_covariance(&self) -> &SMatrix<f64, M, M> {
        &self.noise_covariance
    }
}
