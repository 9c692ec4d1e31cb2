//! Linear sensing with Gaussian noise.

use crate::Error;
use fewbits_core::error::{all_finite, finite, positive};
use nalgebra::{Cholesky, SMatrix, SVector};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// One sensor of a `D`-dimensional state: `z = h'x + w`, `w ~ N(0, r)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarSensing<const D: usize> {
    direction: SVector<f64, D>,
    noise_variance: f64,
}

impl<const D: usize> ScalarSensing<D> {
    /// The sensor with direction `h` and noise variance `r > 0` (measurement units squared).
    ///
    /// # Errors
    /// Entries that are not finite, a variance that is not positive.
    pub fn new(direction: SVector<f64, D>, noise_variance: f64) -> Result<Self, Error> {
        all_finite("direction", direction.as_slice())?;
        Ok(Self {
            direction,
            noise_variance: positive("noise_variance", noise_variance)?,
        })
    }

    /// `h`.
    pub fn direction(&self) -> &SVector<f64, D> {
        &self.direction
    }

    /// `r`.
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// The measurement without noise, `h'x`.
    #[inline]
    pub fn predict(&self, state: &SVector<f64, D>) -> f64 {
        self.direction.dot(state)
    }

    /// A noisy measurement.
    #[inline]
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> f64 {
        let normal: f64 = StandardNormal.sample(rng);
        self.predict(state) + self.noise_variance.sqrt() * normal
    }
}

impl ScalarSensing<1> {
    /// Sensing of a scalar state as it is: `z = x + w`.
    ///
    /// # Errors
    /// A variance that is not positive.
    pub fn direct(noise_variance: f64) -> Result<Self, Error> {
        Self::new(SVector::repeat(1.0), noise_variance)
    }
}

/// `M` measurements of a `D`-dimensional state at once: `z = H x + w`, `w ~ N(0, R)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearSensing<const D: usize, const M: usize> {
    matrix: SMatrix<f64, M, D>,
    noise_covariance: SMatrix<f64, M, M>,
    noise_factor: SMatrix<f64, M, M>,
}

impl<const D: usize, const M: usize> LinearSensing<D, M> {
    /// The sensors with matrix `H` (M x D) and noise covariance `R` (M x M), symmetric positive definite.
    ///
    /// # Errors
    /// Entries that are not finite; [`Error::NotCovariance`].
    pub fn new(
        matrix: SMatrix<f64, M, D>,
        noise_covariance: SMatrix<f64, M, M>,
    ) -> Result<Self, Error> {
        all_finite("matrix", matrix.as_slice())?;
        all_finite("noise_covariance", noise_covariance.as_slice())?;
        let refusal = Error::NotCovariance {
            name: "noise_covariance",
            kind: "definite",
        };
        if (noise_covariance - noise_covariance.transpose()).amax()
            > 1e-12 * noise_covariance.amax()
        {
            return Err(refusal);
        }
        let noise_factor = Cholesky::new(noise_covariance).ok_or(refusal)?.unpack();
        Ok(Self {
            matrix,
            noise_covariance,
            noise_factor,
        })
    }

    /// `H`.
    pub fn matrix(&self) -> &SMatrix<f64, M, D> {
        &self.matrix
    }

    /// `R`.
    pub fn noise_covariance(&self) -> &SMatrix<f64, M, M> {
        &self.noise_covariance
    }

    /// The lower Cholesky factor of `R`.
    pub fn noise_factor(&self) -> &SMatrix<f64, M, M> {
        &self.noise_factor
    }

    /// The measurements without noise, `H x`.
    #[inline]
    pub fn predict(&self, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.matrix * state
    }

    /// Noisy measurements.
    #[inline]
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.predict(state)
            + self.noise_factor * SVector::<f64, M>::from_fn(|_, _| StandardNormal.sample(rng))
    }
}

impl<const D: usize> From<ScalarSensing<D>> for LinearSensing<D, 1> {
    fn from(sensor: ScalarSensing<D>) -> Self {
        let variance = sensor.noise_variance;
        Self {
            matrix: sensor.direction.transpose(),
            noise_covariance: SMatrix::from_element(variance),
            noise_factor: SMatrix::from_element(variance.sqrt()),
        }
    }
}

impl<const D: usize> TryFrom<LinearSensing<D, 1>> for ScalarSensing<D> {
    type Error = Error;

    fn try_from(sensors: LinearSensing<D, 1>) -> Result<Self, Error> {
        Self::new(
            sensors.matrix.transpose(),
            finite("noise_covariance", sensors.noise_covariance[(0, 0)])?,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{LinearSensing, ScalarSensing};
    use nalgebra::{Matrix1x2, Matrix2, Vector2};
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn scalar_and_vector_forms_are_one_sensor() {
        let scalar = ScalarSensing::new(Vector2::new(2.0, -1.0), 0.25).unwrap();
        let vector = LinearSensing::from(scalar);
        let state = Vector2::new(3.0, 1.0);
        let (mut a, mut b) = (Pcg64Mcg::seed_from_u64(3), Pcg64Mcg::seed_from_u64(3));
        assert_eq!(
            vector.sample(&mut a, &state)[0],
            scalar.sample(&mut b, &state)
        );
        assert_eq!(ScalarSensing::try_from(vector).unwrap(), scalar);
        assert_eq!(*vector.matrix(), Matrix1x2::new(2.0, -1.0));
    }

    #[test]
    fn correlated_noise_is_drawn_with_its_covariance() {
        let covariance = Matrix2::new(2.0, 0.9, 0.9, 1.0);
        let sensors = LinearSensing::new(Matrix2::identity(), covariance).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(9);
        let n = 20_000;
        let sum: Matrix2<f64> = (0..n)
            .map(|_| sensors.sample(&mut rng, &Vector2::zeros()))
            .map(|w| w * w.transpose())
            .sum();
        assert!((sum / f64::from(n) - covariance).amax() < 4.5 * 2.0 * (2.0 / f64::from(n)).sqrt());
    }

    #[test]
    fn refuses_bad_noise() {
        assert!(ScalarSensing::<1>::direct(0.0).is_err());
        assert!(ScalarSensing::new(Vector2::new(f64::NAN, 0.0), 1.0).is_err());
        for bad in [
            Matrix2::new(1.0, 2.0, 2.0, 1.0),
            Matrix2::new(1.0, 0.2, 0.1, 1.0),
            Matrix2::zeros(),
        ] {
            assert!(LinearSensing::new(Matrix2::identity(), bad).is_err());
        }
    }
}
