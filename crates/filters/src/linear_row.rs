//! One scalar row of a sensor that is linear about a state.

use fewbits_core::{LinearSensing, Sensing};
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// `z = h'x + w`, `w ~ N(0, r)`: a sensor as it is about one state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearRow<const D: usize> {
    direction: SMatrix<f64, 1, D>,
    noise_variance: SMatrix<f64, 1, 1>,
}

impl<const D: usize> LinearRow<D> {
    /// `None` if `direction` is not finite or the variance is not a positive number.
    pub(crate) fn new(direction: SMatrix<f64, 1, D>, noise_variance: f64) -> Option<Self> {
        let usable = noise_variance > 0.0 && noise_variance.is_finite() && direction.iter().all(|x| x.is_finite());
        usable.then_some(Self {
            direction,
            noise_variance: [[noise_variance]].into(),
        })
    }
}

impl<const D: usize> Sensing<D, 1> for LinearRow<D> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, 1> {
        self.direction * state
    }

    fn jacobian(&self, _: &SVector<f64, D>) -> SMatrix<f64, 1, D> {
        self.direction
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> SMatrix<f64, 1, 1> {
        self.noise_variance
    }

    fn sample<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> SVector<f64, 1> {
        let noise: f64 = rng.sample(StandardNormal);
        [self.mean(state)[0] + self.noise_variance[0].sqrt() * noise].into()
    }
}

impl<const D: usize> LinearSensing<D, 1> for LinearRow<D> {
    fn matrix(&self) -> &SMatrix<f64, 1, D> {
        &self.direction
    }

    fn noise_covariance(&self) -> &SMatrix<f64, 1, 1> {
        &self.noise_variance
    }
}
