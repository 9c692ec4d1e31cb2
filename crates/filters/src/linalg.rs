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

#[cfg(test)]
mod tests {
    use super::solve_semidefinite;
    use nalgebra::{Matrix2x3, Matrix3, Matrix3x2, SMatrix};

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
}
