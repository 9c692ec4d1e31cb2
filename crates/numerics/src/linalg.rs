//! What small covariance matrices need beyond nalgebra.

use crate::error::{self, ArgumentError};
use nalgebra::{ArrayStorage, SMatrix, SVector};

/// Pivots below this share of the variance of their own coordinate count as zero.
pub const SEMIDEFINITE_TOLERANCE: f64 = 1e-12;
/// Asymmetries above this share of the standard deviations of their row and column are refused.
pub const SYMMETRY_TOLERANCE: f64 = 1e-9;

/// `(m + m')/2`.
pub fn symmetrised<const D: usize>(m: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    (m + m.transpose()) * 0.5
}

/// `a b'`. Zeros of `b`, of which the matrices of models are full, cost nothing.
#[inline(always)]
pub fn times_transposed<const M: usize, const K: usize, const N: usize>(
    a: &SMatrix<f64, M, K>,
    b: &SMatrix<f64, N, K>,
) -> SMatrix<f64, M, N> {
    let (a, b) = (&a.data.0, &b.data.0);
    let mut out = [[0.0; M]; N];
    for j in 0..N {
        for k in 0..K {
            let factor = b[k][j];
            if factor != 0.0 {
                for i in 0..M {
                    out[j][i] += a[k][i] * factor;
                }
            }
        }
    }
    SMatrix::from_array_storage(ArrayStorage(out))
}

/// `a p a'` of a symmetric `p`, symmetric to the last bit.
#[inline(always)]
pub fn congruence<const M: usize, const D: usize>(
    a: &SMatrix<f64, M, D>,
    p: &SMatrix<f64, D, D>,
) -> SMatrix<f64, M, M> {
    congruence_of(a, &times_transposed(p, a))
}

/// The same from `half = p a'`.
#[inline(always)]
pub fn congruence_of<const M: usize, const D: usize>(
    a: &SMatrix<f64, M, D>,
    half: &SMatrix<f64, D, M>,
) -> SMatrix<f64, M, M> {
    let mut out = times_transposed(&half.transpose(), a);
    for j in 0..M {
        for i in 0..j {
            out[(i, j)] = out[(j, i)];
        }
    }
    out
}

/// A square root `S` with `S S' = m` of a symmetric positive **semi**definite matrix, by Cholesky with diagonal pivoting.
///
/// Unlike a plain Cholesky factor it exists for singular matrices (rank-1 process noise, a known start). The matrix is scaled
/// to a unit diagonal first and every judgement (symmetry, rank, definiteness) is made on that correlation matrix: a
/// coordinate in metres and one in nanoseconds both survive, and so do `diag(1e8, 1e-5)` and its like.
///
/// # Errors
/// If `m` has an entry that is not finite, is not symmetric, or is not positive semidefinite: a negative variance, a
/// covariance beside a variance of zero, or a correlation matrix with an eigenvalue clearly below zero.
pub fn semidefinite_factor<const D: usize>(
    name: &'static str,
    m: &SMatrix<f64, D, D>,
) -> Result<SMatrix<f64, D, D>, ArgumentError> {
    error::all_finite(name, m.as_slice())?;
    let indefinite = || ArgumentError::new(name, format!("{m:?}"), "a positive semidefinite matrix");
    let deviations: SVector<f64, D> = m.diagonal().map(f64::sqrt);
    // A negative variance has no square root.
    if deviations.iter().any(|d| d.is_nan()) {
        return Err(indefinite());
    }
    let mut rest = SMatrix::<f64, D, D>::zeros();
    for i in 0..D {
        for j in 0..=i {
            let (below, above) = (m[(i, j)], m[(j, i)]);
            if deviations[i] == 0.0 || deviations[j] == 0.0 {
                if below != 0.0 || above != 0.0 {
                    return Err(indefinite());
                }
                continue;
            }
            let (below, above) = (below / deviations[i] / deviations[j], above / deviations[i] / deviations[j]);
            if (below - above).abs() > SYMMETRY_TOLERANCE {
                return Err(ArgumentError::new(name, format!("{m:?}"), "a symmetric matrix"));
            }
            rest[(i, j)] = 0.5 * (below + above);
            rest[(j, i)] = rest[(i, j)];
        }
    }
    let mut factor = SMatrix::<f64, D, D>::zeros();
    for column in 0..D {
        let (pivot, variance) = rest.diagonal().argmax();
        if variance <= SEMIDEFINITE_TOLERANCE {
            // What is left must be zero up to rounding, negative pivots included.
            if rest.amax() > 10.0 * SEMIDEFINITE_TOLERANCE {
                return Err(indefinite());
            }
            break;
        }
        let direction = rest.column(pivot) / variance.sqrt();
        rest -= direction * direction.transpose();
        rest.row_mut(pivot).fill(0.0);
        rest.column_mut(pivot).fill(0.0);
        factor.set_column(column, &direction.component_mul(&deviations));
    }
    Ok(factor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
    use proptest::prelude::*;

    fn close<const D: usize>(m: &SMatrix<f64, D, D>) -> bool {
        let s = semidefinite_factor("m", m).unwrap();
        let back = s * s.transpose();
        (0..D).all(|i| (0..D).all(|j| (back[(i, j)] - m[(i, j)]).abs() <= 1e-11 * m[(i, i)].sqrt() * m[(j, j)].sqrt()))
    }

    #[test]
    fn metres_and_nanoseconds_both_survive() {
        assert!(close(&Matrix2::from_diagonal(&Vector2::new(1e8, 1e-5))));
        assert!(close(&Matrix3::from_diagonal(&Vector3::new(1e6, 1e-18, 0.0))));
        // Position in kilometres, time in nanoseconds, correlated.
        assert!(close(&Matrix2::new(1e-6, 0.9e-12, 0.9e-12, 1e-18)));
        assert!(close(&Matrix2::new(1e300, 1e5, 1e5, 1e-288)));
    }

    #[test]
    fn products_are_nalgebras() {
        let a = SMatrix::<f64, 2, 3>::new(1.0, -2.0, 0.5, 3.0, 0.25, 4.0);
        let p = Matrix3::new(2.0, 0.3, -0.1, 0.3, 1.0, 0.2, -0.1, 0.2, 0.7);
        assert!((times_transposed(&p, &a) - p * a.transpose()).amax() < 1e-15);
        let found = congruence(&a, &p);
        assert!((found - a * p * a.transpose()).amax() < 1e-14);
        assert_eq!(found, found.transpose());
    }

    #[test]
    fn judgements_are_relative_to_their_own_row() {
        let refused = |m: &Matrix3<f64>| semidefinite_factor("m", m).is_err();
        let asymmetric = Matrix3::new(1.0, 0.9, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1e10);
        assert!(refused(&asymmetric));
        assert!(refused(&Matrix3::from_diagonal(&Vector3::new(1e8, -1e-4, 1.0))));
        assert!(refused(&Matrix3::from_diagonal(&Vector3::new(1.0, -1e-300, 1.0))));
        // A correlation of 1.5 between the small coordinates.
        assert!(refused(&Matrix3::new(1e-8, 1.5e-8, 0.0, 1.5e-8, 1e-8, 0.0, 0.0, 0.0, 1e10)));
        // What is known exactly varies with nothing.
        assert!(refused(&Matrix3::new(0.0, 1e-9, 0.0, 1e-9, 1.0, 0.0, 0.0, 0.0, 1.0)));
        assert!(refused(&Matrix3::from_element(f64::NAN)));
    }

    proptest! {
        #[test]
        fn square_roots_of_any_rank_and_unit_multiply_back(
            entries in prop::array::uniform9(-2.0..2.0_f64),
            units in prop::array::uniform3(-12..12_i32),
            rank in 0_usize..=3,
        ) {
            let mut g = Matrix3::from_row_slice(&entries);
            for column in rank..3 {
                g.column_mut(column).fill(0.0);
            }
            let scaling = Matrix3::from_diagonal(&Vector3::from(units.map(|u| 10.0_f64.powi(u))));
            let p = scaling * g * g.transpose() * scaling;
            prop_assert!(close(&symmetrised(&p)));
        }
    }
}
