//! Particles whose velocity is a Gaussian given the positions (Rao-Blackwellised).

use crate::pf_mpa::linearised::LinearRange;
use crate::pf_mpa::target::{Target, WithManoeuvre};
use crate::pf_mpa::tracker::{Ranged, StepInfo, Tracker};
use fewbits_core::columns::set_state;
use fewbits_core::{Gaussian, Likelihood};
use fewbits_densities::Particles;
use fewbits_filters::ResamplingRule;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use fewbits_numerics::linalg::{solve_semidefinite, symmetrised};
use fewbits_pf_mpa::Error;
use nalgebra::{Cholesky, Matrix2, SMatrix, Vector2, Vector6};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// A filter of particles that hold a position and a Gaussian velocity of common variance. Positions are drawn from linearised cells.
///
/// ```text
/// particle (p, v, a), common velocity variance s;  s_0 from the prior, decoupled from the position
/// a ~ the chain;  p' | particle ~ N(p + ts v + ts^2/2 a, d),  d = ts^2 s + ts^4/4 q
/// proposal: that law times the linearised cells;  w *= N(p'; .) p(observed | p') / proposal
/// g = (ts s + ts^3/2 q) / d;  v' = v + ts a + g (p' - mean);  s' = s + ts^2 q - g (ts s + ts^3/2 q)
/// systematic resampling below half the sample size
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct RaoBlackwellGuided {
    particles: usize,
}

/// The stored form of [`RaoBlackwellGuided`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    particles: usize,
}

impl TryFrom<Stored> for RaoBlackwellGuided {
    type Error = Error;

    fn try_from(parts: Stored) -> Result<Self, Error> {
        RaoBlackwellGuided::new(parts.particles)
    }
}

impl RaoBlackwellGuided {
    /// A filter with this many particles.
    ///
    /// # Errors
    /// If `particles` is zero.
    pub fn new(particles: usize) -> Result<Self, Error> {
        if u32::try_from(particles).is_err() {
            return refuse("particles", particles, "fewer than 2^32 particles");
        }
        Ok(Self {
            particles: at_least_one("particles", particles)?,
        })
    }
}

/// Belief of [`RaoBlackwellGuided`]: columns `[x, y, mean vx, mean vy, ax, ay]` and the velocity's common variance.
#[derive(Debug, Clone, PartialEq)]
pub struct VelocityCloud {
    particles: Particles<6>,
    velocity_variance: f64,
}

impl VelocityCloud {
    /// The particles.
    pub fn particles(&self) -> &Particles<6> {
        &self.particles
    }

    /// Variance of each velocity given its particle.
    pub fn velocity_variance(&self) -> f64 {
        self.velocity_variance
    }
}

/// Buffers that are reused from step to step.
#[derive(Debug, Default)]
pub struct VelocityWorkspace {
    ancestors: Vec<u32>,
    next: Option<Particles<6>>,
    increments: Vec<f64>,
}

impl Tracker for RaoBlackwellGuided {
    type Belief = VelocityCloud;
    type Workspace = VelocityWorkspace;

    fn start<R: Rng>(&self, rng: &mut R, _: &Target, prior: &Gaussian<4>) -> Result<VelocityCloud, Error> {
        let covariance = prior.covariance();
        let positions: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let across: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 2).into_owned();
        // Positions are drawn. The part of the velocity that the position explains is drawn with them; the rest stays Gaussian.
        let explained = symmetrised(&(across.transpose() * solve_semidefinite(&positions, &across)?));
        let mut known = *covariance;
        known.fixed_view_mut::<2, 2>(2, 2).copy_from(&explained);
        let velocities = covariance[(2, 2)] + covariance[(3, 3)];
        let velocity_variance = (0.5 * (velocities - explained.trace())).max(0.0);
        let positions = Gaussian::new(*prior.mean(), known)?;
        Ok(VelocityCloud {
            particles: WithManoeuvre::cloud(rng, &positions, self.particles)?,
            velocity_variance,
        })
    }

    fn estimate(&self, belief: &VelocityCloud) -> Gaussian<4> {
        let known = WithManoeuvre::estimate(&belief.particles);
        let mut covariance = *known.covariance();
        covariance[(2, 2)] += belief.velocity_variance;
        covariance[(3, 3)] += belief.velocity_variance;
        Gaussian::from_trusted_parts(*known.mean(), covariance)
    }

    fn step_in_place<R: Rng>(
        &self,
        rng: &mut R,
        target: &Target,
        k: usize,
        belief: &mut VelocityCloud,
        observed: &[Ranged],
        workspace: &mut VelocityWorkspace,
    ) -> Result<StepInfo, Error> {
        let (ts, q, s) = (target.interval(), target.noise_variance(), belief.velocity_variance);
        // Velocity is Gaussian given position and manoeuvre. Its variance and the gain are the same for all particles.
        let spread = ts * ts * s + 0.25 * ts.powi(4) * q;
        let cross = ts * s + 0.5 * ts.powi(3) * q;
        let gain = if spread > 0.0 { cross / spread } else { 0.0 };
        let next = workspace.next.get_or_insert_with(|| belief.particles.clone());
        next.clone_from(&belief.particles);
        let manoeuvre = WithManoeuvre::at(*target, k);
        ResamplingRule::default().resample(rng, next, &mut workspace.ancestors)?;
        workspace.increments.clear();
        let mut columns = next.columns_mut();
        for i in 0..columns[0].len() {
            let state = Vector6::from_fn(|d, _| columns[d][i]);
            let acceleration = Vector2::new(manoeuvre.next(rng, state[4]), manoeuvre.next(rng, state[5]));
            let velocity = Vector2::new(state[2], state[3]);
            let mean = Vector2::new(state[0], state[1]) + velocity * ts + acceleration * (0.5 * ts * ts);
            let (place, increment) = propose(rng, &mean, spread, observed);
            // Regression of the velocity on the drawn position.
            let velocity = velocity + acceleration * ts + (place - mean) * gain;
            let moved = Vector6::new(place[0], place[1], velocity[0], velocity[1], acceleration[0], acceleration[1]);
            set_state(&mut columns, i, &moved);
            workspace.increments.push(increment);
        }
        let increments = &workspace.increments;
        let log_likelihood = next.reweigh(|_, logs| logs.iter_mut().zip(increments).for_each(|(l, c)| *l += c))?;
        let effective_sample_size = next.effective_sample_size();
        let velocity_variance = (s + ts * ts * q - gain * cross).max(0.0);
        if !(WithManoeuvre::estimate(next).is_finite() && velocity_variance.is_finite()) {
            let what = "a moment of the posterior (from the belief or the ranges)";
            return Err(Error::NotANumber { what });
        }
        std::mem::swap(&mut belief.particles, next);
        belief.velocity_variance = velocity_variance;
        Ok(StepInfo {
            log_likelihood: Some(log_likelihood),
            effective_sample_size: Some(effective_sample_size),
            fallbacks: 0,
        })
    }
}

/// Draws a position from `N(mean, spread I)` times the linearised cells. Returns it with its log importance weight.
fn propose<R: Rng>(rng: &mut R, mean: &Vector2<f64>, spread: f64, observed: &[Ranged]) -> (Vector2<f64>, f64) {
    let spread = spread.max(f64::MIN_POSITIVE);
    let mut precision = Matrix2::identity() / spread;
    let mut shift = Vector2::zeros();
    for range in observed.iter().filter_map(|range| LinearRange::at(range, *mean)) {
        let (direction, noise) = (range.direction, range.noise_variance + range.quantization_variance);
        precision += direction * direction.transpose() / noise;
        shift += direction * (range.innovation / noise);
    }
    let Some(factor) = Cholesky::new(precision) else {
        return (*mean, f64::NEG_INFINITY);
    };
    let normals: Vector2<f64> = SMatrix::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
    let upper = factor.l().transpose();
    let Some(noise) = upper.solve_upper_triangular(&normals) else {
        return (*mean, f64::NEG_INFINITY);
    };
    let place = mean + factor.solve(&shift) + noise;
    // ln N(place; mean, spread I) - ln proposal(place); the constants with pi cancel.
    let log_prior = -0.5 * (place - mean).norm_squared() / spread - spread.ln();
    let log_proposal = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>() - 0.5 * normals.norm_squared();
    let log_likelihood = observed.log_likelihood(&place);
    (place, log_prior - log_proposal + log_likelihood)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::Belief;
    use nalgebra::{Matrix4, Vector4};

    #[test]
    fn start_keeps_the_correlation_of_the_prior() {
        // Position and velocity along x with correlation 0.9; y independent.
        let mut covariance = Matrix4::from_diagonal(&Vector4::new(4.0, 1.0, 0.25, 0.25));
        covariance[(0, 2)] = 0.9 * 2.0 * 0.5;
        covariance[(2, 0)] = covariance[(0, 2)];
        let prior = Gaussian::new(Vector4::new(10.0, -3.0, 1.0, 0.5), covariance).unwrap();
        let target = Target::printed().unwrap();
        let mut rng = fewbits_monte_carlo::Stream::new(11).rng();
        let cloud = RaoBlackwellGuided::new(20_000)
            .unwrap()
            .start(&mut rng, &target, &prior)
            .unwrap();
        // `(0.25 (1 - 0.81) + 0.25) / 2`.
        assert!((cloud.velocity_variance() - 0.14875).abs() < 1e-12);
        let found = cloud.particles().covariance();
        assert!((found[(0, 2)] - 0.9).abs() < 0.04, "{found}");
        assert!((found[(2, 2)] - 0.81 * 0.25).abs() < 0.01 && found[(3, 3)].abs() < 1e-6, "{found}");
    }
}
