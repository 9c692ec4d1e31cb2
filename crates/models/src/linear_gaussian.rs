//! Linear dynamics driven by Gaussian noise.

use crate::Error;
use fewbits_core::columns::columns_agree;
use fewbits_core::{ColumnsMut, Dynamics, GaussianDynamics, LinearDynamics};
use fewbits_numerics::error::{all_finite, non_negative, refuse};
use fewbits_numerics::kernels::{StandardNormals, vectorised};
use fewbits_numerics::linalg::semidefinite_factor;
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// `x(n) = F x(n-1) + G u(n)` with independent `u_i ~ N(0, q_i)`: `D` state coordinates, `U` independent noise inputs.
///
/// The noise covariance `Q = G diag(q) G'` has rank at most `U`. No function factors or inverts it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parameters<D, U>")]
pub struct LinearGaussian<const D: usize, const U: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    transition: SMatrix<f64, D, D>,
    #[serde(with = "fewbits_numerics::stored")]
    gain: SMatrix<f64, D, U>,
    #[serde(with = "fewbits_numerics::stored")]
    noise_variances: SVector<f64, U>,
    /// `G diag(sqrt q)`, which turns standard normals into process noise.
    #[serde(skip_serializing)]
    noise_factor: SMatrix<f64, D, U>,
    #[serde(skip_serializing)]
    noise_covariance: SMatrix<f64, D, D>,
}

/// The stored form of [`LinearGaussian`].
#[derive(Deserialize)]
#[serde(rename = "LinearGaussian")]
#[serde(deny_unknown_fields)]
struct Parameters<const D: usize, const U: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    transition: SMatrix<f64, D, D>,
    #[serde(with = "fewbits_numerics::stored")]
    gain: SMatrix<f64, D, U>,
    #[serde(with = "fewbits_numerics::stored")]
    noise_variances: SVector<f64, U>,
}

impl<const D: usize, const U: usize> TryFrom<Parameters<D, U>> for LinearGaussian<D, U> {
    type Error = Error;

    fn try_from(parts: Parameters<D, U>) -> Result<Self, Error> {
        LinearGaussian::new(parts.transition, parts.gain, parts.noise_variances)
    }
}

impl<const D: usize, const U: usize> LinearGaussian<D, U> {
    /// The model with transition `F` (D x D), noise gain `G` (D x U) and noise variances `q` (U).
    ///
    /// # Errors
    /// If an entry is not finite, a variance is negative, or the noise covariance overflows.
    pub fn new(
        transition: SMatrix<f64, D, D>,
        gain: SMatrix<f64, D, U>,
        noise_variances: SVector<f64, U>,
    ) -> Result<Self, Error> {
        all_finite("transition", transition.as_slice())?;
        all_finite("gain", gain.as_slice())?;
        for &variance in noise_variances.iter() {
            non_negative("noise_variances", variance)?;
        }
        let model = Self::from_checked(transition, gain, noise_variances);
        if !model.noise_covariance.iter().all(|entry| entry.is_finite()) {
            let expected = "variances whose noise covariance is finite";
            return refuse("noise_variances", format!("{:?}", noise_variances.as_slice()), expected);
        }
        Ok(model)
    }

    pub(crate) fn from_checked(
        transition: SMatrix<f64, D, D>,
        gain: SMatrix<f64, D, U>,
        noise_variances: SVector<f64, U>,
    ) -> Self {
        let noise_factor = SMatrix::from_fn(|i, j| gain[(i, j)] * noise_variances[j].sqrt());
        Self {
            transition,
            gain,
            noise_variances,
            noise_factor,
            noise_covariance: noise_factor * noise_factor.transpose(),
        }
    }

    /// Noise gain `G`.
    pub fn gain(&self) -> &SMatrix<f64, D, U> {
        &self.gain
    }

    /// Noise variances `q`.
    pub fn noise_variances(&self) -> &SVector<f64, U> {
        &self.noise_variances
    }

    /// Covariance of the stationary distribution: the solution of `P = F P F' + Q`.
    ///
    /// Computed by doubling: after `k` rounds `P` holds the first `2^k` terms of `sum F^i Q F'^i`.
    ///
    /// # Errors
    /// [`Error::NoSteadyState`] if an eigenvalue of `F` lies on or outside the unit circle; [`Error::Argument`] if the
    /// covariance overflows.
    pub fn stationary_covariance(&self) -> Result<SMatrix<f64, D, D>, Error> {
        let mut power = self.transition;
        let mut sum = self.noise_covariance;
        // An eigenvalue one rounding unit inside the circle is negligible after 60 squarings.
        for _ in 0..64 {
            sum += power * sum * power.transpose();
            power *= power;
            if !sum.iter().all(|x| x.is_finite()) {
                break;
            }
            let left = power.amax();
            if left < f64::MIN_POSITIVE {
                return Ok(sum * 0.5 + sum.transpose() * 0.5);
            }
            if !left.is_finite() {
                break;
            }
        }
        // Even a stable transition may overflow during the iteration.
        let triangular = (0..D).all(|i| (0..i).all(|j| self.transition[(i, j)] == 0.0));
        if triangular && self.transition.diagonal().amax() < 1.0 {
            let expected = "a transition whose stationary covariance is a number";
            return refuse("transition", format!("{:?}", self.transition), expected);
        }
        Err(Error::NoSteadyState)
    }
}

impl<const D: usize> LinearGaussian<D, D> {
    /// The model with a given noise covariance `Q`, symmetric positive semidefinite of any rank.
    ///
    /// # Errors
    /// If an entry is not finite, or `Q` is not symmetric positive semidefinite.
    pub fn with_covariance(
        transition: SMatrix<f64, D, D>,
        noise_covariance: SMatrix<f64, D, D>,
    ) -> Result<Self, Error> {
        let gain = semidefinite_factor("noise_covariance", &noise_covariance)?;
        Self::new(transition, gain, SVector::repeat(1.0))
    }
}

impl<const D: usize, const U: usize> Dynamics<D> for LinearGaussian<D, U> {
    #[inline]
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        self.transition * state
    }

    #[inline]
    fn propagate(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, D> {
        let normals = SVector::<f64, U>::from_fn(|_, _| StandardNormal.sample(rng));
        self.transition * state + self.noise_factor * normals
    }

    fn propagate_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, D>) {
        self.propagate_columns_scaled(rng, 1.0, states);
    }
}

impl<const D: usize, const U: usize> GaussianDynamics<D> for LinearGaussian<D, U> {
    /// Per block of particles: first the normal draws, then one loop per coordinate, which runs in vector registers.
    fn propagate_columns_scaled(&self, rng: &mut dyn Rng, noise_scale: f64, mut states: ColumnsMut<'_, D>) {
        const BLOCK: usize = 128;
        if !columns_agree(&mut states) {
            return;
        }
        let noise_factor = self.noise_factor * noise_scale.sqrt();
        let mut normals = StandardNormals::new(rng);
        let mut draws = [[0.0; BLOCK]; U];
        let mut next = [[0.0; BLOCK]; D];
        let count = states.first().map_or(0, |column| column.len());
        for start in (0..count).step_by(BLOCK) {
            let length = BLOCK.min(count - start);
            for draw in &mut draws {
                normals.fill(&mut draw[..length]);
            }
            vectorised(
                #[inline(always)]
                || {
                    for (d, next) in next.iter_mut().enumerate() {
                        let next = &mut next[..length];
                        // Row d of `F x + G u` for all states of the block; the columns still hold the old states.
                        next.fill(0.0);
                        for (u, draw) in draws.iter().enumerate() {
                            add_multiple(next, noise_factor[(d, u)], &draw[..length]);
                        }
                        for (c, column) in states.iter().enumerate() {
                            add_multiple(next, self.transition[(d, c)], &column[start..start + length]);
                        }
                    }
                },
            );
            for (column, next) in states.iter_mut().zip(&next) {
                column[start..start + length].copy_from_slice(&next[..length]);
            }
        }
    }

    fn jacobian(&self, _: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.transition
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.noise_covariance
    }
}

impl<const D: usize, const U: usize> LinearDynamics<D> for LinearGaussian<D, U> {
    fn transition(&self) -> &SMatrix<f64, D, D> {
        &self.transition
    }

    fn noise_covariance(&self) -> &SMatrix<f64, D, D> {
        &self.noise_covariance
    }
}

/// `sum += factor x`. Skipped if `factor` is zero, as are most entries of a transition matrix.
#[inline(always)]
fn add_multiple(sum: &mut [f64], factor: f64, x: &[f64]) {
    if factor != 0.0 {
        for (sum, x) in sum.iter_mut().zip(x) {
            *sum += factor * x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::LinearGaussian;
    use crate::Error;
    use fewbits_core::LinearDynamics;
    use nalgebra::{Matrix1, Matrix2, Vector1};

    fn rotation(scale: f64) -> Matrix2<f64> {
        Matrix2::new(0.8, -0.6, 0.6, 0.8) * scale
    }

    #[test]
    fn stationary_covariance_is_a_fixed_point() {
        let q = Matrix2::new(0.3, 0.1, 0.1, 0.2);
        let model = LinearGaussian::with_covariance(rotation(0.99), q).unwrap();
        let covariance = model.stationary_covariance().unwrap();
        let again = model.transition() * covariance * model.transition().transpose() + model.noise_covariance();
        assert!((again - covariance).amax() < 1e-12 * covariance.amax());
        for scale in [1.0, 1.5] {
            let model = LinearGaussian::with_covariance(rotation(scale), q).unwrap();
            assert_eq!(model.stationary_covariance(), Err(Error::NoSteadyState));
        }
        // An overflow must not give NaN.
        let huge = LinearGaussian::with_covariance(Matrix2::new(0.5, 1e200, 0.0, 0.5), q).unwrap();
        assert!(matches!(huge.stationary_covariance(), Err(Error::Argument(_))));
    }

    #[test]
    fn refuses_bad_matrices() {
        let one = Matrix1::new(1.0);
        assert!(LinearGaussian::new(Matrix1::new(f64::NAN), one, Vector1::new(1.0)).is_err());
        assert!(LinearGaussian::new(one, one, Vector1::new(-1.0)).is_err());
        assert!(LinearGaussian::with_covariance(one, Matrix1::new(-1.0)).is_err());
        let error = LinearGaussian::new(one, Matrix1::new(1e154), Vector1::new(2.0)).unwrap_err();
        assert!(error.to_string().contains("noise_variances"), "{error}");
    }
}
