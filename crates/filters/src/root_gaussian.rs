//! A Gaussian as its mean and a triangular root of its covariance.

use crate::Error;
use fewbits_core::{Belief, ColumnsMut, Gaussian};
use fewbits_numerics::error::{all_finite, refuse};
use fewbits_numerics::linalg::semidefinite_factor;
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// `N(mean, L L')` with `L` lower triangular. Updates work on `L`, so the covariance cannot lose definiteness, and variances whose ratio
/// exceeds the digits of a double keep half of them.
///
/// A covariance is a sum of squares: [`add`](Self::add) adds one, by plane rotations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts<D>")]
pub struct RootGaussian<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    mean: SVector<f64, D>,
    #[serde(with = "fewbits_numerics::stored")]
    lower: SMatrix<f64, D, D>,
}

/// The stored form.
#[derive(Deserialize)]
#[serde(rename = "RootGaussian")]
#[serde(deny_unknown_fields)]
struct Parts<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    mean: SVector<f64, D>,
    #[serde(with = "fewbits_numerics::stored")]
    lower: SMatrix<f64, D, D>,
}

impl<const D: usize> TryFrom<Parts<D>> for RootGaussian<D> {
    type Error = Error;

    fn try_from(parts: Parts<D>) -> Result<Self, Error> {
        Self::new(parts.mean, parts.lower)
    }
}

impl<const D: usize> RootGaussian<D> {
    /// The belief with this mean and lower triangular root of the covariance.
    ///
    /// # Errors
    /// If an entry is not finite, or one above the diagonal is not zero.
    pub fn new(mean: SVector<f64, D>, lower: SMatrix<f64, D, D>) -> Result<Self, Error> {
        all_finite("mean", mean.as_slice())?;
        all_finite("lower", lower.as_slice())?;
        if lower != lower.lower_triangle() {
            return refuse("lower", format!("{lower:?}"), "a lower triangular matrix");
        }
        Ok(Self { mean, lower })
    }

    /// The belief with these moments.
    ///
    /// # Errors
    /// If the covariance is not positive semidefinite.
    pub fn from_gaussian(belief: &Gaussian<D>) -> Result<Self, Error> {
        let mut root = Self::known(*belief.mean());
        root.add_covariance("covariance", belief.covariance())?;
        Ok(root)
    }

    /// A state that is known exactly.
    pub(crate) fn known(mean: SVector<f64, D>) -> Self {
        let lower = SMatrix::zeros();
        Self { mean, lower }
    }

    /// Mean.
    pub fn mean(&self) -> &SVector<f64, D> {
        &self.mean
    }

    /// Lower triangular `L` of the covariance `L L'`.
    pub fn lower(&self) -> &SMatrix<f64, D, D> {
        &self.lower
    }

    /// The same belief with its covariance.
    pub fn gaussian(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.mean, self.lower * self.lower.transpose())
    }

    /// Adds `column column'` to the covariance.
    pub fn add(&mut self, mut column: SVector<f64, D>) {
        for j in 0..D {
            let length = self.lower[(j, j)].hypot(column[j]);
            if length == 0.0 {
                continue;
            }
            // The rotation of column j of the root and the new one that makes entry j of the latter zero.
            let (cos, sin) = (self.lower[(j, j)] / length, column[j] / length);
            (self.lower[(j, j)], column[j]) = (length, 0.0);
            for i in j + 1..D {
                let (old, new) = (self.lower[(i, j)], column[i]);
                (self.lower[(i, j)], column[i]) = (cos * old + sin * new, cos * new - sin * old);
            }
        }
    }

    /// Adds a covariance.
    ///
    /// # Errors
    /// If it is not positive semidefinite; the message calls it `name`.
    pub(crate) fn add_covariance(&mut self, name: &'static str, covariance: &SMatrix<f64, D, D>) -> Result<(), Error> {
        let factor = semidefinite_factor(name, covariance)?;
        (0..D).for_each(|j| self.add(factor.column(j).into()));
        Ok(())
    }

    /// Whether mean and covariance are finite.
    pub(crate) fn is_finite(&self) -> bool {
        // Sums of squares: they are infinite first on the diagonal.
        let variances = (0..D).map(|d| self.lower.row(d).norm_squared());
        self.mean.iter().copied().chain(variances).all(f64::is_finite)
    }
}

impl<const D: usize> Belief<D> for RootGaussian<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        *self.gaussian().covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        self.gaussian().sample_columns(rng, states);
    }
}
