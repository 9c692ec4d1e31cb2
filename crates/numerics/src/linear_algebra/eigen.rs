//! Eigenvalues of small symmetric matrices.

use nalgebra::{SMatrix, SVector};

/// Eigenvalues and eigenvectors (columns, in the order of the eigenvalues) of a symmetric matrix, by Jacobi rotations.
///
/// Suited to the two or three dimensions of a measurement. Small eigenvalues keep their relative accuracy, and callers need none of the
/// bounds on dimensions that nalgebra's solver requires.
pub fn symmetric_eigen<const M: usize>(mut a: SMatrix<f64, M, M>) -> (SVector<f64, M>, SMatrix<f64, M, M>) {
    let mut vectors = SMatrix::<f64, M, M>::identity();
    for _sweep in 0..32 {
        let mut off = 0.0;
        for p in 0..M {
            for q in p + 1..M {
                let entry = a[(p, q)];
                off += entry * entry;
                if entry == 0.0 {
                    continue;
                }
                // The rotation in the plane (p, q) that makes the entry zero; the smaller of the two possible angles.
                let half = (a[(q, q)] - a[(p, p)]) / (2.0 * entry);
                let tangent = half.signum() / (half.abs() + half.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                let sine = tangent * cosine;
                let turn = |x: f64, y: f64| (cosine * x - sine * y, sine * x + cosine * y);
                for k in 0..M {
                    (a[(p, k)], a[(q, k)]) = turn(a[(p, k)], a[(q, k)]);
                }
                for k in 0..M {
                    (a[(k, p)], a[(k, q)]) = turn(a[(k, p)], a[(k, q)]);
                    (vectors[(k, p)], vectors[(k, q)]) = turn(vectors[(k, p)], vectors[(k, q)]);
                }
                a[(p, q)] = 0.0;
                a[(q, p)] = 0.0;
            }
        }
        // All entries off the diagonal were exactly zero in this sweep.
        if off == 0.0 {
            break;
        }
    }
    (a.diagonal(), vectors)
}

/// Raises the eigenvalues of `covariance` to at least one, in coordinates scaled so that the variances `least` are one. Returns
/// `covariance` unchanged if all are at least one already, or if an entry of `least` is not positive: a coordinate without a least
/// variance has no unit to scale by, as a coordinate without spread whose floor is a fraction of its spread.
pub fn raised<const D: usize>(covariance: SMatrix<f64, D, D>, least: &SVector<f64, D>) -> SMatrix<f64, D, D> {
    if least.iter().any(|v| *v <= 0.0) {
        return covariance;
    }
    let scale = least.map(f64::sqrt);
    let scaled = SMatrix::<f64, D, D>::from_fn(|i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let (values, vectors) = symmetric_eigen(scaled);
    if values.iter().all(|v| *v >= 1.0) {
        return covariance;
    }
    // The mean of both triangles is exactly symmetric; the product of three matrices is so only up to rounding.
    let lifted = vectors * SMatrix::from_diagonal(&values.map(|v| v.max(1.0))) * vectors.transpose();
    SMatrix::from_fn(|i, j| 0.5 * (lifted[(i, j)] + lifted[(j, i)]) * scale[i] * scale[j])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn small_eigenvalues_keep_their_digits() {
        let (values, vectors) = symmetric_eigen(Matrix3::new(2.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1e-12));
        let mut sorted = values;
        sorted.as_mut_slice().sort_by(f64::total_cmp);
        assert!((sorted - Vector3::new(1e-12, 1.0, 3.0)).amax() < 1e-14);
        assert!((sorted[0] - 1e-12).abs() < 1e-24);
        assert!((vectors * vectors.transpose() - Matrix3::identity()).amax() < 1e-14);
    }

    #[test]
    fn eigenvalues_are_raised_in_the_units_of_the_least_variances() {
        let turn = SMatrix::<f64, 2, 2>::new(0.8, -0.6, 0.6, 0.8);
        let unit = SMatrix::<f64, 2, 2>::new(2.0, 0.0, 0.0, 0.25);
        let of =
            |a: f64, b: f64| unit * turn * SMatrix::from_diagonal(&SVector::from([a, b])) * turn.transpose() * unit;
        let least = SVector::from([4.0, 0.0625]);
        for (a, b) in [(0.3, 2.0), (3.0, 0.2), (0.1, 0.4), (1.5, 2.5)] {
            assert!((raised(of(a, b), &least) - of(a.max(1.0), b.max(1.0))).amax() < 1e-14, "{a} {b}");
        }
        for none in [[0.0, 0.0625], [4.0, 0.0]] {
            assert_eq!(raised(of(0.3, 0.2), &SVector::from(none)), of(0.3, 0.2));
        }
    }
}
