//! Functions of small covariance matrices that nalgebra does not have.

use crate::error::{self, ArgumentError};
use crate::linear_algebra::tolerances::{NO_DIGITS, NO_VARIANCE, agree};
use nalgebra::{ArrayStorage, Cholesky, Const, SMatrix, SVector};

/// `(m + m')/2`.
pub fn symmetrised<const D: usize>(m: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    // Each entry is halved before adding, since the largest number cannot be doubled. Equal entries are kept, since the smallest cannot be
    // halved.
    m.zip_map(&m.transpose(), |a, b| if a == b { a } else { 0.5 * a + 0.5 * b })
}

/// `a b'`. Zeros of `b`, which are frequent in matrices of models, are skipped.
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

/// `a p a'` of a symmetric `p`, symmetric to the last bit, from `half = p a'`.
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
/// Unlike a plain Cholesky factor it exists for singular matrices too (process noise of rank one, a state known exactly). The matrix is
/// scaled to a unit diagonal first, and symmetry, rank and definiteness are tested on this correlation matrix. The result therefore does
/// not depend on units: `diag(1e8, 1e-5)` keeps full rank.
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
            if !agree(below, above, deviations[i], deviations[j]) {
                return Err(ArgumentError::new(name, format!("{m:?}"), "a symmetric matrix"));
            }
            rest[(i, j)] = 0.5 * (below / deviations[i] / deviations[j] + above / deviations[i] / deviations[j]);
            rest[(j, i)] = rest[(i, j)];
        }
    }
    let mut factor = SMatrix::<f64, D, D>::zeros();
    for column in 0..D {
        let (pivot, variance) = rest.diagonal().argmax();
        if variance <= NO_VARIANCE {
            // The remainder must be zero up to rounding, negative pivots included.
            if rest.amax() > 10.0 * NO_VARIANCE {
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

/// Lower triangular factor of a covariance. The columns of directions without variance are zero.
///
/// Unlike [`semidefinite_factor`] it does not pivot, so it is a continuous function of the covariance: a rounding error does not make
/// draws jump. The argument is not checked.
pub fn triangular_factor<const D: usize>(covariance: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    let mut lower = SMatrix::<f64, D, D>::zeros();
    for j in 0..D {
        let own = covariance[(j, j)];
        let pivot: f64 = own - (0..j).map(|k| lower[(j, k)] * lower[(j, k)]).sum::<f64>();
        if pivot <= NO_VARIANCE * own {
            continue;
        }
        let root = f64::sqrt(pivot);
        lower[(j, j)] = root;
        for i in j + 1..D {
            let rest = covariance[(i, j)] - (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum::<f64>();
            lower[(i, j)] = rest / root;
        }
    }
    lower
}

/// Solves `S X = B` for a covariance `S` and columns of `B` in its range. Where `S` is singular to rounding, the pseudo-inverse is used.
/// Rows are scaled by their standard deviations first, so that the result does not depend on units.
///
/// # Errors
/// If `S` is not a covariance, or if the solution is not finite (an argument is not finite, or a quotient overflows).
pub fn solve_semidefinite<const D: usize, const N: usize>(
    covariance: &SMatrix<f64, D, D>,
    right: &SMatrix<f64, D, N>,
) -> Result<SMatrix<f64, D, N>, ArgumentError> {
    if D == 1 {
        let v = covariance[0];
        return finite_solution(if v > 0.0 { right / v } else { SMatrix::zeros() });
    }
    let scale = covariance
        .diagonal()
        .map(|v| if v > 0.0 { 1.0 / v.sqrt() } else { 0.0 });
    let scaled = SMatrix::from_fn(|i, j| covariance[(i, j)] * scale[i] * scale[j]);
    let right = SMatrix::<f64, D, N>::from_fn(|i, j| right[(i, j)] * scale[i]);
    let sound = |f: &Cholesky<f64, Const<D>>| f.l_dirty().diagonal().iter().all(|d| d * d > NO_DIGITS);
    let regular = Cholesky::new(scaled).filter(sound);
    let solution = match regular {
        Some(factor) => factor.solve(&right),
        None => {
            // S = L L' with r independent columns, so S^+ = L (L'L)^-2 L'; ones stand in for the columns beyond the rank.
            let mut factor = semidefinite_factor("covariance", &scaled)?;
            let mut unit = SMatrix::<f64, D, D>::zeros();
            for i in 0..D {
                if factor.column(i).norm_squared() <= NO_DIGITS {
                    factor.column_mut(i).fill(0.0);
                    unit[(i, i)] = 1.0;
                }
            }
            let gram = Cholesky::new(factor.transpose() * factor + unit).ok_or_else(|| {
                ArgumentError::new("covariance", format!("{covariance:?}"), "a positive semidefinite matrix")
            })?;
            factor * gram.solve(&gram.solve(&(factor.transpose() * right)))
        }
    };
    finite_solution(SMatrix::from_fn(|i, j| solution[(i, j)] * scale[i]))
}

fn finite_solution<const D: usize, const N: usize>(
    solution: SMatrix<f64, D, N>,
) -> Result<SMatrix<f64, D, N>, ArgumentError> {
    error::all_finite("solution", solution.as_slice())?;
    Ok(solution)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix2x3, Matrix3, Matrix3x2, Vector2, Vector3};
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

    /// The coordinates of the three unknowns differ by ten orders of magnitude in their units.
    #[test]
    fn solutions_solve_whatever_the_unit_and_the_rank() {
        let units = Matrix3::from_diagonal(&[1e-5, 1.0, 1e5].into());
        let regular = Matrix3::new(2.0, 0.3, -0.4, 0.3, 1.1, 0.5, -0.4, 0.5, 1.7);
        let columns = Matrix3x2::new(1.0, 0.5, -0.7, 2.0, 0.4, -1.3);
        for (s, solution) in [
            (regular, Matrix3x2::new(0.3, -1.0, 1.9, 0.2, -0.6, 0.8)),
            // Of rank two and one: the minimum-norm solution is looked for in the range.
            (columns * columns.transpose(), Matrix3x2::new(0.3, -1.0, 1.9, 0.2, -0.6, 0.8)),
            (columns.column(0) * columns.column(0).transpose(), Matrix3x2::new(0.3, -1.0, 1.9, 0.2, -0.6, 0.8)),
        ] {
            let (s, right) = (units * s * units, units * s * solution);
            let x = solve_semidefinite(&s, &right).unwrap();
            let off = (s * x - right).component_div(&(units * Matrix3x2::repeat(1.0)));
            assert!(off.amax() < 1e-9, "{off}");
        }
        let line = solve_semidefinite(
            &SMatrix::<f64, 1, 1>::new(4.0),
            &Matrix2x3::repeat(2.0).fixed_view::<1, 3>(0, 0).into(),
        );
        assert_eq!(line.unwrap(), SMatrix::<f64, 1, 3>::repeat(0.5));
        let nothing = solve_semidefinite(&SMatrix::<f64, 1, 1>::new(0.0), &SMatrix::<f64, 1, 1>::new(0.0));
        assert_eq!(nothing.unwrap()[0], 0.0);
    }

    /// Defect: an indefinite matrix beside a column near the largest number gave NaN.
    #[test]
    fn solution_beyond_the_largest_number_is_an_error() {
        let indefinite = Matrix2::new(-1.0, -3.0, -3.0, 0.028);
        assert!(solve_semidefinite(&indefinite, &Vector2::new(-3.0, f64::MIN)).is_err());
        let small = Matrix2::new(1e-10, 0.0, 0.0, 1.0);
        assert!(solve_semidefinite(&small, &Vector2::new(1e300, 1.0)).is_err());
        assert!(solve_semidefinite(&small, &Vector2::new(f64::NAN, 1.0)).is_err());
        assert!(solve_semidefinite(&SMatrix::<f64, 1, 1>::new(0.1), &SMatrix::<f64, 1, 1>::new(f64::MAX)).is_err());
        assert_eq!(solve_semidefinite(&small, &Vector2::new(1e290, 1.0)).unwrap()[1], 1.0);
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
        // A coordinate of variance zero has no covariance with any other.
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
