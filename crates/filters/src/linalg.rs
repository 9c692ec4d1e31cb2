//! Linear systems with covariances that may be singular.

use crate::Error;
use fewbits_numerics::linalg::semidefinite_factor;
use nalgebra::{Cholesky, Const, SMatrix};

/// Share of a variance below which a Cholesky pivot is rounding.
const PIVOT: f64 = 1e-11;

/// Solves `S X = B` for a covariance `S` and columns of `B` in its range, in the sense of the pseudo-inverse where `S` is
/// singular to rounding. Rows are scaled by their standard deviations first, so that no unit matters.
pub(crate) fn solve_semidefinite<const D: usize, const N: usize>(
    covariance: &SMatrix<f64, D, D>,
    right: &SMatrix<f64, D, N>,
) -> Result<SMatrix<f64, D, N>, Error> {
    if D == 1 {
        let v = covariance[0];
        return Ok(if v > 0.0 { right / v } else { SMatrix::zeros() });
    }
    let scale = covariance
        .diagonal()
        .map(|v| if v > 0.0 { 1.0 / v.sqrt() } else { 0.0 });
    let scaled = SMatrix::from_fn(|i, j| covariance[(i, j)] * scale[i] * scale[j]);
    let right = SMatrix::<f64, D, N>::from_fn(|i, j| right[(i, j)] * scale[i]);
    let sound = |f: &Cholesky<f64, Const<D>>| f.l_dirty().diagonal().iter().all(|d| d * d > PIVOT);
    let regular = Cholesky::new(scaled).filter(sound);
    let solution = match regular {
        Some(factor) => factor.solve(&right),
        None => {
            // S = L L' with r independent columns, so S^+ = L (L'L)^-2 L'; ones stand in for the columns beyond the rank.
            let mut factor = semidefinite_factor("covariance", &scaled)?;
            let mut unit = SMatrix::<f64, D, D>::zeros();
            for i in 0..D {
                if factor.column(i).norm_squared() <= PIVOT {
                    factor.column_mut(i).fill(0.0);
                    unit[(i, i)] = 1.0;
                }
            }
            let gram = Cholesky::new(factor.transpose() * factor + unit).ok_or(Error::SingularInnovation)?;
            factor * gram.solve(&gram.solve(&(factor.transpose() * right)))
        }
    };
    Ok(SMatrix::from_fn(|i, j| solution[(i, j)] * scale[i]))
}
