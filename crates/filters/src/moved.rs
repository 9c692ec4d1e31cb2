//! A plane density moved by linear dynamics whose noise may be singular.

use crate::Error;
use fewbits_core::{Gaussian, LinearDynamics};
use fewbits_densities::PlaneMass;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::linalg::semidefinite_factor;
use fewbits_numerics::normal::INV_SQRT_2PI;
use nalgebra::{Matrix2, Vector2};

/// Deviations of the noise that are integrated over.
const REACH: f64 = 7.5;
/// Nodes of the interpolating polynomial along each axis.
const ORDER: usize = 12;
/// Share of negative mass from which on an interpolated density counts as unresolved.
const UNRESOLVED: f64 = 1e-4;

/// `p'(x') = E p(A^-1 (x' - u)) / |det A|`, evaluated between the nodes by polynomials of degree 11 along each axis; the
/// expectation over `u ~ N(0, Q)` is a trapezoid rule along each of its causes, with steps that neither the noise nor the
/// lattice can tell from an integral.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Moved {
    /// `B^-1 A^-1 B`: from new to old lattice coordinates.
    back: Matrix2<f64>,
    /// `B^-1 A^-1 u` and its weight over `|det A|`.
    draws: Vec<(Vector2<f64>, f64)>,
}

impl Moved {
    pub(crate) fn new(dynamics: &impl LinearDynamics<2>, basis: &Matrix2<f64>) -> Result<Self, Error> {
        let refuse = |name, m: &Matrix2<f64>| ArgumentError::new(name, format!("{m:?}"), "a regular matrix");
        let transition = dynamics.transition();
        let inverse = transition
            .try_inverse()
            .ok_or_else(|| refuse("transition", transition))?;
        let to_lattice = basis.try_inverse().ok_or_else(|| refuse("basis", basis))? * inverse;
        let causes = to_lattice * semidefinite_factor("noise_covariance", dynamics.noise_covariance())?;
        let mut draws = vec![(Vector2::zeros(), 1.0 / transition.determinant().abs())];
        for cause in causes.column_iter() {
            let length = cause.amax();
            if length == 0.0 {
                continue;
            }
            let step = 0.5_f64.min(1.0 / length);
            let half = (REACH / step).ceil() as i64;
            draws = draws
                .iter()
                .flat_map(|(shift, weight)| {
                    (-half..=half).map(move |k| {
                        let u = k as f64 * step;
                        (shift + cause * u, weight * step * INV_SQRT_2PI * (-0.5 * u * u).exp())
                    })
                })
                .collect();
        }
        Ok(Self {
            back: to_lattice * basis,
            draws,
        })
    }

    pub(crate) fn predict(
        &self,
        basis: &Matrix2<f64>,
        belief: &PlaneMass,
        reached: &Gaussian<2>,
    ) -> Result<PlaneMass, Error> {
        let (mut kept, mut overshoot) = (0.0, 0.0);
        let predicted = PlaneMass::covering(basis, reached, |lattice, density| {
            for (n, p) in lattice.nodes().zip(density) {
                let centre = self.back * n;
                let value: f64 = self
                    .draws
                    .iter()
                    .map(|(shift, weight)| weight * between(belief, &(centre - shift)))
                    .sum();
                *p = value.max(0.0);
                kept += *p;
                overshoot += *p - value;
            }
        })?;
        // A density that its nodes resolve interpolates without overshoot.
        if overshoot > UNRESOLVED * kept {
            let expected = "a basis whose steps are at most a quarter of the belief's deviations";
            return Err(ArgumentError::new("basis", format!("{basis:?}"), expected).into());
        }
        Ok(predicted)
    }
}

/// The density at lattice coordinates between the nodes.
fn between(belief: &PlaneMass, at: &Vector2<f64>) -> f64 {
    let (first, size) = (belief.first(), belief.size());
    let mut start = [0_i64; 2];
    let mut weights = [[0.0; ORDER]; 2];
    for axis in 0..2 {
        let place = at[axis] - first[axis] as f64;
        let outside = place < -1.0 || place > size[axis] as f64;
        if outside || !place.is_finite() {
            return 0.0;
        }
        let below = place.floor();
        start[axis] = below as i64 - (ORDER as i64 / 2 - 1);
        weights[axis] = lagrange(place - below);
    }
    let mut value = 0.0;
    for (i, row) in weights[0].iter().enumerate() {
        let r = start[0] + i as i64;
        if r < 0 || r >= size[0] as i64 {
            continue;
        }
        let line = &belief.density()[r as usize * size[1]..(r as usize + 1) * size[1]];
        let from = start[1].max(0);
        let to = (start[1] + ORDER as i64).min(size[1] as i64);
        if from < to {
            let nodes = &line[from as usize..to as usize];
            let factors = &weights[1][(from - start[1]) as usize..];
            value += row * nodes.iter().zip(factors).map(|(p, w)| p * w).sum::<f64>();
        }
    }
    value
}

/// Weights of the nodes `-5..=6` for a value at `share` in `[0, 1)`: Lagrange's polynomials in barycentric form.
fn lagrange(share: f64) -> [f64; ORDER] {
    const BINOMIAL: [f64; ORDER] = [
        1.0, -11.0, 55.0, -165.0, 330.0, -462.0, 462.0, -330.0, 165.0, -55.0, 11.0, -1.0,
    ];
    const HERE: usize = ORDER / 2 - 1;
    if share == 0.0 {
        return std::array::from_fn(|i| f64::from(u8::from(i == HERE)));
    }
    let terms: [f64; ORDER] = std::array::from_fn(|i| BINOMIAL[i] / (share + HERE as f64 - i as f64));
    let total: f64 = terms.iter().sum();
    terms.map(|term| term / total)
}

#[cfg(test)]
mod tests {
    use super::between;
    use fewbits_core::Gaussian;
    use fewbits_densities::PlaneMass;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn a_density_is_interpolated_between_its_nodes_and_zero_outside() {
        let belief = Gaussian::new(Vector2::new(3.1, -7.3), Matrix2::new(1.3, 0.4, 0.4, 0.8)).unwrap();
        let basis = Matrix2::new(0.3, 0.05, 0.0, 0.25);
        let plane = PlaneMass::normal(&basis, &belief).unwrap();
        let back = basis.try_inverse().unwrap();
        let peak = belief.log_pdf(belief.mean()).unwrap().exp();
        for offset in [[0.0, 0.0], [0.37, -0.61], [-1.9, 0.83], [2.77, 2.13], [-4.2, -2.9]] {
            let at = belief.mean() + Vector2::from(offset);
            let expected = belief.log_pdf(&at).unwrap().exp();
            let ours = between(&plane, &(back * at));
            assert!((ours - expected).abs() < 1e-6 * peak, "{offset:?}: {ours} {expected}");
        }
        // Up to the edge of the lattice there are values, a node beyond it there are none.
        let [first, size] = [plane.first().map(|k| k as f64), plane.size().map(|n| n as f64)];
        let middle = [0, 1].map(|axis| first[axis] + (0.5 * size[axis]).floor());
        for axis in 0..2 {
            for (end, outwards) in [(first[axis], -1.0), (first[axis] + size[axis] - 1.0, 1.0)] {
                let mut at = Vector2::from(middle);
                at[axis] = end;
                assert!(between(&plane, &at) > 0.0);
                at[axis] = end + 1.5 * outwards;
                assert_eq!(between(&plane, &at), 0.0);
            }
        }
        assert_eq!(between(&plane, &Vector2::new(f64::NAN, 0.0)), 0.0);
    }
}
