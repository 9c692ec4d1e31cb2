//! Square roots of covariances that may be singular.

use crate::Error;
use fewbits_core::error::all_finite;
use nalgebra::SMatrix;

/// Asymmetry and negative pivots up to this part of the largest diagonal entry count as rounding.
const SEMIDEFINITE_TOLERANCE: f64 = 1e-10;

/// A factor `L` with `L L' = covariance` for a symmetric positive semidefinite matrix of any rank.
///
/// Cholesky with diagonal pivoting; columns beyond the rank are zero. `L` is lower triangular up to a row permutation.
///
/// # Errors
/// Entries that are not finite, asymmetry, or a negative eigenvalue beyond rounding ([`Error::NotCovariance`], which names
/// the argument as `name`).
pub fn semidefinite_factor<const D: usize>(
    name: &'static str,
    covariance: &SMatrix<f64, D, D>,
) -> Result<SMatrix<f64, D, D>, Error> {
    all_finite(name, covariance.as_slice())?;
    let refusal = Error::NotCovariance {
        name,
        kind: "semidefinite",
    };
    let scale = covariance.amax();
    let slack = SEMIDEFINITE_TOLERANCE * scale;
    if (covariance - covariance.transpose()).amax() > slack {
        return Err(refusal);
    }
    let mut rest = *covariance;
    let mut factor = SMatrix::<f64, D, D>::zeros();
    for column in 0..D {
        let pivot = (0..D)
            .max_by(|&i, &j| rest[(i, i)].total_cmp(&rest[(j, j)]))
            .unwrap_or(0);
        let diagonal = rest[(pivot, pivot)];
        if diagonal <= slack {
            break;
        }
        let direction = rest.column(pivot) / diagonal.sqrt();
        factor.set_column(column, &direction);
        rest -= direction * direction.transpose();
        // The pivot's row is exhausted; rounding must not revive it.
        rest.row_mut(pivot).fill(0.0);
        rest.column_mut(pivot).fill(0.0);
    }
    // What is left of a semidefinite matrix is zero.
    if rest.amax() > slack * D as f64 {
        Err(refusal)
    } else {
        Ok(factor)
    }
}

#[cfg(test)]
mod tests {
    use super::semidefinite_factor;
    use nalgebra::{Matrix2, Matrix3, Vector3};

    #[test]
    fn factors_every_rank_and_refuses_the_rest() {
        let (u, v) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.0, 1.0, 3.0));
        for covariance in [
            Matrix3::zeros(),
            u * u.transpose(),
            u * u.transpose() + v * v.transpose(),
            Matrix3::identity() + u * u.transpose(),
        ] {
            let factor = semidefinite_factor("q", &covariance).unwrap();
            assert!((factor * factor.transpose() - covariance).amax() < 1e-12);
        }
        for bad in [
            Matrix2::new(1.0, 2.0, 2.0, 1.0),
            Matrix2::new(0.0, 1.0, 1.0, 0.0),
            Matrix2::new(1.0, 0.5, 0.4, 1.0),
            Matrix2::new(-1.0, 0.0, 0.0, 1.0),
            Matrix2::new(f64::NAN, 0.0, 0.0, 1.0),
        ] {
            assert!(semidefinite_factor("q", &bad).is_err(), "{bad}");
        }
    }
}
