//! Covariances of Gaussian densities, factored once: Cholesky factor, whitener, determinant.

use crate::error::{ArgumentError, all_finite};
use crate::linear_algebra::tolerances::{SINGULAR, agree};
use nalgebra::{SMatrix, SVector};

/// A positive definite covariance `C = L L'` in the form that densities need.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Factored<const D: usize> {
    /// Lower Cholesky factor `L`. `mean + L z` with standard normal `z` is a draw.
    pub lower: SMatrix<f64, D, D>,
    /// `W = L^-1`: `W (x - mean)` has the identity as its covariance.
    pub whitener: SMatrix<f64, D, D>,
    /// `ln det L`, half the logarithm of the determinant of `C`.
    pub half_log_det: f64,
}

impl<const D: usize> Factored<D> {
    /// Factors a covariance. Its diagonal is scaled to one first, so that the test of definiteness does not depend on units.
    ///
    /// # Errors
    /// If an entry is not finite, the matrix is not symmetric (by the deviations of row and column), or it is not positive definite:
    /// a squared pivot of its correlation matrix is at most 1e-14. The error names the argument `name`.
    pub fn new(name: &'static str, covariance: &SMatrix<f64, D, D>) -> Result<Self, ArgumentError> {
        all_finite(name, covariance.as_slice())?;
        let refuse = |expected| ArgumentError::new(name, format!("{covariance:?}"), expected);
        if covariance.diagonal().iter().any(|v| *v <= 0.0) {
            return Err(refuse("a positive definite matrix"));
        }
        let scale = covariance.diagonal().map(f64::sqrt);
        for i in 0..D {
            for j in 0..i {
                if !agree(covariance[(i, j)], covariance[(j, i)], scale[i], scale[j]) {
                    return Err(refuse("a symmetric matrix"));
                }
            }
        }
        Self::scaled(covariance, &scale).ok_or_else(|| refuse("a positive definite matrix"))
    }

    fn scaled(covariance: &SMatrix<f64, D, D>, scale: &SVector<f64, D>) -> Option<Self> {
        // The Cholesky factor of the correlation matrix, column by column; its rows are then multiplied by the deviations.
        let mut lower = SMatrix::<f64, D, D>::zeros();
        for j in 0..D {
            let mut pivot = 1.0;
            for k in 0..j {
                pivot -= lower[(j, k)] * lower[(j, k)];
            }
            // Written so that NaN is refused too.
            if !matches!(pivot.partial_cmp(&SINGULAR), Some(std::cmp::Ordering::Greater)) {
                return None;
            }
            let root = pivot.sqrt();
            lower[(j, j)] = root;
            for i in j + 1..D {
                let mut entry =
                    0.5 * (covariance[(i, j)] / scale[i] / scale[j] + covariance[(j, i)] / scale[i] / scale[j]);
                for k in 0..j {
                    entry -= lower[(i, k)] * lower[(j, k)];
                }
                lower[(i, j)] = entry / root;
            }
        }
        for i in 0..D {
            for j in 0..=i {
                lower[(i, j)] *= scale[i];
            }
        }
        Some(Self::from_lower(lower))
    }

    /// The factored covariance `L L'` from a lower triangular `L` with a positive diagonal.
    pub fn from_lower(lower: SMatrix<f64, D, D>) -> Self {
        let mut whitener = SMatrix::<f64, D, D>::zeros();
        let mut half_log_det = 0.0;
        // L W = I by forward substitution, column by column.
        for j in 0..D {
            half_log_det += lower[(j, j)].ln();
            whitener[(j, j)] = 1.0 / lower[(j, j)];
            for i in j + 1..D {
                let mut sum = 0.0;
                for k in j..i {
                    sum += lower[(i, k)] * whitener[(k, j)];
                }
                whitener[(i, j)] = -sum / lower[(i, i)];
            }
        }
        Self {
            lower,
            whitener,
            half_log_det,
        }
    }

    /// `x' C^-1 x`: the squared Mahalanobis length of `x`.
    #[inline]
    pub fn squared(&self, x: &SVector<f64, D>) -> f64 {
        let mut total = 0.0;
        for i in 0..D {
            let mut z = 0.0;
            for j in 0..=i {
                z += self.whitener[(i, j)] * x[j];
            }
            total += z * z;
        }
        total
    }

    /// Writes `offset - (x - mean)' C^-1 (x - mean) / 2` of every point `x` to `out`. `columns[d][i]` is coordinate `d` of point `i`.
    /// Call it inside [`vectorised`](crate::kernels::vectorised): it consists of plain loops over columns.
    #[inline(always)]
    pub fn log_forms(&self, mean: &SVector<f64, D>, offset: f64, columns: &[&[f64]; D], out: &mut [f64]) {
        const BLOCK: usize = 256;
        let mut buffer = [0.0; BLOCK];
        for (block, out) in out.chunks_mut(BLOCK).enumerate() {
            let from = block * BLOCK;
            let z = &mut buffer[..out.len()];
            out.fill(offset);
            for i in 0..D {
                // Coordinate i of W (x - mean) of all points of the block; half its square is subtracted.
                z.fill(0.0);
                for j in 0..=i {
                    let (w, m) = (self.whitener[(i, j)], mean[j]);
                    for (z, x) in z.iter_mut().zip(&columns[j][from..]) {
                        *z += w * (x - m);
                    }
                }
                for (out, z) in out.iter_mut().zip(z.iter()) {
                    *out -= 0.5 * z * z;
                }
            }
        }
    }
}

/// `ln det C / 2` of a positive definite matrix; `-inf` if it is not positive definite to working precision.
pub fn half_log_det<const D: usize>(covariance: &SMatrix<f64, D, D>) -> f64 {
    let scale = covariance.diagonal().map(f64::sqrt);
    if scale.iter().any(|s| s.is_nan() || *s <= 0.0) {
        return f64::NEG_INFINITY;
    }
    Factored::scaled(covariance, &scale).map_or(f64::NEG_INFINITY, |f| f.half_log_det)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::symmetrised;
    use nalgebra::{Matrix2, Matrix3, Vector3};

    #[test]
    fn units_may_differ_by_eighteen_orders() {
        let c = Matrix2::new(1e12, 0.9e0 * 1e6 * 1e-6, 0.9, 1e-12);
        let f = Factored::new("c", &c).unwrap();
        let rebuilt = f.lower * f.lower.transpose();
        assert!((rebuilt[(0, 0)] / 1e12 - 1.0).abs() < 1e-12 && (rebuilt[(1, 1)] / 1e-12 - 1.0).abs() < 1e-12);
        assert!((f.lower * f.whitener - Matrix2::identity()).amax() < 1e-9);
        assert!((f.half_log_det - 0.5 * (1.0_f64 - 0.81).ln()).abs() < 1e-12);
    }

    #[test]
    fn indefinite_asymmetric_and_infinite_are_refused() {
        for c in [
            Matrix2::new(1.0, 2.0, 2.0, 1.0),
            Matrix2::new(1.0, 0.5, 0.1, 1.0),
            Matrix2::new(0.0, 0.0, 0.0, 1.0),
            Matrix2::new(1.0, f64::NAN, f64::NAN, 1.0),
            Matrix2::new(1.0, 1.0, 1.0, 1.0),
        ] {
            assert!(Factored::new("c", &c).is_err(), "{c:?}");
        }
    }

    /// Defect: one large entry hid an asymmetry, so that draws and gains used different covariances.
    #[test]
    fn definite_matrices_are_judged_by_row_and_column() {
        let asymmetric = Matrix3::new(1.0, 0.9, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1e10);
        assert!(Factored::new("m", &asymmetric).is_err());
        let units = Matrix3::from_diagonal(&Vector3::new(1e-9, 1.0, 1e5));
        let regular = Matrix3::new(2.0, 0.3, -0.4, 0.3 + 1e-12, 1.1, 0.5, -0.4, 0.5, 1.7);
        let matrix = units * regular * units;
        let lower = Factored::new("m", &matrix).unwrap().lower;
        let (matrix, back) = (symmetrised(&matrix), lower * lower.transpose());
        assert!((0..9).all(|k| (back[k] - matrix[k]).abs() <= 1e-14 * matrix[k].abs()));
        for bad in [
            Matrix3::zeros(),
            -Matrix3::identity(),
            Matrix3::from_element(1.0),
            Matrix3::from_element(f64::NAN),
        ] {
            assert!(Factored::new("m", &bad).is_err());
        }
    }
}
