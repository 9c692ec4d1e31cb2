//! A particle filter whose proposal depends on the observations.

use crate::contract::{Info, StateFilter};
use crate::particle::{BootstrapFilter, weigh};
use crate::{Error, ResamplingRule};
use fewbits_core::columns::{set_state, state_at};
use fewbits_core::{Belief, ColumnsMut, Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::Particles;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::linalg::{congruence, semidefinite_factor, solve_semidefinite, symmetrised};
use nalgebra::{Cholesky, SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// Fraction of particles that keep the draw from the dynamics.
const DEFENCE: f64 = 0.1;

/// A particle filter whose particles are drawn given the observations, for likelihoods that are sharp compared with the process
/// noise.
///
/// ```text
/// predict:  resample if due; f = E[x' | x], Q = Cov[x' | x] of each particle, Q = L L', x' = f + L u, u ~ N(0, I)
/// update:   N(d, S) of u: the moments of N(f, Q) given the observations, one after the other
///           nine times in ten: u ~ N(d, S)          otherwise: as predicted
///           w *= p(observed | x') N(u; 0, I) / (.9 N(u; d, S) + .1 N(u; 0, I))
/// ```
/// The fraction drawn from the dynamics bounds the weight by ten times the likelihood, even if the tails of `N(d, S)` are light. The filter
/// is exact for every sensor: linearisation changes the proposal only. `Q` may be singular. An update draws new particles only if it
/// directly follows a `predict`; a second update only weighs. `N(f, Q)` is therefore part of the belief ([`GuidedParticles`]): a belief
/// that was stored, or taken from an earlier time, is drawn again from its own proposals.
#[derive(Debug, Clone)]
pub struct GuidedFilter<const D: usize> {
    bootstrap: BootstrapFilter<D>,
}

/// The belief of a [`GuidedFilter`]: particles, and the law `N(f, Q)` that each was drawn from if it has not been observed since.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored<D>")]
pub struct GuidedParticles<const D: usize> {
    particles: Particles<D>,
    /// One per particle, or none after an update.
    moves: Vec<Gaussian<D>>,
}

/// The stored form of [`GuidedParticles`].
#[derive(Deserialize)]
#[serde(rename = "GuidedParticles", deny_unknown_fields)]
struct Stored<const D: usize> {
    particles: Particles<D>,
    moves: Vec<Gaussian<D>>,
}

impl<const D: usize> TryFrom<Stored<D>> for GuidedParticles<D> {
    type Error = ArgumentError;

    fn try_from(Stored { particles, moves }: Stored<D>) -> Result<Self, ArgumentError> {
        if moves.is_empty() || moves.len() == particles.len() {
            return Ok(Self { particles, moves });
        }
        let expected = format!("none, or {}, one per particle", particles.len());
        Err(ArgumentError::new("moves", format!("{} Gaussians", moves.len()), expected))
    }
}

/// Particles that an update weighs and does not draw again.
impl<const D: usize> From<Particles<D>> for GuidedParticles<D> {
    fn from(particles: Particles<D>) -> Self {
        Self {
            particles,
            moves: Vec::new(),
        }
    }
}

impl<const D: usize> GuidedParticles<D> {
    /// The particles.
    pub fn particles(&self) -> &Particles<D> {
        &self.particles
    }
}

impl<const D: usize> Belief<D> for GuidedParticles<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.particles.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.particles.covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        self.particles.sample_columns(rng, states);
    }
}

impl<const D: usize> GuidedFilter<D> {
    /// The filter that starts with `count` particles.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn new(rule: ResamplingRule, count: usize) -> Result<Self, Error> {
        Ok(Self {
            bootstrap: BootstrapFilter::new(rule, count)?,
        })
    }
}

/// A particle drawn from its proposal, and `ln` of the ratio of the dynamics' density to the proposal's there. `None` if the
/// observations cannot update the Gaussian of its motion; the predicted particle is then kept.
fn propose<const D: usize>(
    rng: &mut dyn Rng,
    own: &SVector<f64, D>,
    moved: &Gaussian<D>,
    observed: &[&dyn Likelihood<D>],
) -> Option<(SVector<f64, D>, f64)> {
    let mut posterior = *moved;
    observed.condition(&mut posterior).ok()?;
    // u = back (x' - f) on the range of Q; elsewhere u stays standard normal.
    let lower = semidefinite_factor("noise_covariance", moved.covariance()).ok()?;
    let back = solve_semidefinite(moved.covariance(), &lower).ok()?.transpose();
    let still = SMatrix::<f64, D, D>::identity() - symmetrised(&(back * lower));
    // The proposal N(shift, spread) of u; u itself is standard normal under the dynamics.
    let shift = back * (posterior.mean() - moved.mean());
    let spread = Cholesky::new(symmetrised(&(congruence(&back, posterior.covariance()) + still)))?;
    let drawn = if rng.random::<f64>() < DEFENCE {
        back * (own - moved.mean())
    } else {
        shift + spread.l() * SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal))
    };
    let offset = drawn - shift;
    let log_root: f64 = spread.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
    // ratio = ln N(u; shift, spread) / N(u; 0, I); `mixed` adds the fraction drawn from the dynamics. The larger of the two terms is
    // taken out of the sum, so that no exponential overflows.
    let ratio = 0.5 * (drawn.norm_squared() - offset.dot(&spread.solve(&offset))) - log_root;
    let mixed = ratio.max(0.0) + ((1.0 - DEFENCE) * ratio.min(0.0).exp() + DEFENCE * (-ratio.max(0.0)).exp()).ln();
    mixed.is_finite().then(|| (moved.mean() + lower * drawn, -mixed))
}

impl<const D: usize> StateFilter<D> for GuidedFilter<D> {
    type Belief = GuidedParticles<D>;

    fn points(&self, belief: &GuidedParticles<D>) -> Option<crate::Points<D>> {
        self.bootstrap.points(&belief.particles)
    }

    fn start(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<GuidedParticles<D>, Error> {
        Ok(self.bootstrap.start(rng, prior)?.into())
    }

    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut GuidedParticles<D>,
    ) -> Result<(), Error> {
        let GuidedParticles { particles, moves } = belief;
        self.bootstrap.resample(rng, particles)?;
        let columns = particles.columns();
        let known = |i| Gaussian::from_trusted_parts(state_at(&columns, i), SMatrix::zeros());
        moves.clear();
        moves.extend((0..particles.len()).map(|i| dynamics.predict(&known(i), 1.0)));
        dynamics.propagate_columns(rng, particles.columns_mut());
        Ok(())
    }

    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut GuidedParticles<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        let mut next = belief.particles.clone();
        let mut ratios = vec![0.0; next.len()];
        // Particles predicted in this step are drawn again from a proposal that depends on the observations. The ratio of the
        // target to the proposal is part of their weights.
        if !observed.is_empty() {
            let mut columns = next.columns_mut();
            for (i, (moved, ratio)) in belief.moves.iter().zip(&mut ratios).enumerate() {
                let own = state_at(&columns, i);
                if let Some((state, log_ratio)) = propose(rng, &own, moved, observed) {
                    set_state(&mut columns, i, &state);
                    *ratio = log_ratio;
                }
            }
        }
        let info = weigh(&mut next, |states, logs| {
            logs.iter_mut().zip(&ratios).for_each(|(log, ratio)| *log += ratio);
            observed.add_log_likelihoods(states, logs);
        })?;
        *belief = next.into();
        Ok(info)
    }
}
