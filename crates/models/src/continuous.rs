//! Linear dynamics in continuous time, and their discrete dynamics over any interval.
//!
//! `dx = (A x + b) dt + dW`, `W` white noise of spectral density `Q_c`. Over `t` seconds:
//!
//! ```text
//! F = exp(A t),   g = integral_0^t exp(A s) b ds,   Q = integral_0^t exp(A s) Q_c exp(A s)' ds
//! h = t / 2^k with |A| h <= 1/2:    F, g, Q by their Taylor series in h
//! k doublings:    Q <- Q + F Q F',  g <- g + F g,  F <- F F
//! ```
//! Covariances are sums of positive semidefinite terms: nothing is inverted, and over a long interval a stable model reaches its stationary
//! distribution. (Van Loan's method, the exponential of a matrix of twice the size, contains `exp(-A t)`, which overflows there.)

use crate::Error;
use fewbits_core::{Belief, Dynamics, Evolution, Gaussian, GaussianDynamics};
use fewbits_numerics::error::{ArgumentError, all_finite, finite, non_negative, positive};
use fewbits_numerics::linalg::{congruence, semidefinite_factor, symmetrised};
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// `dx = (A x + b) dt + dW`: linear dynamics in continuous time, driven by white noise `W`.
///
/// Time is in seconds. The spectral density of the noise is in state units squared per second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parameters<D>")]
pub struct ContinuousLinear<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    drift: SMatrix<f64, D, D>,
    #[serde(with = "fewbits_numerics::stored")]
    offset: SVector<f64, D>,
    #[serde(with = "fewbits_numerics::stored")]
    density: SMatrix<f64, D, D>,
}

/// The stored form of [`ContinuousLinear`].
#[derive(Deserialize)]
#[serde(rename = "ContinuousLinear")]
#[serde(deny_unknown_fields)]
struct Parameters<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    drift: SMatrix<f64, D, D>,
    #[serde(with = "fewbits_numerics::stored")]
    offset: SVector<f64, D>,
    #[serde(with = "fewbits_numerics::stored")]
    density: SMatrix<f64, D, D>,
}

impl<const D: usize> TryFrom<Parameters<D>> for ContinuousLinear<D> {
    type Error = Error;

    fn try_from(parts: Parameters<D>) -> Result<Self, Error> {
        ContinuousLinear::new(parts.drift, parts.offset, parts.density)
    }
}

impl<const D: usize> ContinuousLinear<D> {
    /// The model with drift `A` (per second), offset `b` (state per second) and noise density `Q_c` (state squared per second).
    ///
    /// # Errors
    /// If an entry is not finite, or the density is not symmetric positive semidefinite.
    pub fn new(drift: SMatrix<f64, D, D>, offset: SVector<f64, D>, density: SMatrix<f64, D, D>) -> Result<Self, Error> {
        all_finite("drift", drift.as_slice())?;
        all_finite("offset", offset.as_slice())?;
        semidefinite_factor("density", &density)?;
        Ok(Self {
            drift,
            offset,
            density: symmetrised(&density),
        })
    }

    /// Drift `A`, per second.
    pub fn drift(&self) -> &SMatrix<f64, D, D> {
        &self.drift
    }

    /// Offset `b`, in state units per second.
    pub fn offset(&self) -> &SVector<f64, D> {
        &self.offset
    }

    /// Noise density `Q_c`, in state units squared per second.
    pub fn density(&self) -> &SMatrix<f64, D, D> {
        &self.density
    }

    /// The model with these entries of drift and (diagonal) density, and zeros elsewhere.
    fn with_entries(drift: &[(usize, usize, f64)], density: &[(usize, f64)]) -> Result<Self, Error> {
        let (mut a, mut q) = (SMatrix::zeros(), SMatrix::zeros());
        drift.iter().for_each(|(i, j, x)| a[(*i, *j)] = *x);
        density.iter().for_each(|(i, x)| q[(*i, *i)] = *x);
        Self::new(a, SVector::zeros(), q)
    }
}

impl ContinuousLinear<1> {
    /// Ornstein-Uhlenbeck process: `dx = -(x - mean) / time_constant dt + sqrt(2 variance / time_constant) dW`. Its stationary distribution
    /// is `N(mean, variance)`; its autocorrelation is `exp(-t / time_constant)`, times in seconds.
    ///
    /// # Errors
    /// If the mean is not finite, the time constant not above 0, or the variance negative.
    pub fn ornstein_uhlenbeck(mean: f64, time_constant: f64, variance: f64) -> Result<Self, Error> {
        let rate = 1.0 / positive("time_constant", time_constant)?;
        let density = 2.0 * non_negative("variance", variance)? * rate;
        Self::new([[-rate]].into(), [finite("mean", mean)? * rate].into(), [[density]].into())
    }

    /// A random walk: the variance grows by `density` per second.
    ///
    /// # Errors
    /// If the density is negative.
    pub fn random_walk(density: f64) -> Result<Self, Error> {
        Self::with_entries(&[], &[(0, non_negative("density", density)?)])
    }
}

/// Indices of the position in the state of the models in a plane, `[x, x velocity, y, y velocity]`, as in [`crate::constant_velocity_2d`].
pub const PLANE_POSITION: [usize; 2] = [0, 2];

impl ContinuousLinear<2> {
    /// Nearly constant velocity on a line, state `[position, velocity]`, driven by white acceleration of `density` (length squared per
    /// second cubed): `Q = q [[t^3/3, t^2/2], [t^2/2, t]]`. In [`crate::constant_velocity_1d`] the acceleration is instead constant within
    /// a step.
    ///
    /// # Errors
    /// If the density is negative.
    pub fn nearly_constant_velocity(density: f64) -> Result<Self, Error> {
        Self::with_entries(&[(0, 1, 1.0)], &[(1, non_negative("density", density)?)])
    }
}

impl ContinuousLinear<3> {
    /// Nearly constant acceleration on a line, state `[position, velocity, acceleration]`, driven by white jerk of `density` (length
    /// squared per second to the fifth power).
    ///
    /// # Errors
    /// If the density is negative.
    pub fn nearly_constant_acceleration(density: f64) -> Result<Self, Error> {
        Self::with_entries(&[(0, 1, 1.0), (1, 2, 1.0)], &[(2, non_negative("density", density)?)])
    }
}

impl ContinuousLinear<4> {
    /// [`ContinuousLinear::nearly_constant_velocity`] on both axes of a plane: `[x, x velocity, y, y velocity]`.
    ///
    /// # Errors
    /// If the density is negative.
    pub fn nearly_constant_velocity_2d(density: f64) -> Result<Self, Error> {
        let density = non_negative("density", density)?;
        Self::with_entries(&[(0, 1, 1.0), (2, 3, 1.0)], &[(1, density), (3, density)])
    }

    /// Velocities that decay to zero, on both axes of a plane, state `[x, x velocity, y, y velocity]`: each velocity is an
    /// Ornstein-Uhlenbeck process of mean 0, standard deviation `speed` and correlation time `persistence` (seconds).
    ///
    /// # Errors
    /// If the speed is negative or the persistence not above 0.
    pub fn forgotten_velocity_2d(speed: f64, persistence: f64) -> Result<Self, Error> {
        let rate = 1.0 / positive("persistence", persistence)?;
        let density = 2.0 * rate * non_negative("speed", speed)? * speed;
        Self::with_entries(&[(0, 1, 1.0), (1, 1, -rate), (2, 3, 1.0), (3, 3, -rate)], &[(1, density), (3, density)])
    }
}

/// Terms of the Taylor series: with `|A| h <= 1/2` the first that is left out is below `2^-18 / 18!`.
const TERMS: usize = 18;

impl<const D: usize> Evolution<D> for ContinuousLinear<D> {
    fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<D> + '_>, ArgumentError> {
        Ok(Box::new(ContinuousLinear::over(self, seconds)?))
    }
}

impl<const D: usize> ContinuousLinear<D> {
    /// The dynamics over `seconds`, as [`Evolution::over`].
    ///
    /// # Errors
    /// As there.
    pub fn over(&self, seconds: f64) -> Result<AffineGaussian<D>, ArgumentError> {
        non_negative("seconds", seconds)?;
        let identity = SMatrix::<f64, D, D>::identity();
        // The 1-norm (largest column sum) bounds the powers of `A`.
        let norm = (0..D).map(|j| self.drift.column(j).abs().sum()).fold(0.0, f64::max) * seconds;
        finite("seconds", norm)?;
        let doublings = if norm > 0.5 {
            // Not of `2 norm`, which may overflow.
            (norm.log2() + 1.0).ceil() as u32
        } else {
            0
        };
        let h = seconds * 0.5_f64.powi(doublings as i32);

        let (mut transition, mut offset, mut noise) = (identity, SVector::zeros(), SMatrix::zeros());
        let (mut power, mut integrand, mut spread) = (identity, self.offset * h, self.density * h);
        // Taylor series of transition, offset and noise over the short interval h.
        for n in 1..=TERMS {
            // power = (A h)^n / n!, integrand = h (A h)^(n-1) b / n!, spread = h^n / n! (L^(n-1) Q_c) with L X = A X + X A'.
            power = self.drift * power * (h / n as f64);
            transition += power;
            offset += integrand;
            noise += spread;
            integrand = self.drift * integrand * (h / (n + 1) as f64);
            spread = (self.drift * spread + spread * self.drift.transpose()) * (h / (n + 1) as f64);
            // Powers of a chain of integrals are zero from some on, and so are all further terms.
            if power.iter().chain(&integrand).chain(&spread).all(|x| *x == 0.0) {
                break;
            }
        }
        for _ in 0..doublings {
            // Double the interval: x(2h) is the model applied twice.
            noise += congruence(&transition, &noise);
            offset += transition * offset;
            transition *= transition;
        }
        let sound = |x: &f64| x.is_finite();
        if !(transition.iter().all(sound) && offset.iter().all(sound) && noise.iter().all(sound)) {
            return Err(ArgumentError::new("seconds", seconds, "a time over which the state stays a number"));
        }
        Ok(AffineGaussian {
            transition,
            offset,
            noise_covariance: symmetrised(&noise),
        })
    }
}

/// `x' = F x + g + n`, `n ~ N(0, Q)`, with `Q` of any rank.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffineGaussian<const D: usize> {
    transition: SMatrix<f64, D, D>,
    offset: SVector<f64, D>,
    noise_covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> AffineGaussian<D> {
    /// The model with transition `F`, offset `g` and noise covariance `Q`.
    ///
    /// # Errors
    /// If an entry is not finite, or `Q` is not symmetric positive semidefinite.
    pub fn new(
        transition: SMatrix<f64, D, D>,
        offset: SVector<f64, D>,
        noise_covariance: SMatrix<f64, D, D>,
    ) -> Result<Self, ArgumentError> {
        all_finite("transition", transition.as_slice())?;
        all_finite("offset", offset.as_slice())?;
        semidefinite_factor("noise_covariance", &noise_covariance)?;
        Ok(Self {
            transition,
            offset,
            noise_covariance: symmetrised(&noise_covariance),
        })
    }

    /// Transition `F`.
    pub fn transition(&self) -> &SMatrix<f64, D, D> {
        &self.transition
    }

    /// Offset `g`.
    pub fn offset(&self) -> &SVector<f64, D> {
        &self.offset
    }

    /// Noise covariance `Q`, possibly singular.
    pub fn noise_covariance(&self) -> &SMatrix<f64, D, D> {
        &self.noise_covariance
    }
}

impl<const D: usize> Dynamics<D> for AffineGaussian<D> {
    #[inline]
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        self.transition * state + self.offset
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, D> {
        Gaussian::from_symmetric_parts(self.mean(state), self.noise_covariance).sample(rng)
    }

    fn propagate_columns(&self, rng: &mut dyn Rng, states: fewbits_core::ColumnsMut<'_, D>) {
        self.propagate_columns_scaled(rng, 1.0, states);
    }
}

impl<const D: usize> GaussianDynamics<D> for AffineGaussian<D> {
    /// One factorisation for all states.
    fn propagate_columns_scaled(&self, rng: &mut dyn Rng, noise_scale: f64, states: fewbits_core::ColumnsMut<'_, D>) {
        // A covariance that rounding has made indefinite is replaced by its diagonal.
        let factor = semidefinite_factor("noise_covariance", &self.noise_covariance)
            .unwrap_or_else(|_| SMatrix::from_diagonal(&self.noise_covariance.diagonal().map(|v| v.max(0.0).sqrt())))
            * noise_scale.sqrt();
        fewbits_core::columns::change_each(states, |state| {
            let normals =
                SVector::<f64, D>::from_fn(|_, _| rand_distr::Distribution::sample(&rand_distr::StandardNormal, rng));
            self.mean(&state) + factor * normals
        });
    }

    fn jacobian(&self, _: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.transition
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.noise_covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::laws::{dynamics, evolution};
    use nalgebra::{Matrix2, Vector1, Vector2, Vector3, Vector4};

    #[test]
    fn stretches_of_every_model_compose() {
        for stretch in [[1e-3, 2.5], [0.0, 1.0], [40.0, 1e3]] {
            let ou = ContinuousLinear::ornstein_uhlenbeck(3.0, 2.0, 1.5).unwrap();
            evolution::stretches_compose(&ou, stretch, &[Vector1::new(-4.0)], 1e-12).unwrap();
            let walk = ContinuousLinear::random_walk(0.2).unwrap();
            evolution::stretches_compose(&walk, stretch, &[Vector1::new(1.0)], 1e-12).unwrap();
            let velocity = ContinuousLinear::nearly_constant_velocity(0.3).unwrap();
            evolution::stretches_compose(&velocity, stretch, &[Vector2::new(1.0, -2.0)], 1e-12).unwrap();
            let acceleration = ContinuousLinear::nearly_constant_acceleration(0.3).unwrap();
            evolution::stretches_compose(&acceleration, stretch, &[Vector3::new(1.0, -2.0, 0.1)], 1e-12).unwrap();
            let plane = ContinuousLinear::forgotten_velocity_2d(0.8, 6.0).unwrap();
            evolution::stretches_compose(&plane, stretch, &[Vector4::new(1.0, -2.0, 3.0, 0.5)], 1e-12).unwrap();
        }
    }

    #[test]
    fn ornstein_uhlenbeck_has_its_closed_form() {
        let (c, tau, v) = (3.0, 2.0, 1.5);
        let model = ContinuousLinear::ornstein_uhlenbeck(c, tau, v).unwrap();
        for t in [1e-9, 0.1, 1.0, 30.0, 1e6] {
            let (step, a) = (model.over(t).unwrap(), (-t / tau).exp());
            assert!((step.mean(&Vector1::new(-4.0))[0] - (c + a * (-4.0 - c))).abs() < 1e-12);
            let expected = -v * (-2.0 * t / tau).exp_m1();
            assert!((step.noise_covariance()[0] / expected - 1.0).abs() < 1e-12, "{t}");
        }
    }

    #[test]
    fn constant_velocity_has_its_closed_form() {
        for t in [1e-6, 0.5, 1e4] {
            let step = ContinuousLinear::nearly_constant_velocity(0.3)
                .unwrap()
                .over(t)
                .unwrap();
            let expected = Matrix2::new(t * t * t / 3.0, t * t / 2.0, t * t / 2.0, t) * 0.3;
            assert!(step.noise_covariance().component_div(&expected).add_scalar(-1.0).amax() < 1e-13);
            assert_eq!(step.transition()[(0, 1)], t);
        }
    }

    #[test]
    fn forgotten_velocity_has_its_stationary_speed() {
        let step = ContinuousLinear::forgotten_velocity_2d(0.8, 6.0)
            .unwrap()
            .over(1e5)
            .unwrap();
        assert!((step.noise_covariance()[(1, 1)] - 0.64).abs() < 1e-12);
        assert!(step.transition()[(1, 1)].abs() < 1e-300 && (step.transition()[(0, 1)] - 6.0).abs() < 1e-12);
    }

    #[test]
    fn draws_have_mean_and_covariance() {
        let step = ContinuousLinear::forgotten_velocity_2d(0.8, 6.0)
            .unwrap()
            .over(2.0)
            .unwrap();
        let mut rng = <rand_pcg::Pcg64Mcg as rand::SeedableRng>::seed_from_u64(3);
        dynamics::draws_have_the_law(&step, &mut rng, &Vector4::new(1.0, -2.0, 3.0, 0.5), 4000).unwrap();
    }

    #[test]
    fn bad_models_and_times_are_refused() {
        assert!(ContinuousLinear::ornstein_uhlenbeck(0.0, 0.0, 1.0).is_err());
        assert!(ContinuousLinear::ornstein_uhlenbeck(f64::NAN, 1.0, 1.0).is_err());
        assert!(ContinuousLinear::random_walk(-1.0).is_err());
        let growing = ContinuousLinear::new([[1.0]].into(), [0.0].into(), [[1.0]].into()).unwrap();
        for seconds in [-1.0, f64::NAN, f64::INFINITY, 1e5] {
            assert!(growing.over(seconds).is_err(), "{seconds}");
        }
        let decaying = ContinuousLinear::ornstein_uhlenbeck(0.0, 1.0, 1.0).unwrap();
        let mut stored = serde_json::to_value(decaying).unwrap();
        assert_eq!(serde_json::from_value::<ContinuousLinear<1>>(stored.clone()).unwrap(), decaying);
        stored["density"] = stored["drift"].clone();
        assert!(serde_json::from_value::<ContinuousLinear<1>>(stored).is_err());
    }
}
