//! Proposals that have seen what was observed: the optimal one for a value, a tilted one for any factor.

use crate::Error;
use crate::particle::Proposal;
use fewbits_core::factor::Tilted;
use fewbits_core::{Belief, Factor, Gaussian, GaussianDynamics, LinearDynamics, LinearSensing, Observed, Sensing};
use fewbits_numerics::linalg::{semidefinite_factor, solve_semidefinite, symmetrised};
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

/// Share of draws that [`TiltedProposal`] takes from the dynamics themselves.
const DEFENCE: f64 = 0.1;

/// A proposal for dynamics with Gaussian noise and any factor: the posterior of the noise-free measurement `m` that
/// [`Factor::tilted`] finds from each particle, with the rest of the state following as the noise correlates it.
///
/// ```text
/// f = E[x' | x],  m = h(f),  H = h'(f),  V = H Q(x) H',  G = Q H' V^-1
/// T = N(tilted mean, tilted covariance) of N(m, V) under the factor
/// y ~ p(x' | x),  u = m + H (y - f)                      the dynamics' own draw
/// nine times in ten:  v ~ T,  x' = y + G (v - u)         otherwise:  v = u,  x' = y
/// c = ln p(observed | h(x')) + ln N(v; m, V) - ln(.9 T(v) + .1 N(v; m, V))
/// ```
/// The draws from the dynamics bound the weight by ten times the likelihood, however much lighter than the posterior's the tails
/// of `T` may be. Exact for every sensor: the linearisation shapes the proposal only. `Q` may be singular; where it does not
/// move `m`, or the factor has no tilted moments, the particle moves by the dynamics alone. For a value through a linear sensor
/// [`OptimalProposal`] is the better one.
#[derive(Debug, Clone, Copy)]
pub struct TiltedProposal<'a, Dyn, S, F, const M: usize> {
    dynamics: &'a Dyn,
    observed: &'a Observed<S, F, M>,
}

impl<'a, Dyn, S, F, const M: usize> TiltedProposal<'a, Dyn, S, F, M> {
    /// The proposal for what was observed.
    pub fn new(dynamics: &'a Dyn, observed: &'a Observed<S, F, M>) -> Self {
        Self { dynamics, observed }
    }
}

impl<Dyn, S, F, const D: usize, const M: usize> Proposal<D> for TiltedProposal<'_, Dyn, S, F, M>
where
    Dyn: GaussianDynamics<D>,
    S: Sensing<D, M>,
    F: Factor<M>,
{
    fn propose<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> (SVector<f64, D>, f64) {
        let Observed { sensing, factor } = self.observed;
        let weigh = |next: &SVector<f64, D>| factor.log_likelihood(&sensing.mean(next));
        let own = self.dynamics.propagate(rng, state);
        let mean = self.dynamics.mean(state);
        let (matrix, noise) = (sensing.jacobian(&mean), self.dynamics.noise_covariance_at(state));
        let cross = noise * matrix.transpose();
        let prior = Gaussian::from_trusted_parts(sensing.mean(&mean), matrix * cross);
        let gain = solve_semidefinite(prior.covariance(), &cross.transpose()).map(|g| g.transpose());
        let tilted = factor
            .tilted(&prior)
            .ok()
            .and_then(|Tilted { mean, covariance, .. }| Gaussian::from_trusted_parts(mean, covariance).factored().ok());
        let (Ok(gain), Ok(prior), Some(tilted)) = (gain, prior.factored(), tilted) else {
            return (own, weigh(&own));
        };
        let reached = prior.mean() + matrix * (own - mean);
        let (next, measured) = if rng.random::<f64>() < DEFENCE {
            (own, reached)
        } else {
            let drawn = tilted.sample(rng);
            (own + gain * (drawn - reached), drawn)
        };
        let ratio = tilted.log_pdf(&measured) - prior.log_pdf(&measured);
        let mixed = ratio.max(0.0) + ((1.0 - DEFENCE) * ratio.min(0.0).exp() + DEFENCE * (-ratio.max(0.0)).exp()).ln();
        (next, weigh(&next) - mixed)
    }
}
