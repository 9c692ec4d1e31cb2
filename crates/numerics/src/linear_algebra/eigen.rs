//! Eigenvalues of small symmetric matrices.

use nalgebra::{SMatrix, SVector};

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix by Jacobi rotations: for the two or three dimensions of a
/// measurement as fast as anything, exact in small eigenvalues, and free of the dimension arithmetic that nalgebra's own
/// solver would impose on every caller.
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
                let half = (a[(q, q)] - a[(p, p)]) / (2.0 * entry);
                let tangent = half.signum() / (half.abs() + half.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                let mut turn = SMatrix::<f64, M, M>::identity();
                turn[(p, p)] = cosine;
                turn[(q, q)] = cosine;
                turn[(p, q)] = tangent * cosine;
                turn[(q, p)] = -tangent * cosine;
                a = turn.transpose() * a * turn;
                a[(p, q)] = 0.0;
                a[(q, p)] = 0.0;
                vectors *= turn;
            }
        }
        if off == 0.0 {
            break;
        }
    }
    (a.diagonal(), vectors)
}

#[cfg(test)]
mod tests {
    use super::symmetric_eigen;
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
}
