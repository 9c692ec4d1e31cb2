//! A target that manoeuvres: constant velocity, pushed by white noise and by an acceleration that jumps between three values.

use crate::Error;
use crate::error::refuse;
use fewbits_core::{Dynamics, Gaussian};
use fewbits_models::LinearGaussian;
use fewbits_numerics::error::{non_negative, positive, probabilities};
use fewbits_numerics::stored;
use nalgebra::{Matrix4, Matrix4x2, SVector, Vector2, Vector4, Vector6};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// The acceleration of one axis: an independent Markov chain on `(0, +g, -g)`, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredChain", into = "StoredChain")]
pub struct AccelerationChain {
    magnitude: f64,
    initial: [f64; 3],
    transition: [[f64; 3]; 3],
}

stored! { AccelerationChain as StoredChain |chain| {
    magnitude: f64 = chain.magnitude,
    initial: [f64; 3] = chain.initial,
    transition: [[f64; 3]; 3] = chain.transition,
} => AccelerationChain::new(magnitude, initial, transition), Error }

impl AccelerationChain {
    /// A chain with accelerations `0`, `+magnitude`, `-magnitude` (length per time squared), the law `initial` of the one that
    /// acts on the first step, and the rows of `transition` for "from".
    ///
    /// # Errors
    /// If the magnitude is negative, or a law does not sum to one within `1e-9`.
    pub fn new(magnitude: f64, initial: [f64; 3], transition: [[f64; 3]; 3]) -> Result<Self, Error> {
        non_negative("magnitude", magnitude)?;
        probabilities("initial", &initial)?;
        for row in &transition {
            probabilities("transition", row)?;
        }
        Ok(Self {
            magnitude,
            initial,
            transition,
        })
    }

    /// The printed chain for accelerations of the given magnitude.
    ///
    /// # Errors
    /// If the magnitude is negative.
    pub fn printed(magnitude: f64) -> Result<Self, Error> {
        Self::new(magnitude, [0.7, 0.15, 0.15], [[0.6, 0.2, 0.2], [0.4, 0.5, 0.1], [0.4, 0.1, 0.5]])
    }

    /// `g`.
    pub fn magnitude(&self) -> f64 {
        self.magnitude
    }

    /// The three accelerations.
    pub fn values(&self) -> [f64; 3] {
        [0.0, self.magnitude, -self.magnitude]
    }

    /// Law of the acceleration that acts on step `k`, counted from zero: `Pr_0 Tr^k`, in `O(log k)`.
    pub fn law(&self, k: usize) -> [f64; 3] {
        // The bits of `k`, lowest first: at bit `b` the transition is `Tr^(2^b)`.
        let (mut law, mut transition, mut left) = (self.initial, self.transition, k);
        while left > 0 {
            if left & 1 == 1 {
                law = times(&law, &transition);
            }
            transition = transition.map(|row| times(&row, &transition));
            left >>= 1;
        }
        law
    }

    /// Mean and variance of the acceleration that acts on step `k`.
    pub fn moments(&self, k: usize) -> (f64, f64) {
        let [_, up, down] = self.law(k);
        let mean = self.magnitude * (up - down);
        // Summed as positives: the variance cannot fall below zero.
        let rest = (1.0 - up - down).max(0.0);
        let (over, under) = (self.magnitude - mean, self.magnitude + mean);
        (mean, rest * mean * mean + up * over * over + down * under * under)
    }

    /// A draw from the law of step `k`.
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R, k: usize) -> f64 {
        draw(rng, &self.law(k), &self.values())
    }

    /// The acceleration that follows `now` (one of the three; anything else counts as the nearest).
    pub fn next<R: Rng + ?Sized>(&self, rng: &mut R, now: f64) -> f64 {
        let from = if now > 0.5 * self.magnitude {
            1
        } else if now < -0.5 * self.magnitude {
            2
        } else {
            0
        };
        draw(rng, &self.transition[from], &self.values())
    }
}

/// `row matrix`, scaled to sum to one as both do: squared again and again, rounding would take it away.
fn times(row: &[f64; 3], matrix: &[[f64; 3]; 3]) -> [f64; 3] {
    let product: [f64; 3] = std::array::from_fn(|j| (0..3).map(|i| row[i] * matrix[i][j]).sum());
    let total: f64 = product.iter().sum();
    product.map(|p| p / total)
}

fn draw<R: Rng + ?Sized>(rng: &mut R, law: &[f64; 3], values: &[f64; 3]) -> f64 {
    let u: f64 = rng.random();
    if u < law[0] {
        values[0]
    } else if u < law[0] + law[1] {
        values[1]
    } else {
        values[2]
    }
}

/// The target: state `[x, y, vx, vy]`, `X_k = F X_{k-1} + G a_k + G u_k`, `F = [[1, ts], [0, 1]]` and `G = [ts^2/2, ts]'` on each
/// axis, `u ~ N(0, q)`, `a` of an [`AccelerationChain`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredTarget", into = "StoredTarget")]
pub struct Target {
    interval: f64,
    noise_variance: f64,
    chain: AccelerationChain,
}

#[derive(Serialize, Deserialize)]
#[serde(rename = "Target", deny_unknown_fields)]
struct StoredTarget {
    interval: f64,
    noise_variance: f64,
    chain: AccelerationChain,
}

impl From<Target> for StoredTarget {
    fn from(target: Target) -> Self {
        Self {
            interval: target.interval,
            noise_variance: target.noise_variance,
            chain: target.chain,
        }
    }
}

impl TryFrom<StoredTarget> for Target {
    type Error = Error;

    fn try_from(stored: StoredTarget) -> Result<Self, Error> {
        Self::new(stored.interval, stored.noise_variance, stored.chain)
    }
}

impl Target {
    /// A target observed every `interval`, pushed by white accelerations of variance `noise_variance` per axis.
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

    /// The thesis's: one step a second, `q = 0.02`, `g = 0.1`.
    ///
    /// # Errors
    /// None.
    pub fn printed() -> Result<Self, Error> {
        Self::new(1.0, 0.02, AccelerationChain::printed(0.1)?)
    }

    /// `ts`.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// `q`.
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// The manoeuvres.
    pub fn chain(&self) -> &AccelerationChain {
        &self.chain
    }

    /// `F`.
    pub fn transition(&self) -> Matrix4<f64> {
        let mut f = Matrix4::identity();
        f[(0, 2)] = self.interval;
        f[(1, 3)] = self.interval;
        f
    }

    /// `G`.
    pub fn gain(&self) -> Matrix4x2<f64> {
        let (half, ts) = (0.5 * self.interval * self.interval, self.interval);
        Matrix4x2::new(half, 0.0, 0.0, half, ts, 0.0, 0.0, ts)
    }

    /// The white part with additional variance of the acceleration, as linear dynamics.
    ///
    /// # Errors
    /// If the variance is negative or not finite.
    pub fn dynamics(&self, additional_variance: f64) -> Result<LinearGaussian<4, 2>, Error> {
        non_negative("additional_variance", additional_variance)?;
        let variance = self.noise_variance + additional_variance;
        Ok(LinearGaussian::new(self.transition(), self.gain(), SVector::repeat(variance))?)
    }

    /// Time update of step `k`, counted from zero; manoeuvres count as noise of their mean and variance, or are left out.
    pub fn predict(&self, belief: &Gaussian<4>, k: usize, manoeuvres: Manoeuvres) -> Gaussian<4> {
        let (mean, variance) = match manoeuvres {
            Manoeuvres::Ignored => (0.0, 0.0),
            Manoeuvres::AsNoise => self.chain.moments(k),
        };
        let (f, g) = (self.transition(), self.gain());
        let noise = g * g.transpose() * (self.noise_variance + variance);
        Gaussian::from_trusted_parts(
            f * belief.mean() + g * Vector2::repeat(mean),
            f * belief.covariance() * f.transpose() + noise,
        )
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

    /// A true track of `steps` states after `start`, with manoeuvres that remember; empty for no steps.
    pub fn simulate<R: Rng + ?Sized>(&self, rng: &mut R, start: &Vector4<f64>, steps: usize) -> Vec<Vector4<f64>> {
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

/// What a filter that keeps no memory of manoeuvres takes them for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Manoeuvres {
    /// Nothing: the extended Kalman filter of the thesis.
    Ignored,
    /// White noise of their variance.
    AsNoise,
}

/// The target with the accelerations that acted last as part of the state, `[x, y, vx, vy, ax, ay]`: dynamics of one step for any
/// particle filter, whose particles then remember their manoeuvre. Copies of a resampled particle draw their next acceleration
/// each for itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WithManoeuvre {
    target: Target,
    step: usize,
}

impl WithManoeuvre {
    /// The dynamics of step `k`, counted from zero; all but the first are the same.
    pub fn at(target: Target, k: usize) -> Self {
        Self { target, step: k }
    }

    /// A state before the first step, whose accelerations have no meaning.
    pub fn start(state: &Vector4<f64>) -> Vector6<f64> {
        Vector6::new(state[0], state[1], state[2], state[3], 0.0, 0.0)
    }

    /// The acceleration that acts in this step after `last`.
    pub(crate) fn next<R: Rng + ?Sized>(&self, rng: &mut R, last: f64) -> f64 {
        match self.step {
            0 => self.target.chain.sample(rng, 0),
            _ => self.target.chain.next(rng, last),
        }
    }

    /// Its mean.
    fn expected(&self, last: f64) -> f64 {
        let chain = &self.target.chain;
        let from = chain.values().iter().position(|v| *v == last).unwrap_or(0);
        let law = if self.step == 0 {
            chain.initial
        } else {
            chain.transition[from]
        };
        chain.magnitude * (law[1] - law[2])
    }
}

impl Dynamics<6> for WithManoeuvre {
    fn mean(&self, state: &Vector6<f64>) -> Vector6<f64> {
        let acceleration = Vector2::new(self.expected(state[4]), self.expected(state[5]));
        let moved = self.target.transition() * state.fixed_rows::<4>(0) + self.target.gain() * acceleration;
        Vector6::new(moved[0], moved[1], moved[2], moved[3], acceleration[0], acceleration[1])
    }

    fn propagate<R: Rng + ?Sized>(&self, rng: &mut R, state: &Vector6<f64>) -> Vector6<f64> {
        let acceleration = Vector2::new(self.next(rng, state[4]), self.next(rng, state[5]));
        let own = Vector4::new(state[0], state[1], state[2], state[3]);
        let moved = self.target.moved(rng, &own, &acceleration);
        Vector6::new(moved[0], moved[1], moved[2], moved[3], acceleration[0], acceleration[1])
    }
}

/// Positions of a track, refused if there is none.
///
/// # Errors
/// If the list is empty.
pub(crate) fn at_least_one_sensor(count: usize) -> Result<(), Error> {
    if count == 0 {
        return refuse("sensors", "an empty list", "at least one sensor (three for an unambiguous position)");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_monte_carlo::Stream;

    /// Defect: `law(k)` took `k` products; at 1e8 that is most of a second.
    #[test]
    fn laws_of_any_step_are_powers_of_the_transition() {
        let chain = AccelerationChain::printed(0.1).unwrap();
        let mut naive = chain.law(0);
        for k in 0..40 {
            let law = chain.law(k);
            assert!((0..3).all(|i| (law[i] - naive[i]).abs() < 1e-14), "{k}: {law:?} {naive:?}");
            naive = std::array::from_fn(|j| (0..3).map(|i| naive[i] * chain.transition[i][j]).sum());
        }
        // A chain that alternates has no fixed point: 1, 0, 1, 0 ...
        let swap = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let swapping = AccelerationChain::new(1.0, [1.0, 0.0, 0.0], swap).unwrap();
        assert_eq!((swapping.law(usize::MAX), swapping.law(1 << 60)), ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]));
    }

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

    #[test]
    fn bad_chains_and_intervals_are_refused() {
        let printed = AccelerationChain::printed(0.1).unwrap();
        assert!(Target::new(0.0, 0.02, printed).is_err() && Target::new(1.0, -0.1, printed).is_err());
        assert!(AccelerationChain::new(0.1, [0.7, 0.2, 0.2], printed.transition).is_err());
        assert!(AccelerationChain::new(f64::NAN, printed.initial, printed.transition).is_err());
        let json = serde_json::to_string(&Target::printed().unwrap()).unwrap();
        assert_eq!(serde_json::from_str::<Target>(&json).unwrap(), Target::printed().unwrap());
    }
}
