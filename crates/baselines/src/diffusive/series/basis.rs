//! Orthonormal Hermite polynomials and the Gauss-Hermite quadrature.

use super::polynomials::MAX_DEGREE;
use nalgebra::{DMatrix, SVector};
use std::sync::LazyLock;

/// `sqrt(n)` for `n` from 0 on.
static ROOTS: LazyLock<[f64; MAX_DEGREE + 2]> = LazyLock::new(|| std::array::from_fn(|n| (n as f64).sqrt()));

/// Orthonormal Hermite products `prod_d he_nu_d(u_d) / sqrt(nu_d!)` for every index.
#[inline]
pub(super) fn hermite_products<const D: usize>(
    indices: &[[usize; D]],
    degree: usize,
    u: &SVector<f64, D>,
    out: &mut [f64],
) {
    let mut table = [[0.0; MAX_DEGREE + 1]; D];
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
    let roots = &*ROOTS;
    for n in 0..row.len() {
        row[n] = match n {
            0 => 1.0,
            1 => x,
            _ => (x * row[n - 1] - roots[n - 1] * row[n - 2]) / roots[n],
        };
    }
}

/// Number of points that [`sums_of_polynomials`] evaluates together.
pub(super) const LANES: usize = 8;

/// `sum_n c_n he_n(x) / sqrt(n!)` at each point, or of the absolute values of these terms.
#[inline(always)]
pub(super) fn sums_of_polynomials(x: &[f64; LANES], coefficients: &[f64], absolute: bool) -> [f64; LANES] {
    let roots = &*ROOTS;
    let (mut before, mut now, mut sums) = ([0.0; LANES], [1.0; LANES], [0.0; LANES]);
    for (n, c) in coefficients.iter().enumerate() {
        for lane in 0..LANES {
            let part = now[lane] * c;
            sums[lane] += if absolute { part.abs() } else { part };
        }
        let (this, next) = (roots[n], roots[n + 1]);
        for lane in 0..LANES {
            let above = (x[lane] * now[lane] - this * before[lane]) / next;
            (before[lane], now[lane]) = (now[lane], above);
        }
    }
    sums
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
