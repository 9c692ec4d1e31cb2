//! Orthonormal Hermite polynomials and the quadrature that they need.

use super::polynomials::HIGHEST_DEGREE;
use nalgebra::{DMatrix, SVector};

/// Orthonormal Hermite products `prod_d he_nu_d(u_d) / sqrt(nu_d!)` for every index.
#[inline]
pub(super) fn hermite_products<const D: usize>(
    indices: &[[usize; D]],
    degree: usize,
    u: &SVector<f64, D>,
    out: &mut [f64],
) {
    let mut table = [[0.0; HIGHEST_DEGREE + 1]; D];
    for (row, x) in table.iter_mut().zip(u.iter()) {
        row_of_polynomials(*x, &mut row[..=degree]);
    }
    for (value, index) in out.iter_mut().zip(indices) {
        *value = (0..D).map(|d| table[d][index[d]]).product();
    }
}

/// Orthonormal Hermite polynomials `he_n(x) / sqrt(n!)` of increasing degree.
#[inline]
pub(super) fn row_of_polynomials(x: f64, row: &mut [f64]) {
    for n in 0..row.len() {
        row[n] = match n {
            0 => 1.0,
            1 => x,
            _ => (x * row[n - 1] - ((n - 1) as f64).sqrt() * row[n - 2]) / (n as f64).sqrt(),
        };
    }
}

/// Nodes and weights of the rule for the standard normal weight, by the eigenvalues of the Jacobi matrix.
pub(super) fn gauss_hermite(nodes: usize) -> Vec<(f64, f64)> {
    let jacobi = DMatrix::from_fn(nodes, nodes, |i, j| {
        if i.abs_diff(j) == 1 {
            (i.max(j) as f64).sqrt()
        } else {
            0.0
        }
    });
    let eigen = jacobi.symmetric_eigen();
    (0..nodes)
        .map(|i| (eigen.eigenvalues[i], eigen.eigenvectors[(0, i)].powi(2)))
        .collect()
}
