//! Probability densities of a scalar, with the integrals that quantizer design needs.

mod normal;
mod smooth;
mod uniform;

pub use normal::Normal;
pub use smooth::SmoothDensity;
pub use uniform::Uniform;

/// Number of cells of the grid on which the companding function is inverted.
const START_GRID: usize = 4000;

/// Probability of a cell `[a, b)`, and the distances of its centroid from its edges.
///
/// The midpoint equations of a quantizer need `(b - c_i) - (c_{i+1} - b)`. Stored as distances, the terms keep all digits even
/// in narrow cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellMoments {
    /// Probability of the cell.
    pub mass: f64,
    /// Centroid minus `a`; infinite if `a` is.
    pub from_lower: f64,
    /// `b` minus centroid; infinite if `b` is.
    pub to_upper: f64,
}

impl CellMoments {
    /// The moments of a cell `[a, b)`, if the density is zero outside a part `[low, high]` of it. `mass` is the probability of this part,
    /// `moment` the integral of `(x - low)` times the density.
    pub fn clipped((a, b): (f64, f64), (low, high): (f64, f64), mass: f64, moment: f64) -> Self {
        let inside = if mass > 0.0 { moment / mass } else { 0.5 * (high - low) };
        Self {
            mass,
            from_lower: inside + (low - a),
            to_upper: (high - low - inside) + (b - high),
        }
    }

    /// The moments after a change of unit that multiplies lengths by `factor`.
    fn scaled(self, factor: f64) -> Self {
        Self {
            mass: self.mass,
            from_lower: factor * self.from_lower,
            to_upper: factor * self.to_upper,
        }
    }
}

/// A probability density of a scalar.
///
/// All positions `x`, `a`, `b` are measured **from [`centre`](Density::centre)**, so that rounding does not depend on how far from zero the
/// density is. Edges may be infinite.
///
/// Laws: masses of adjacent cells add, and the mass of the whole line is 1; centroids are those of `pdf`; `squared_error` is the
/// integral of `(x - point)^2 pdf(x)`.
pub trait Density {
    /// The point from which the other functions measure: the mean, or close to it.
    fn centre(&self) -> f64;
    /// Density at `centre + x`.
    fn pdf(&self, x: f64) -> f64;
    /// Probability and centroid of the cell `[a, b)`. An empty cell has its middle as centroid.
    fn cell(&self, a: f64, b: f64) -> CellMoments;
    /// All cells between increasing breakpoints, one more than breakpoints.
    fn cells(&self, breakpoints: &[f64], cells: &mut [CellMoments]) {
        for (i, cell) in cells.iter_mut().enumerate() {
            let (lower, upper) = edges(breakpoints, i);
            *cell = self.cell(lower, upper);
        }
    }
    /// Integral of `(x - point)^2 pdf(x)` over `[a, b)`: the squared error if the cell is reproduced by `point`.
    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64;
    /// The standard deviation if the density is normal about its centre, else `None`. A design then starts from a stored table.
    fn normal_deviation(&self) -> Option<f64> {
        None
    }
    /// An interval outside of which the cube root of the density is negligible.
    fn extent(&self) -> (f64, f64);

    /// Breakpoints of `levels` cells of equal mass under the cube root of the density: the companding solution, optimal for
    /// many levels (Panter and Dite 1951), from which a design starts.
    fn companding(&self, levels: usize) -> Vec<f64> {
        let (low, high) = self.extent();
        let width = (high - low) / START_GRID as f64;
        let mut cumulative = vec![0.0; START_GRID + 1];
        for i in 0..START_GRID {
            let middle = low + (i as f64 + 0.5) * width;
            cumulative[i + 1] = cumulative[i] + self.pdf(middle).max(0.0).cbrt();
        }
        // Invert the cumulative sum at the fractions l / levels, linearly between its nodes.
        let total = cumulative[START_GRID];
        (1..levels)
            .map(|l| {
                let target = total * l as f64 / levels as f64;
                let at = cumulative.partition_point(|c| *c < target).clamp(1, START_GRID);
                let (before, after) = (cumulative[at - 1], cumulative[at]);
                let inside = if after > before {
                    (target - before) / (after - before)
                } else {
                    0.5
                };
                low + width * (at as f64 - 1.0 + inside)
            })
            .collect()
    }
}

/// Edges of cell `i` between breakpoints, infinite at the ends.
pub(crate) fn edges(breakpoints: &[f64], i: usize) -> (f64, f64) {
    let lower = i.checked_sub(1).and_then(|i| breakpoints.get(i));
    (lower.copied().unwrap_or(f64::NEG_INFINITY), breakpoints.get(i).copied().unwrap_or(f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_numerics::quadrature::gauss_legendre;

    fn laws(density: &impl Density, cuts: &[f64]) {
        let edges: Vec<f64> = [f64::NEG_INFINITY]
            .into_iter()
            .chain(cuts.iter().copied())
            .chain([f64::INFINITY])
            .collect();
        let mass: f64 = edges.windows(2).map(|w| density.cell(w[0], w[1]).mass).sum();
        assert!((mass - 1.0).abs() < 1e-14);
        let (low, high) = density.extent();
        for w in edges.windows(2) {
            let (a, b) = (w[0].max(low), w[1].min(high));
            let numeric =
                |f: &dyn Fn(f64) -> f64| gauss_legendre::<64>().composite(a, b, 40, |x| f(x) * density.pdf(x));
            let cell = density.cell(w[0], w[1]);
            let centroid = if w[0].is_finite() {
                w[0] + cell.from_lower
            } else {
                w[1] - cell.to_upper
            };
            assert!((numeric(&|_| 1.0) - cell.mass).abs() < 1e-13);
            assert!((numeric(&|x| x) / cell.mass - centroid).abs() < 1e-11 * (high - low));
            let cost = density.squared_error(w[0], w[1], 0.3);
            assert!((numeric(&|x| (x - 0.3) * (x - 0.3)) - cost).abs() < 1e-12 * (1.0 + cost));
            if w[0].is_finite() && w[1].is_finite() {
                assert!((cell.from_lower + cell.to_upper - (w[1] - w[0])).abs() < 1e-14 * (high - low));
            }
        }
    }

    #[test]
    fn densities_obey_their_laws() {
        laws(&Normal::STANDARD, &[-2.0, -0.4, 0.1, 0.9, 4.0]);
        laws(&Normal::with_deviation(1e8, 2.5).unwrap(), &[-9.0, -0.1, 0.0, 3.0]);
        laws(&Uniform::new(-1.0, 3.0).unwrap(), &[-1.5, -0.3, 0.2, 1.9]);
        laws(&SmoothDensity::new(|x: f64| (-x).exp(), 0.0, 30.0, 60).unwrap(), &[-14.0, -12.0, 3.0]);
    }

    /// Defect: a point whose square is beyond all numbers gave no number in a cell without mass.
    #[test]
    fn squared_errors_of_points_far_beyond_are_numbers() {
        let normal = Normal::with_deviation(0.0, 2.0).unwrap();
        let uniform = Uniform::new(-1.0, 1.0).unwrap();
        let smooth = SmoothDensity::new(|x: f64| (-x).exp(), 0.0, 30.0, 60).unwrap();
        let densities: [&dyn Density; 3] = [&normal, &uniform, &smooth];
        for density in densities {
            for point in [-1e200, 1e160, 1e300] {
                assert_eq!(density.squared_error(100.0, 200.0, point), 0.0);
                assert_eq!(density.squared_error(f64::NEG_INFINITY, f64::INFINITY, point), f64::INFINITY);
            }
        }
        // A cell of mass 1e-202 or so: the square of 1e160 has a share of it that is a number.
        let (low, high) = (60.0, f64::INFINITY);
        let exact = (normal.cell(low, high).mass.ln() + 2.0 * 1e160_f64.ln()).exp();
        assert!((normal.squared_error(low, high, 1e160) / exact - 1.0).abs() < 1e-12);
    }

    #[test]
    fn bad_arguments_are_named() {
        assert!(Uniform::new(1.0, 1.0).is_err());
        assert!(Normal::with_deviation(0.0, 0.0).is_err());
        assert!(SmoothDensity::new(|_| 0.0, 0.0, 1.0, 1).is_err());
        assert!(SmoothDensity::new(|_| f64::NAN, 0.0, 1.0, 1).is_err());
    }
}
