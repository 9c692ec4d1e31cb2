//! The Gaussian distribution as a belief.

use crate::belief::{Belief, Density};
use crate::columns::{Columns, ColumnsMut, change_each, lengths_agree};
use fewbits_numerics::error::{self, ArgumentError};
use fewbits_numerics::linalg::{semidefinite_factor, symmetrised};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// A normal distribution over a state of `D` coordinates. All Kalman-like estimators use it.
///
/// The covariance is symmetric and positive semidefinite by construction. It may be singular (a state known exactly, process noise of rank
/// one); such a belief has no density.
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
#[serde(try_from = "Moments<D>")]
pub struct Gaussian<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    mean: SVector<f64, D>,
    #[serde(with = "fewbits_numerics::stored")]
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

    /// As [`new`](Self::new) without the checks, for updates that preserve them by construction. The covariance is symmetrised.
    pub fn from_trusted_parts(mean: SVector<f64, D>, covariance: SMatrix<f64, D, D>) -> Self {
        Self {
            mean,
            covariance: symmetrised(&covariance),
        }
    }

    /// As [`new`](Self::new) without the checks, for a covariance that is symmetric to the last bit, as from
    /// [`fewbits_numerics::linalg::congruence`].
    #[inline]
    pub fn from_symmetric_parts(mean: SVector<f64, D>, covariance: SMatrix<f64, D, D>) -> Self {
        Self { mean, covariance }
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

    /// Whether all numbers are finite; an update may overflow.
    #[inline]
    pub fn is_finite(&self) -> bool {
        // Without an early end it is a few vector instructions.
        let finite = |numbers: &[f64]| numbers.iter().fold(true, |finite, x| finite & x.is_finite());
        finite(self.mean.as_slice()) & finite(self.covariance.as_slice())
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

    /// The same belief with its covariance factored once, for repeated densities and draws.
    ///
    /// # Errors
    /// If the covariance is singular.
    pub fn factored(&self) -> Result<FactoredGaussian<D>, ArgumentError> {
        let lower = self.cholesky()?.unpack();
        let log_determinant: f64 = lower.diagonal().iter().map(|d| d.ln()).sum();
        Ok(FactoredGaussian {
            gaussian: *self,
            lower,
            log_peak: -log_determinant - D as f64 * LN_SQRT_2PI,
        })
    }

    /// `ln N(x; mean, covariance)`. For many points use [`Gaussian::factored`].
    ///
    /// # Errors
    /// If the covariance is singular.
    pub fn log_pdf(&self, x: &SVector<f64, D>) -> Result<f64, ArgumentError> {
        Ok(self.factored()?.log_pdf(x))
    }

    /// Normalised estimation error squared (NEES), `(x - mean)' P^-1 (x - mean) / D`: expectation 1 for a consistent belief.
    ///
    /// # Errors
    /// If the covariance is singular.
    pub fn normalised_error_squared(&self, truth: &SVector<f64, D>) -> Result<f64, ArgumentError> {
        let deviation = truth - self.mean;
        Ok(deviation.dot(&self.cholesky()?.solve(&deviation)) / D as f64)
    }

    /// Kullback-Leibler divergence `KL(self || other)` in nats.
    ///
    /// # Errors
    /// If either covariance is singular, or the divergence overflows.
    pub fn kl_divergence(&self, other: &Self) -> Result<f64, ArgumentError> {
        let (own, reference) = (self.cholesky()?, other.cholesky()?);
        let log_ratio: f64 = reference
            .l()
            .diagonal()
            .iter()
            .zip(own.l().diagonal().iter())
            .map(|(r, o)| (r / o).ln())
            .sum();
        // (ln(det R / det P) + tr(R^-1 P) + d' R^-1 d - D) / 2; the diagonals of the factors gave half the first term.
        let trace = reference.solve(&self.covariance).trace();
        let shift = other.mean - self.mean;
        error::finite("divergence", log_ratio + 0.5 * (trace + shift.dot(&reference.solve(&shift)) - D as f64))
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

/// The stored form of [`Gaussian`].
#[derive(Deserialize)]
#[serde(rename = "Gaussian")]
#[serde(deny_unknown_fields)]
struct Moments<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    mean: SVector<f64, D>,
    #[serde(with = "fewbits_numerics::stored")]
    covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> TryFrom<Moments<D>> for Gaussian<D> {
    type Error = ArgumentError;

    fn try_from(parts: Moments<D>) -> Result<Self, ArgumentError> {
        Gaussian::new(parts.mean, parts.covariance)
    }
}

impl<const D: usize> Belief<D> for Gaussian<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance
    }

    /// Singular covariances are allowed. A matrix that is not positive semidefinite (possible only through
    /// [`Gaussian::from_trusted_parts`]) is replaced by its diagonal.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let factor = semidefinite_factor("covariance", &self.covariance)
            .unwrap_or_else(|_| SMatrix::from_diagonal(&self.standard_deviations()));
        sample_normals(rng, &self.mean, &factor, states);
    }
}

/// Fills the columns with `mean + factor * standard normals`.
fn sample_normals<const D: usize, R: Rng + ?Sized>(
    rng: &mut R,
    mean: &SVector<f64, D>,
    factor: &SMatrix<f64, D, D>,
    states: ColumnsMut<'_, D>,
) {
    let mut normals = || SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal));
    change_each(states, |_| mean + factor * normals());
}

/// A [`Gaussian`] of positive definite covariance `P` with its Cholesky factor, for repeated densities and draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FactoredGaussian<const D: usize> {
    gaussian: Gaussian<D>,
    /// `L` with `P = L L'`.
    lower: SMatrix<f64, D, D>,
    log_peak: f64,
}

/// Replaces a squared distance of NaN: infinite if the state has no NaN (it came from a difference of infinities), else NaN.
#[cold]
fn out_of_range(x: &[f64]) -> f64 {
    if x.iter().any(|x| x.is_nan()) {
        f64::NAN
    } else {
        f64::INFINITY
    }
}

impl<const D: usize> FactoredGaussian<D> {
    /// The Gaussian without the factor.
    pub(crate) fn gaussian(&self) -> &Gaussian<D> {
        &self.gaussian
    }

    /// Mean.
    pub fn mean(&self) -> &SVector<f64, D> {
        self.gaussian.mean()
    }

    /// Lower Cholesky factor of the covariance.
    pub fn lower(&self) -> &SMatrix<f64, D, D> {
        &self.lower
    }

    /// The same about another mean, which is finite.
    pub(crate) fn with_mean(self, mean: SVector<f64, D>) -> Self {
        let gaussian = Gaussian { mean, ..self.gaussian };
        Self { gaussian, ..self }
    }

    /// `ln` of the density at the mean.
    pub(crate) fn log_peak(&self) -> f64 {
        self.log_peak
    }

    /// Squared Mahalanobis distance of `x` from the mean; infinite if it overflows.
    #[inline]
    pub fn squared_distance(&self, x: &SVector<f64, D>) -> f64 {
        let mut white = x - self.gaussian.mean;
        let mut sum = 0.0;
        for i in 0..D {
            for j in 0..i {
                white[i] -= self.lower[(i, j)] * white[j];
            }
            white[i] /= self.lower[(i, i)];
            sum += white[i] * white[i];
        }
        if sum.is_nan() { out_of_range(x.as_slice()) } else { sum }
    }

    /// `ln N(x; mean, covariance)`.
    #[inline]
    pub fn log_pdf(&self, x: &SVector<f64, D>) -> f64 {
        self.log_peak - 0.5 * self.squared_distance(x)
    }

    /// Adds `ln N(x; mean, covariance)` of every state to `logs`. Solves with the Cholesky factor for blocks of columns.
    pub(crate) fn add_log_pdfs(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
        const BLOCK: usize = 64;
        if !lengths_agree(states, logs) {
            return;
        }
        let (mut white, mut square) = ([[0.0; BLOCK]; D], [0.0; BLOCK]);
        for (start, logs) in (0..).step_by(BLOCK).zip(logs.chunks_mut(BLOCK)) {
            let count = logs.len();
            square.fill(0.0);
            // Forward substitution with the Cholesky factor, one row at a time for all states of the block.
            for i in 0..D {
                let (solved, rest) = white.split_at_mut(i);
                let Some(row) = rest.first_mut() else { break };
                for (x, state) in row.iter_mut().zip(&states[i][start..start + count]) {
                    *x = state - self.gaussian.mean[i];
                }
                for (j, solved) in solved.iter().enumerate() {
                    let factor = self.lower[(i, j)];
                    row.iter_mut().zip(solved).for_each(|(x, y)| *x -= factor * y);
                }
                let scale = self.lower[(i, i)];
                for (x, square) in row.iter_mut().zip(&mut square) {
                    *x /= scale;
                    *square += *x * *x;
                }
            }
            // A state at infinity gives `inf - inf`; the scalar function distinguishes it from a state of NaN.
            if square[..count].iter().any(|q| q.is_nan()) {
                for (i, q) in square[..count].iter_mut().enumerate().filter(|(_, q)| q.is_nan()) {
                    *q = out_of_range(&states.map(|column| column[start + i]));
                }
            }
            logs.iter_mut()
                .zip(&square)
                .for_each(|(log, q)| *log += self.log_peak - 0.5 * q);
        }
    }
}

impl<const D: usize> Belief<D> for FactoredGaussian<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.gaussian.mean
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.gaussian.covariance
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        sample_normals(rng, &self.gaussian.mean, &self.lower, states);
    }
}

impl<const D: usize> Density<D> for FactoredGaussian<D> {
    fn log_density(&self, state: &SVector<f64, D>) -> f64 {
        self.log_pdf(state)
    }

    fn add_log_densities(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
        self.add_log_pdfs(states, logs);
    }
}
