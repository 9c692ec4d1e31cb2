//! What small covariance matrices need beyond nalgebra.

use crate::error::{self, ArgumentError};
use nalgebra::SMatrix;

/// Pivots below this share of the largest variance count as zero.
pub const SEMIDEFINITE_TOLERANCE: f64 = 1e-12;
/// Asymmetries above this share of the largest entry are refused.
pub const SYMMETRY_TOLERANCE: f64 = 1e-9;

/// `(m + m')/2`.
pub fn symmetrised<const D: usize>(m: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    (m + m.transpose()) * 0.5
}

/// A square root `S` with `S S' = m` of a symmetric positive **semi**definite matrix, by Cholesky with diagonal pivoting.
///
/// Unlike a plain Cholesky factor it exists for singular matrices (rank-1 process noise, a known start).
///
/// # Errors
/// If `m` has an entry that is not finite, is not symmetric, or has an eigenvalue clearly below zero.
pub fn semidefinite_factor<const D: usize>(
    name: &'static str,
    m: &SMatrix<f64, D, D>,
) -> Result<SMatrix<f64, D, D>, ArgumentError> {
    error::all_finite(name, m.as_slice())?;
    let scale = m.amax();
    if (m - m.transpose()).amax() > SYMMETRY_TOLERANCE * scale {
        return Err(ArgumentError::new(name, format!("{m:?}"), "a symmetric matrix"));
    }
    let indefinite = || ArgumentError::new(name, format!("{m:?}"), "a positive semidefinite matrix");
    let tolerance = SEMIDEFINITE_TOLERANCE * scale;
    let mut rest = symmetrised(m);
    let mut factor = SMatrix::zeros();
    for column in 0..D {
        let (pivot, variance) = rest.diagonal().argmax();
        if variance <= tolerance {
            // What is left must be zero up to rounding, negative variances included.
            return if rest.amax() <= 10.0 * tolerance {
                Ok(factor)
            } else {
                Err(indefinite())
            };
        }
        let direction = rest.column(pivot) / variance.sqrt();
        rest -= direction * direction.transpose();
        rest.row_mut(pivot).fill(0.0);
        rest.column_mut(pivot).fill(0.0);
        factor.set_column(column, &direction);
    }
    Ok(factor)
}
