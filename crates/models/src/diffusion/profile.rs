//! Smooth functions of one distance, tabulated as piecewise polynomials.

use crate::Error;
use fewbits_numerics::error::{at_least_one, positive, refuse};
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Number of coefficients of each polynomial: degree 9.
const ORDER: usize = 10;

/// `K` smooth functions of a distance `0 <= r <= end`, each a polynomial of degree 9 on panels of equal width.
///
/// If nothing changes along the ground, the response to a source is a function of the horizontal distance `r`, times `exp((v . d - V r) / 2
/// kappa)` with a horizontal wind `v` of speed `V` and horizontal offset `d`. One table then serves all places, and a look-up costs the
/// evaluation of polynomials instead of several error functions. On panels of a quarter of the shortest diffusion length `sqrt(4 kappa t)`
/// the error is about 1e-12 of the largest value in the panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile<const K: usize> {
    coefficients: Vec<[[f64; ORDER]; K]>,
    width: f64,
    scale: f64,
}

impl<const K: usize> Profile<K> {
    /// Tabulates `f` on `[0, end]` in panels of about `width`.
    ///
    /// # Errors
    /// If `end` or `width` is not a positive number, or `f` is not finite at a node.
    pub fn new(end: f64, width: f64, f: impl Fn(f64) -> [f64; K]) -> Result<Self, Error> {
        positive("end", end)?;
        positive("width", width)?;
        let panels = at_least_one("panels", (end / width).ceil() as usize)?;
        let width = end / panels as f64;
        // Sums over cosines, computed once for all tables.
        static NODES: LazyLock<[f64; ORDER]> = LazyLock::new(|| std::array::from_fn(node));
        static TO_MONOMIALS: LazyLock<[[f64; ORDER]; ORDER]> = LazyLock::new(to_monomials);
        let (nodes, to_monomials) = (&*NODES, &*TO_MONOMIALS);
        let mut coefficients = Vec::with_capacity(panels);
        for panel in 0..panels {
            let mut values = [[0.0; ORDER]; K];
            for (i, node) in nodes.iter().enumerate() {
                let r = width * (panel as f64 + 0.5 * (1.0 + node));
                for (component, value) in values.iter_mut().zip(f(r)) {
                    if !value.is_finite() {
                        return refuse("f", format!("{value} at {r}"), "a finite number");
                    }
                    component[i] = value;
                }
            }
            let mut polynomials = [[0.0; ORDER]; K];
            for (polynomial, component) in polynomials.iter_mut().zip(&values) {
                for (coefficient, row) in polynomial.iter_mut().zip(to_monomials) {
                    *coefficient = row.iter().zip(component).map(|(share, value)| share * value).sum();
                }
            }
            coefficients.push(polynomials);
        }
        Ok(Self {
            coefficients,
            width,
            scale: width.recip(),
        })
    }

    /// Upper end of the tabulated range.
    pub fn end(&self) -> f64 {
        self.width * self.coefficients.len() as f64
    }

    /// The functions at `r`; an `r` outside `[0, end]` is replaced by the nearer end.
    #[inline]
    pub fn at(&self, r: f64) -> [f64; K] {
        let position = (r * self.scale).max(0.0);
        let panel = (position as usize).min(self.coefficients.len() - 1);
        let x = (2.0 * (position - panel as f64) - 1.0).min(1.0);
        // By reference: `map` would copy the coefficients.
        let polynomials = &self.coefficients[panel];
        let mut sums = [0.0; K];
        for power in (0..ORDER).rev() {
            for (sum, polynomial) in sums.iter_mut().zip(polynomials) {
                *sum = *sum * x + polynomial[power];
            }
        }
        sums
    }
}

/// Chebyshev node `i` on `[-1, 1]`.
fn node(i: usize) -> f64 {
    (PI * (i as f64 + 0.5) / ORDER as f64).cos()
}

/// The matrix from values at the Chebyshev nodes to coefficients of powers.
fn to_monomials() -> [[f64; ORDER]; ORDER] {
    // Coefficients of the Chebyshev polynomials by their recurrence.
    let mut chebyshev = [[0.0; ORDER]; ORDER];
    chebyshev[0][0] = 1.0;
    chebyshev[1][1] = 1.0;
    for n in 2..ORDER {
        for power in 0..ORDER {
            let raised = if power > 0 {
                2.0 * chebyshev[n - 1][power - 1]
            } else {
                0.0
            };
            chebyshev[n][power] = raised - chebyshev[n - 2][power];
        }
    }
    let mut matrix = [[0.0; ORDER]; ORDER];
    for (power, row) in matrix.iter_mut().enumerate() {
        for (i, entry) in row.iter_mut().enumerate() {
            for (n, polynomial) in chebyshev.iter().enumerate() {
                let share = if n == 0 { 1.0 } else { 2.0 } / ORDER as f64;
                let value = (PI * n as f64 * (i as f64 + 0.5) / ORDER as f64).cos();
                *entry += share * value * polynomial[power];
            }
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_functions_to_twelve_digits() {
        let f = |r: f64| [libm::erfc(r), (-2.0 * r * r).exp()];
        let table = Profile::new(6.0, 0.25, f).unwrap();
        for i in 0..=6000 {
            let r = i as f64 * 1e-3;
            let (got, want) = (table.at(r), f(r));
            assert!((got[0] - want[0]).abs() < 1e-12 && (got[1] - want[1]).abs() < 1e-12, "{r}");
        }
        assert!(Profile::new(6.0, 0.25, |_| [f64::NAN]).is_err());
        assert!(Profile::new(0.0, 0.25, |_| [1.0]).is_err());
    }
}
