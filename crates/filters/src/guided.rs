//! The optimal proposal of a linear sensor.

use crate::Error;
use crate::particle::Proposal;
use fewbits_core::{LinearDynamics, LinearSensing};
use fewbits_numerics::linalg::{semidefinite_factor, symmetrised};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Cholesky, SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// `p(x_k | x_{k-1}, z)` for dynamics with additive Gaussian noise `Q` and a linear measurement `z = H x + n`.
///
/// With `S = H Q H^T + R`, `K = Q H^T S^-1` and `m = f(x)`: draws `x' ~ N(m + K (z - H m), Q - K H Q)` with the importance
/// weight `N(z; H m, S)`, which does not depend on the draw. `Q` may be singular.
#[derive(Debug, Clone)]
pub struct OptimalProposal<'a, Dyn, const D: usize, const M: usize> {
    dynamics: &'a Dyn,
    matrix: SMatrix<f64, M, D>,
    measurement: SVector<f64, M>,
    gain: SMatrix<f64, D, M>,
    noise_factor: SMatrix<f64, D, D>,
    innovation_factor: Cholesky<f64, nalgebra::Const<M>>,
    log_normaliser: f64,
}

impl<'a, Dyn: LinearDynamics<D>, const D: usize, const M: usize> OptimalProposal<'a, Dyn, D, M> {
    /// The proposal for one measurement.
    ///
    /// # Errors
    /// A measurement that is not finite; an innovation covariance that is not positive definite.
    pub fn new(
        dynamics: &'a Dyn,
        sensing: &impl LinearSensing<D, M>,
        measurement: SVector<f64, M>,
    ) -> Result<Self, Error> {
        fewbits_numerics::error::all_finite("measurement", measurement.as_slice())?;
        let (q, h) = (dynamics.noise_covariance(), sensing.matrix());
        let innovation = symmetrised(&(h * q * h.transpose() + sensing.noise_covariance()));
        let innovation_factor = Cholesky::new(innovation).ok_or_else(|| {
            fewbits_numerics::ArgumentError::new(
                "sensing",
                "a singular innovation covariance",
                "a positive definite one",
            )
        })?;
        let gain = innovation_factor.solve(&(h * q)).transpose();
        let left = symmetrised(&(q - gain * h * q));
        let log_determinant: f64 = innovation_factor.l().diagonal().iter().map(|d| d.ln()).sum();
        Ok(Self {
            dynamics,
            matrix: *h,
            measurement,
            gain,
            noise_factor: semidefinite_factor("noise_covariance", &left)?,
            innovation_factor,
            log_normaliser: -log_determinant - M as f64 * LN_SQRT_2PI,
        })
    }
}

impl<Dyn: LinearDynamics<D>, const D: usize, const M: usize> Proposal<D> for OptimalProposal<'_, Dyn, D, M> {
    fn propose<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> (SVector<f64, D>, f64) {
        let mean = self.dynamics.mean(state);
        let innovation = self.measurement - self.matrix * mean;
        let squared = innovation.dot(&self.innovation_factor.solve(&innovation));
        let noise = SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal));
        (mean + self.gain * innovation + self.noise_factor * noise, self.log_normaliser - 0.5 * squared)
    }
}
