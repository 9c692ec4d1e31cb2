//! The Gaussian belief.

use fewbits_numerics::error::{self, ArgumentError};
use fewbits_numerics::linalg::{semidefinite_factor, symmetrised};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// A normal distribution over a state of `D` coordinates: the belief of every Kalman-like estimator.
///
/// The covariance is symmetric and positive semidefinite by construction; a singular one (a known start, a rank-1 process
/// noise) is a valid belief, though it has no density.
///
/// ```
/// use fewbits_core::Gaussian;
/// use nalgebra::{SMatrix, SVector};
/// let belief = Gaussian::new(SVector::from([1.0, -2.0]), SMatrix::from_diagonal(&SVector::from([4.0, 0.25])))?;
/// assert_eq!(belief.standard_deviations(), SVector::from([2.0, 0.5]));
/// assert!(Gaussian::scalar(0.0, -1.0).is_err());
/// # Ok::<(), fewbits_numerics::ArgumentError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gaussian<const D: usize> {
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> Gaussian<D> {
    /// A belief with the given mean and covariance.
    ///
    /// # Errors
    /// If an entry is not finite, or the covariance is not symmetric positive semidefinite (a relative `1e-12` is forgiven).
    pub fn new(mean: SVector<f64, D>, covariance: SMatrix<f64, D, D>) -> Result<Self, ArgumentError> {
        error::all_finite("mean", mean.as_slice())?;
        semidefinite_factor("covariance", &covariance)?;
        Ok(Self {
            mean,
            covariance: symmetrised(&covariance),
        })
    }

    /// The same without the checks, for updates that preserve them by construction. The covariance is symmetrised.
    pub fn from_trusted_parts(mean: SVector<f64, D>, covariance: SMatrix<f64, D, D>) -> Self {
        Self {
            mean,
            covariance: symmetrised(&covariance),
        }
    }

    /// A state that is known exactly: zero covariance.
    pub fn known(mean: SVector<f64, D>) -> Result<Self, ArgumentError> {
        Self::new(mean, SMatrix::zeros())
    }

    /// Mean.
    pub fn mean(&self) -> &SVector<f64, D> {
        &self.mean
    }

    /// Covariance.
    pub fn covariance(&self) -> &SMatrix<f64, D, D> {
        &self.covariance
    }

    /// Square roots of the variances.
    pub fn standard_deviations(&self) -> SVector<f64, D> {
        self.covariance.diagonal().map(|v| v.max(0.0).sqrt())
    }

    /// Cholesky factor of the covariance.
    ///
    /// # Errors
    /// If the covariance is singular.
    pub fn cholesky(&self) -> Result<Cholesky<f64, Const<D>>, ArgumentError> {
        Cholesky::new(self.covariance)
            .ok_or_else(|| ArgumentError::new("covariance", "singular", "a positive definite matrix"))
    }

    /// `ln N(x; mean, covariance)`.
    ///
    /// # Errors
    /// If the covariance is singular.
    pub fn log_pdf(&self, x: &SVector<f64, D>) -> Result<f64, ArgumentError> {
        let factor = self.cholesky()?;
        let log_determinant: f64 = factor.l().diagonal().iter().map(|d| d.ln()).sum();
        let deviation = x - self.mean;
        let squared = deviation.dot(&factor.solve(&deviation));
        Ok(-0.5 * squared - log_determinant - D as f64 * LN_SQRT_2PI)
    }

    /// Squared Mahalanobis distance `(x - mean)' P^-1 (x - mean)`: the normalised estimation error squared (NEES) if `x` is
    /// the truth, with expectation `D` for a consistent belief.
    ///
    /// # Errors
    /// If the covariance is singular.
    pub fn mahalanobis_squared(&self, x: &SVector<f64, D>) -> Result<f64, ArgumentError> {
        let deviation = x - self.mean;
        Ok(deviation.dot(&self.cholesky()?.solve(&deviation)))
    }

    /// Normalised estimation error squared, `(x - mean)' P^-1 (x - mean) / D`: expectation 1 for a consistent belief.
    ///
    /// # Errors
    /// If the covariance is singular.
    pub fn normalised_error_squared(&self, truth: &SVector<f64, D>) -> Result<f64, ArgumentError> {
        Ok(self.mahalanobis_squared(truth)? / D as f64)
    }

    /// A draw from the belief; singular covariances are fine.
    ///
    /// # Errors
    /// Never for a belief from [`Gaussian::new`].
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> Result<SVector<f64, D>, ArgumentError> {
        let factor = semidefinite_factor("covariance", &self.covariance)?;
        let z = SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal));
        Ok(self.mean + factor * z)
    }

    /// Kullback-Leibler divergence `KL(self || other)` in nats.
    ///
    /// # Errors
    /// If either covariance is singular.
    pub fn kl_divergence(&self, other: &Self) -> Result<f64, ArgumentError> {
        let (own, reference) = (self.cholesky()?, other.cholesky()?);
        let log_ratio: f64 = reference
            .l()
            .diagonal()
            .iter()
            .zip(own.l().diagonal().iter())
            .map(|(r, o)| (r / o).ln())
            .sum();
        let trace = reference.solve(&self.covariance).trace();
        let shift = other.mean - self.mean;
        Ok(log_ratio + 0.5 * (trace + shift.dot(&reference.solve(&shift)) - D as f64))
    }
}

impl Gaussian<1> {
    /// A scalar belief.
    ///
    /// # Errors
    /// If `mean` is not finite or `variance` is negative or not finite.
    pub fn scalar(mean: f64, variance: f64) -> Result<Self, ArgumentError> {
        error::finite("mean", mean)?;
        error::non_negative("variance", variance)?;
        Ok(Self::from_trusted_parts(SVector::from([mean]), SMatrix::from([[variance]])))
    }
}
