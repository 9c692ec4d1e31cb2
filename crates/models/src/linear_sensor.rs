//! Linear sensing with Gaussian noise.

use crate::Error;
use fewbits_core::columns::measurements_agree;
use fewbits_core::{Columns, ColumnsMut, LinearSensing, Sensing};
use fewbits_numerics::error::{all_finite, positive};
use fewbits_numerics::factored::Factored;
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// `M` measurements of a `D`-dimensional state: `z = H x + w`, `w ~ N(0, R)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parameters<D, M>")]
pub struct LinearSensor<const D: usize, const M: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    matrix: SMatrix<f64, M, D>,
    #[serde(with = "fewbits_numerics::stored")]
    noise_covariance: SMatrix<f64, M, M>,
    #[serde(skip_serializing)]
    noise_factor: SMatrix<f64, M, M>,
}

/// The stored form of [`LinearSensor`].
#[derive(Deserialize)]
#[serde(rename = "LinearSensor")]
#[serde(deny_unknown_fields)]
struct Parameters<const D: usize, const M: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    matrix: SMatrix<f64, M, D>,
    #[serde(with = "fewbits_numerics::stored")]
    noise_covariance: SMatrix<f64, M, M>,
}

impl<const D: usize, const M: usize> TryFrom<Parameters<D, M>> for LinearSensor<D, M> {
    type Error = Error;

    fn try_from(parts: Parameters<D, M>) -> Result<Self, Error> {
        LinearSensor::new(parts.matrix, parts.noise_covariance)
    }
}

/// One scalar measurement: `z = h'x + w`, `w ~ N(0, r)`.
pub type ScalarSensor<const D: usize> = LinearSensor<D, 1>;

impl<const D: usize, const M: usize> LinearSensor<D, M> {
    /// The sensor with matrix `H` (M x D) and noise covariance `R` (M x M), symmetric positive definite.
    ///
    /// # Errors
    /// If an entry is not finite, or the covariance is not symmetric (relative to the deviations of row and column) positive definite.
    pub fn new(matrix: SMatrix<f64, M, D>, noise_covariance: SMatrix<f64, M, M>) -> Result<Self, Error> {
        all_finite("matrix", matrix.as_slice())?;
        let noise_factor = Factored::new("noise_covariance", &noise_covariance)?.lower;
        Ok(Self {
            matrix,
            noise_covariance: symmetrised(&noise_covariance),
            noise_factor,
        })
    }
}

impl<const D: usize> ScalarSensor<D> {
    /// The sensor with direction `h` and noise variance `r > 0` (measurement units squared).
    ///
    /// # Errors
    /// If an entry is not finite, or the variance is not positive.
    pub fn scalar(direction: SVector<f64, D>, noise_variance: f64) -> Result<Self, Error> {
        let variance = positive("noise_variance", noise_variance)?;
        Self::new(direction.transpose(), SMatrix::from([[variance]]))
    }

    /// Direction `h`.
    #[inline]
    pub fn direction(&self) -> SVector<f64, D> {
        self.matrix.transpose()
    }

    /// Noise variance `r`.
    #[inline]
    pub fn noise_variance(&self) -> f64 {
        self.noise_covariance[0]
    }
}

impl LinearSensor<1, 1> {
    /// Measures a scalar state directly: `z = x + w`.
    ///
    /// # Errors
    /// If the variance is not positive.
    pub fn direct(noise_variance: f64) -> Result<Self, Error> {
        Self::scalar(SVector::from([1.0]), noise_variance)
    }
}

impl<const D: usize, const M: usize> Sensing<D, M> for LinearSensor<D, M> {
    #[inline]
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.matrix * state
    }

    fn jacobian(&self, _: &SVector<f64, D>) -> SMatrix<f64, M, D> {
        self.matrix
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> SMatrix<f64, M, M> {
        self.noise_covariance
    }

    #[inline]
    fn sample(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.matrix * state + self.noise_factor * SVector::<f64, M>::from_fn(|_, _| StandardNormal.sample(rng))
    }

    fn mean_columns(&self, states: &Columns<'_, D>, mut means: ColumnsMut<'_, M>) {
        if !measurements_agree(states, &mut means) {
            return;
        }
        for (k, means) in means.into_iter().enumerate() {
            means.fill(0.0);
            for (entry, column) in self.matrix.row(k).iter().zip(states) {
                // Most entries of a measurement matrix are zero.
                if *entry != 0.0 {
                    for (mean, x) in means.iter_mut().zip(*column) {
                        *mean += entry * x;
                    }
                }
            }
        }
    }
}

impl<const D: usize, const M: usize> LinearSensing<D, M> for LinearSensor<D, M> {
    fn matrix(&self) -> &SMatrix<f64, M, D> {
        &self.matrix
    }

    fn noise_covariance(&self) -> &SMatrix<f64, M, M> {
        &self.noise_covariance
    }
}

#[cfg(test)]
mod tests {
    use super::{LinearSensor, ScalarSensor};
    use fewbits_core::Sensing;
    use nalgebra::{Matrix2, Matrix3, Vector2};

    #[test]
    fn scalar_sensors_read_along_their_direction() {
        let sensor = ScalarSensor::scalar(Vector2::new(2.0, -1.0), 0.25).unwrap();
        assert_eq!(sensor.mean(&Vector2::new(3.0, 1.0))[0], 5.0);
        assert_eq!((sensor.direction(), sensor.noise_variance()), (Vector2::new(2.0, -1.0), 0.25));
        assert_eq!(sensor.noise_factor[0], 0.5);
    }

    #[test]
    fn refuses_bad_noise() {
        assert!(LinearSensor::direct(0.0).is_err());
        assert!(ScalarSensor::scalar(Vector2::new(f64::NAN, 0.0), 1.0).is_err());
        for bad in [
            Matrix2::new(1.0, 2.0, 2.0, 1.0),
            Matrix2::new(1.0, 0.2, 0.1, 1.0),
            Matrix2::zeros(),
        ] {
            assert!(LinearSensor::new(Matrix2::identity(), bad).is_err());
        }
        // A large entry elsewhere must not hide the asymmetry.
        let hidden = Matrix3::new(1.0, 0.9, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1e10);
        assert!(LinearSensor::new(Matrix3::identity(), hidden).is_err());
    }
}
