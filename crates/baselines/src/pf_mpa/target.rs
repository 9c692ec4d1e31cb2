//! A target that manoeuvres: constant velocity with white acceleration noise and an acceleration that jumps between three values.

use crate::pf_mpa::chain::AccelerationChain;
use fewbits_core::{Belief, Dynamics, Gaussian};
use fewbits_densities::Particles;
use fewbits_filters::{Imm, MomentFilter, Switching};
use fewbits_models::{AffineGaussian, LinearGaussian};
use fewbits_numerics::error::{non_negative, positive};
use fewbits_pf_mpa::Error;
use nalgebra::{Matrix4, Matrix4x2, SVector, Vector2, Vector4, Vector6};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// The target: state `[x, y, vx, vy]`, `X_k = F X_{k-1} + G a_k + G u_k`. On each axis `F = [[1, ts], [0, 1]]` and
/// `G = [ts^2/2, ts]'`; `u ~ N(0, q)`, and `a` follows an [`AccelerationChain`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredTarget")]
pub struct Target {
    interval: f64,
    noise_variance: f64,
    chain: AccelerationChain,
}

/// The stored form of [`Target`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredTarget {
    interval: f64,
    noise_variance: f64,
    chain: AccelerationChain,
}

impl TryFrom<StoredTarget> for Target {
    type Error = Error;

    fn try_from(parts: StoredTarget) -> Result<Self, Error> {
        Target::new(parts.interval, parts.noise_variance, parts.chain)
    }
}

impl Target {
    /// A target observed every `interval`, with white accelerations of variance `noise_variance` per axis.
    ///
    /// # Errors
    /// If the interval is not above zero or the variance is negative.
    pub fn new(interval: f64, noise_variance: f64, chain: AccelerationChain) -> Result<Self, Error> {
        Ok(Self {
            interval: positive("interval", interval)?,
            noise_variance: non_negative("noise_variance", noise_variance)?,
            chain,
        })
    }

    /// The thesis's target: one step per second, `q = 0.02`, `g = 0.1`.
    ///
    /// # Errors
    /// Never: the parameters are fixed.
    pub fn printed() -> Result<Self, Error> {
        Self::new(1.0, 0.02, AccelerationChain::printed(0.1)?)
    }

    /// Time `ts` between steps.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// Variance `q` of the white acceleration, per axis.
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// The Markov chain of the manoeuvre accelerations.
    pub fn chain(&self) -> &AccelerationChain {
        &self.chain
    }

    /// Transition matrix `F` of all four coordinates.
    pub fn transition(&self) -> Matrix4<f64> {
        let mut f = Matrix4::identity();
        f[(0, 2)] = self.interval;
        f[(1, 3)] = self.interval;
        f
    }

    /// Gain `G` from the two accelerations to the state.
    pub fn gain(&self) -> Matrix4x2<f64> {
        let (half, ts) = (0.5 * self.interval * self.interval, self.interval);
        Matrix4x2::new(half, 0.0, 0.0, half, ts, 0.0, 0.0, ts)
    }

    /// Linear dynamics without manoeuvres. The variance of the white acceleration is `q` plus `additional_variance`.
    ///
    /// # Errors
    /// If the variance is negative or not finite.
    pub fn dynamics(&self, additional_variance: f64) -> Result<LinearGaussian<4, 2>, Error> {
        non_negative("additional_variance", additional_variance)?;
        let variance = self.noise_variance + additional_variance;
        LinearGaussian::new(self.transition(), self.gain(), SVector::repeat(variance))
    }

    /// The belief after step `k`, counted from zero, before any observation. `manoeuvres` says how manoeuvres enter.
    pub fn predict(&self, belief: &Gaussian<4>, k: usize, manoeuvres: Manoeuvres) -> Gaussian<4> {
        let (mean, variance) = self.acceleration(k, manoeuvres);
        let (f, g) = (self.transition(), self.gain());
        let noise = g * g.transpose() * (self.noise_variance + variance);
        Gaussian::from_trusted_parts(
            f * belief.mean() + g * Vector2::repeat(mean),
            f * belief.covariance() * f.transpose() + noise,
        )
    }

    /// Step `k` as affine dynamics for any Gaussian filter. `manoeuvres` says how manoeuvres enter.
    ///
    /// # Errors
    /// If the covariance of the noise overflows.
    pub fn motion(&self, k: usize, manoeuvres: Manoeuvres) -> Result<AffineGaussian<4>, Error> {
        let (mean, variance) = self.acceleration(k, manoeuvres);
        self.pushed(&Vector2::repeat(mean), variance)
    }

    /// Step `k` as nine interacting multiple models, one for each pair of accelerations; that along y varies fastest. In the first
    /// step the models are drawn anew, whatever their probabilities were.
    ///
    /// # Errors
    /// As [`motion`](Self::motion).
    pub fn modes(&self, k: usize) -> Result<(Switching<AffineGaussian<4>>, Imm<4, MomentFilter>), Error> {
        let (values, axis) = (self.chain.values(), self.chain.transition(k));
        let pairs = || (0..9).map(|mode| (mode / 3, mode % 3));
        let models = pairs().map(|(x, y)| self.pushed(&Vector2::new(values[x], values[y]), 0.0));
        let row = |(x, y): (usize, usize)| pairs().map(|(to_x, to_y)| axis[x][to_x] * axis[y][to_y]).collect();
        let transition: Vec<Vec<f64>> = pairs().map(row).collect();
        Ok((
            Switching::new(models.collect::<Result<_, _>>()?)?,
            Imm::of(vec![(MomentFilter, 1.0); 9], &transition)?,
        ))
    }

    /// Mean and variance of the acceleration that acts on step `k`.
    fn acceleration(&self, k: usize, manoeuvres: Manoeuvres) -> (f64, f64) {
        match manoeuvres {
            Manoeuvres::Ignored => (0.0, 0.0),
            Manoeuvres::AsNoise => self.chain.moments(k),
        }
    }

    /// One step under accelerations of this mean and additional variance.
    fn pushed(&self, acceleration: &Vector2<f64>, variance: f64) -> Result<AffineGaussian<4>, Error> {
        let gain = self.gain();
        let noise = gain * gain.transpose() * (self.noise_variance + variance);
        Ok(AffineGaussian::new(self.transition(), gain * acceleration, noise)?)
    }

    /// Moves a state by one step under the given accelerations.
    pub fn moved<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        state: &Vector4<f64>,
        acceleration: &Vector2<f64>,
    ) -> Vector4<f64> {
        let deviation = self.noise_variance.sqrt();
        let mut push = || deviation * rng.sample::<f64, _>(StandardNormal);
        let push = Vector2::new(push(), push()) + acceleration;
        let (ts, half) = (self.interval, 0.5 * self.interval * self.interval);
        Vector4::new(
            state[0] + ts * state[2] + half * push[0],
            state[1] + ts * state[3] + half * push[1],
            state[2] + ts * push[0],
            state[3] + ts * push[1],
        )
    }

    /// A random track of `steps` states after `start`. The manoeuvres follow the Markov chain.
    pub fn simulate<R: Rng>(&self, rng: &mut R, start: &Vector4<f64>, steps: usize) -> Vec<Vector4<f64>> {
        let mut state = *start;
        let mut acceleration = Vector2::zeros();
        (0..steps)
            .map(|k| {
                acceleration = if k == 0 {
                    Vector2::new(self.chain.sample(rng, 0), self.chain.sample(rng, 0))
                } else {
                    acceleration.map(|a| self.chain.next(rng, a))
                };
                state = self.moved(rng, &state, &acceleration);
                state
            })
            .collect()
    }
}

/// How a filter whose belief does not contain the manoeuvre treats manoeuvres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Manoeuvres {
    /// They are ignored: the extended Kalman filter of the thesis.
    Ignored,
    /// They are white noise with the mean and variance of the chain.
    AsNoise,
}

/// The target with the last accelerations as part of the state, `[x, y, vx, vy, ax, ay]`. These dynamics of one step serve any
/// particle filter; its particles then remember their manoeuvre. Copies of a resampled particle draw their next accelerations
/// independently.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WithManoeuvre {
    target: Target,
    step: usize,
}

impl WithManoeuvre {
    /// The dynamics of step `k`, counted from zero. All steps but the first are the same.
    pub fn at(target: Target, k: usize) -> Self {
        Self { target, step: k }
    }

    /// A state before the first step. Its accelerations are not used.
    pub fn start(state: &Vector4<f64>) -> Vector6<f64> {
        Vector6::new(state[0], state[1], state[2], state[3], 0.0, 0.0)
    }

    /// A cloud of `count` particles drawn from `prior`, before the first step.
    ///
    /// # Errors
    /// If `count` is zero, or the prior's covariance is not positive semidefinite.
    pub fn cloud<R: Rng>(rng: &mut R, prior: &Gaussian<4>, count: usize) -> Result<Particles<6>, Error> {
        let states: Particles<4> = Particles::from_belief(rng, prior, count)?;
        let mut next = 0;
        Particles::from_draws(count, || {
            let state = states.point(next).unwrap_or_else(|| *prior.mean());
            next += 1;
            Self::start(&state)
        })
    }

    /// Mean and covariance of position and velocity.
    pub fn estimate(cloud: &Particles<6>) -> Gaussian<4> {
        let (mean, covariance) = (cloud.mean(), cloud.covariance());
        Gaussian::from_trusted_parts(Vector4::from_fn(|i, _| mean[i]), Matrix4::from_fn(|i, j| covariance[(i, j)]))
    }

    /// Draws the acceleration of this step after `last`.
    pub(crate) fn next<R: Rng + ?Sized>(&self, rng: &mut R, last: f64) -> f64 {
        match self.step {
            0 => self.target.chain.sample(rng, 0),
            _ => self.target.chain.next(rng, last),
        }
    }

    /// Mean acceleration of this step after `last`.
    fn expected(&self, last: f64) -> f64 {
        let chain = &self.target.chain;
        let from = chain.values().iter().position(|v| *v == last).unwrap_or(0);
        let law = chain.transition(self.step)[from];
        chain.magnitude() * (law[1] - law[2])
    }
}

impl Dynamics<6> for WithManoeuvre {
    fn mean(&self, state: &Vector6<f64>) -> Vector6<f64> {
        let acceleration = Vector2::new(self.expected(state[4]), self.expected(state[5]));
        let moved = self.target.transition() * state.fixed_rows::<4>(0) + self.target.gain() * acceleration;
        Vector6::new(moved[0], moved[1], moved[2], moved[3], acceleration[0], acceleration[1])
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &Vector6<f64>) -> Vector6<f64> {
        let acceleration = Vector2::new(self.next(rng, state[4]), self.next(rng, state[5]));
        let own = Vector4::new(state[0], state[1], state[2], state[3]);
        let moved = self.target.moved(rng, &own, &acceleration);
        Vector6::new(moved[0], moved[1], moved[2], moved[3], acceleration[0], acceleration[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_filters::{ImmBelief, StateFilter, assumed_density};
    use fewbits_monte_carlo::Stream;

    #[test]
    fn particles_with_manoeuvres_have_their_mean() {
        let mut rng = Stream::new(5).rng();
        let state = Vector6::new(1.0, 2.0, 0.3, -0.6, 0.1, -0.1);
        for k in [0, 1] {
            let target = WithManoeuvre::at(Target::printed().unwrap(), k);
            let mean = Dynamics::mean(&target, &state);
            for d in 0..6 {
                let draws = (0..20_000).map(|_| target.propagate(&mut rng, &state)[d]);
                let moments: fewbits_monte_carlo::Moments = draws.collect();
                assert!(moments.estimate().z_score(mean[d]).abs() < 4.0, "{k} {d}");
            }
        }
    }

    #[test]
    fn a_track_has_the_moments_of_its_prediction() {
        let target = Target::printed().unwrap();
        let start = Gaussian::known(Vector4::new(1.0, 2.0, 0.5, -0.5)).unwrap();
        let predicted = target.predict(&start, 0, Manoeuvres::AsNoise);
        let mut rng = Stream::new(6).rng();
        let mut spread = fewbits_monte_carlo::Moments::default();
        for _ in 0..20_000 {
            let x = target.simulate(&mut rng, start.mean(), 1)[0];
            spread.add((x[2] - predicted.mean()[2]).powi(2));
        }
        assert!(spread.estimate().z_score(predicted.covariance()[(2, 2)]).abs() < 4.0);
        assert!(target.simulate(&mut rng, start.mean(), 0).is_empty());
    }

    /// The nine modes are the same world: their moments are those of manoeuvres as noise, their probabilities the chain's laws.
    #[test]
    fn modes_have_the_moments_of_the_target() {
        let target = Target::printed().unwrap();
        let start = Gaussian::new(Vector4::new(1.0, 2.0, 0.5, -0.5), Matrix4::identity() * 0.04).unwrap();
        let (mut belief, mut rng) = (ImmBelief::agreed(&start, 9).unwrap(), Stream::new(1).rng());
        for k in 0..4 {
            let (models, mut filter) = target.modes(k).unwrap();
            filter.predict(&mut rng, &models, &mut belief).unwrap();
            let law = target.chain().law(k);
            for (mode, p) in belief.probabilities().iter().enumerate() {
                assert!((p - law[mode / 3] * law[mode % 3]).abs() < 1e-14, "{k} {mode}");
            }
            let motion = target.motion(k, Manoeuvres::AsNoise).unwrap();
            if k == 0 {
                let (own, expected) = (belief.moment_matched(), assumed_density::predict(&motion, &start));
                assert!((own.mean() - expected.mean()).amax() < 1e-14);
                assert!((own.covariance() - expected.covariance()).amax() < 1e-14);
                assert_eq!(expected.mean(), target.predict(&start, k, Manoeuvres::AsNoise).mean());
            }
        }
    }
}
