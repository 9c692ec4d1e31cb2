//! The first-order autoregression.

use crate::{Error, LinearGaussian};
use fewbits_core::{ColumnsMut, Dynamics, GaussianDynamics, LinearDynamics};
use fewbits_numerics::error::{finite, non_negative, refuse};
use fewbits_numerics::kernels::{StandardNormals, vectorised};
use nalgebra::{Matrix1, Vector1};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// `x(n) = a x(n-1) + u(n)`, `u ~ N(0, q)`: a scalar that decays towards zero (for `|a| < 1`) and is driven by white noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parameters", into = "Parameters")]
pub struct Ar1 {
    transition: Matrix1<f64>,
    noise_covariance: Matrix1<f64>,
}

/// The stored form of [`Ar1`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    coefficient: f64,
    noise_variance: f64,
}

impl From<Ar1> for Parameters {
    fn from(model: Ar1) -> Self {
        Self {
            coefficient: model.coefficient(),
            noise_variance: model.noise_variance(),
        }
    }
}

impl TryFrom<Parameters> for Ar1 {
    type Error = Error;

    fn try_from(parts: Parameters) -> Result<Self, Error> {
        Ar1::new_unstable(parts.coefficient, parts.noise_variance)
    }
}

impl Ar1 {
    /// The model with coefficient `a` in `[-1, 1]` and noise variance `q >= 0` (state units squared).
    ///
    /// # Errors
    /// If `|a| > 1`; see [`Ar1::new_unstable`].
    pub fn new(coefficient: f64, noise_variance: f64) -> Result<Self, Error> {
        let model = Self::new_unstable(coefficient, noise_variance)?;
        if coefficient.abs() > 1.0 {
            let expected =
                "a number in [-1, 1]: beyond, the state outruns corrections of few bits (`new_unstable` accepts it)";
            return refuse("coefficient", coefficient, expected);
        }
        Ok(model)
    }

    /// As [`new`](Self::new) for any finite coefficient. Most estimators that receive only a few bits cannot follow a state that grows
    /// without bound, so such a model must be asked for by this name.
    ///
    /// # Errors
    /// If the coefficient is not finite, or the variance is negative or not finite.
    pub fn new_unstable(coefficient: f64, noise_variance: f64) -> Result<Self, Error> {
        Ok(Self {
            transition: Matrix1::new(finite("coefficient", coefficient)?),
            noise_covariance: Matrix1::new(non_negative("noise_variance", noise_variance)?),
        })
    }

    /// Coefficient `a`.
    pub fn coefficient(&self) -> f64 {
        self.transition[0]
    }

    /// Noise variance `q`, in state units squared.
    pub fn noise_variance(&self) -> f64 {
        self.noise_covariance[0]
    }

    /// Variance of the next state when that of the present one is `variance`: `a^2 P + q`.
    #[inline]
    pub fn predict_variance(&self, variance: f64) -> f64 {
        self.coefficient() * self.coefficient() * variance + self.noise_variance()
    }

    /// Variance of the stationary distribution, `q / (1 - a^2)`.
    ///
    /// # Errors
    /// [`Error::NoSteadyState`] for `|a| >= 1`, or if it overflows.
    pub fn stationary_variance(&self) -> Result<f64, Error> {
        let a = self.coefficient();
        // The factored form keeps the digits of 1 - a^2 for |a| near 1.
        let variance = self.noise_variance() / ((1.0 - a) * (1.0 + a));
        if a.abs() < 1.0 && variance.is_finite() {
            Ok(variance)
        } else {
            Err(Error::NoSteadyState)
        }
    }
}

impl Dynamics<1> for Ar1 {
    #[inline]
    fn mean(&self, state: &Vector1<f64>) -> Vector1<f64> {
        self.transition * state
    }

    #[inline]
    fn propagate(&self, rng: &mut dyn Rng, state: &Vector1<f64>) -> Vector1<f64> {
        let normal: f64 = StandardNormal.sample(rng);
        Vector1::new(self.coefficient() * state[0] + self.noise_variance().sqrt() * normal)
    }

    fn propagate_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, 1>) {
        self.propagate_columns_scaled(rng, 1.0, states);
    }
}

impl GaussianDynamics<1> for Ar1 {
    fn propagate_columns_scaled(&self, rng: &mut dyn Rng, noise_scale: f64, [states]: ColumnsMut<'_, 1>) {
        const BLOCK: usize = 128;
        let (mut normals, mut draws) = (StandardNormals::new(rng), [0.0; BLOCK]);
        let (coefficient, deviation) = (self.coefficient(), self.noise_variance().sqrt() * noise_scale.sqrt());
        // Draws first, so that the loop over the states has neither calls nor branches.
        for states in states.chunks_mut(BLOCK) {
            normals.fill(&mut draws[..states.len()]);
            vectorised(
                #[inline(always)]
                || {
                    for (x, z) in states.iter_mut().zip(&draws) {
                        *x = coefficient * *x + deviation * z;
                    }
                },
            );
        }
    }

    fn jacobian(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        self.transition
    }

    fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        self.noise_covariance
    }
}

impl LinearDynamics<1> for Ar1 {
    fn transition(&self) -> &Matrix1<f64> {
        &self.transition
    }

    fn noise_covariance(&self) -> &Matrix1<f64> {
        &self.noise_covariance
    }
}

impl From<Ar1> for LinearGaussian<1, 1> {
    fn from(model: Ar1) -> Self {
        Self::from_checked(model.transition, Matrix1::identity(), model.noise_covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::Ar1;
    use crate::{Error, LinearGaussian};

    #[test]
    fn refuses_what_would_explode() {
        assert!(Ar1::new(-1.0, 0.0).is_ok());
        assert!(matches!(Ar1::new(1.2, 0.5), Err(Error::Argument(e)) if e.name == "coefficient" && e.value == "1.2"));
        assert!(Ar1::new_unstable(1.2, 0.5).is_ok());
        for (a, q) in [(f64::NAN, 1.0), (0.5, -1e-9), (f64::INFINITY, 1.0), (0.5, f64::NAN)] {
            assert!(matches!(Ar1::new_unstable(a, q), Err(Error::Argument(_))));
        }
        assert_eq!(Ar1::new(1.0, 1.0).unwrap().stationary_variance(), Err(Error::NoSteadyState));
        assert_eq!(Ar1::new(0.99, 1e307).unwrap().stationary_variance(), Err(Error::NoSteadyState));
    }

    #[test]
    fn stationary_variance_is_the_fixed_point_and_the_vector_models() {
        let model = Ar1::new(-0.97, 0.3).unwrap();
        let variance = model.stationary_variance().unwrap();
        assert!((model.predict_variance(variance) - variance).abs() < 1e-13);
        let same = LinearGaussian::from(model).stationary_covariance().unwrap()[(0, 0)];
        assert!((same - variance).abs() < 1e-12 * variance);
    }
}
