//! Lloyd-Max quantizers: least mean squared error for one scalar and a given number of levels.
//!
//! The optimal breakpoints lie midway between the centroids of the two cells they part (Lloyd 1957, Max 1960). The usual
//! sweep "centroids, midpoints, centroids, ..." converges linearly and slowly (some 180 sweeps for 8 levels and 670 for 16
//! to a step of 1e-12). A centroid depends on the two edges of its own cell only, so the midpoint equations have a
//! tridiagonal Jacobian and Newton's method costs no more a step than a sweep:
//!
//! ```text
//! b <- edges of equal mass under density^(1/3)            # Panter and Dite's high-rate rule
//! repeat
//!     c_i  <- centroid of (b_{i-1}, b_i]                  # closed form or quadrature
//!     F_i  <- b_i - (c_i + c_{i+1}) / 2
//!     J    <- tridiagonal, from dc_i/db_i     = p(b_i) (b_i - c_i) / P_i
//!                          and  dc_i/db_{i-1} = p(b_{i-1}) (c_i - b_{i-1}) / P_i
//!     step <- J^-1 F, halved until b - step is increasing and |F| falls
//!     b    <- b - step
//! until |step| <= 1e-13 * scale
//! ```
//!
//! ```
//! use fewbits_quantizers::lloyd_max;
//! let four = lloyd_max::gaussian(4)?;
//! assert!((four.breakpoints()[2] - 0.981_598_821_567_8).abs() < 1e-12);
//! assert!((four.mean_squared_error() - 0.117_481_847_829).abs() < 1e-12);
//! # Ok::<(), fewbits_quantizers::Error>(())
//! ```

use crate::error::{Error, refuse};
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;
use std::sync::OnceLock;

/// Largest number of levels: beyond it a linear quantizer with dither serves as well.
pub const MAX_LEVELS: usize = 4096;
/// Steps below this share of the density's scale end the iteration.
const STEP_TOLERANCE: f64 = 1e-13;
/// Newton needs 5 to 15 steps; what needs more is not a density with a unique optimum.
const MAX_ITERATIONS: usize = 200;
/// Cells of the grid on which the high-rate starting point is inverted.
const START_GRID: usize = 4000;

/// A probability density on the line, as far as quantization needs it.
///
/// Laws: `mass` and `first_moment` are additive over adjoining intervals, `mass` over the whole line is 1, and both are the
/// integrals of `pdf` and `x pdf`. Edges may be infinite.
pub trait Density {
    /// Density at `x`.
    fn pdf(&self, x: f64) -> f64;
    /// Probability of `(a, b]`.
    fn mass(&self, a: f64, b: f64) -> f64;
    /// Integral of `x pdf(x)` over `(a, b]`.
    fn first_moment(&self, a: f64, b: f64) -> f64;
    /// Variance plus squared mean.
    fn second_moment(&self) -> f64;
    /// An interval outside which the cube root of the density is negligible.
    fn extent(&self) -> (f64, f64);
}

/// Normal density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian {
    mean: f64,
    sd: f64,
}

impl Gaussian {
    /// Mean 0, standard deviation 1.
    pub const STANDARD: Self = Self { mean: 0.0, sd: 1.0 };

    /// Normal density with the given mean and standard deviation.
    ///
    /// # Errors
    /// If `mean` is not finite or `sd` is not a positive number.
    pub fn new(mean: f64, sd: f64) -> Result<Self, Error> {
        Ok(Self {
            mean: fewbits_numerics::error::finite("mean", mean)?,
            sd: fewbits_numerics::error::positive("sd", sd)?,
        })
    }

    fn standardised(&self, x: f64) -> f64 {
        (x - self.mean) / self.sd
    }
}

impl Density for Gaussian {
    fn pdf(&self, x: f64) -> f64 {
        normal::pdf(self.standardised(x)) / self.sd
    }

    fn mass(&self, a: f64, b: f64) -> f64 {
        normal::interval(self.standardised(a), self.standardised(b))
    }

    fn first_moment(&self, a: f64, b: f64) -> f64 {
        let (u, v) = (self.standardised(a), self.standardised(b));
        self.mean * normal::interval(u, v) + self.sd * pdf_drop(u, v)
    }

    fn second_moment(&self) -> f64 {
        self.mean * self.mean + self.sd * self.sd
    }

    fn extent(&self) -> (f64, f64) {
        // The cube root has standard deviation sqrt(3).
        let reach = 14.0 * self.sd;
        (self.mean - reach, self.mean + reach)
    }
}

/// `phi(u) - phi(v)` without cancellation when `u` and `v` are close.
fn pdf_drop(u: f64, v: f64) -> f64 {
    if u.is_infinite() || v.is_infinite() {
        return normal::pdf(u) - normal::pdf(v);
    }
    -normal::pdf(u) * (0.5 * (u - v) * (u + v)).exp_m1()
}

/// Uniform density on an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uniform {
    low: f64,
    high: f64,
}

impl Uniform {
    /// Uniform on `(low, high)`.
    ///
    /// # Errors
    /// If an end is not finite or `low >= high`.
    pub fn new(low: f64, high: f64) -> Result<Self, Error> {
        fewbits_numerics::error::finite("low", low)?;
        fewbits_numerics::error::finite("high", high)?;
        if low >= high {
            return refuse("high", high, format!("a number above low = {low}"));
        }
        Ok(Self { low, high })
    }

    fn clipped(&self, a: f64, b: f64) -> (f64, f64) {
        (a.clamp(self.low, self.high), b.clamp(self.low, self.high))
    }
}

impl Density for Uniform {
    fn pdf(&self, x: f64) -> f64 {
        if (self.low..=self.high).contains(&x) {
            1.0 / (self.high - self.low)
        } else {
            0.0
        }
    }

    fn mass(&self, a: f64, b: f64) -> f64 {
        let (a, b) = self.clipped(a, b);
        (b - a).max(0.0) / (self.high - self.low)
    }

    fn first_moment(&self, a: f64, b: f64) -> f64 {
        let (a, b) = self.clipped(a, b);
        0.5 * (a + b) * self.mass(a, b)
    }

    fn second_moment(&self) -> f64 {
        (self.low * self.low + self.low * self.high + self.high * self.high) / 3.0
    }

    fn extent(&self) -> (f64, f64) {
        (self.low, self.high)
    }
}

/// Any smooth density given as a function, integrated by Gauss-Legendre panels.
#[derive(Debug, Clone)]
pub struct SmoothDensity<F> {
    density: F,
    low: f64,
    high: f64,
    panel: f64,
    scale: f64,
}

impl<F: Fn(f64) -> f64> SmoothDensity<F> {
    /// The density proportional to `density` on `(low, high)`; what lies outside is cut off and the rest normalised.
    ///
    /// `panels` is the number of 20-point Gauss-Legendre panels that resolve it (1 to 10000).
    ///
    /// # Errors
    /// If the interval is empty or not finite, `panels` is out of range, or the integral is not positive and finite.
    pub fn new(density: F, low: f64, high: f64, panels: usize) -> Result<Self, Error> {
        Uniform::new(low, high)?;
        if !(1..=10_000).contains(&panels) {
            return refuse("panels", panels, "a number of panels from 1 to 10000");
        }
        let mut this = Self {
            density,
            low,
            high,
            panel: (high - low) / panels as f64,
            scale: 1.0,
        };
        let total = this.integral(low, high, |_| 1.0);
        if !(total.is_finite() && total > 0.0) {
            return refuse("density", format!("a function of integral {total}"), "a positive finite integral");
        }
        this.scale = 1.0 / total;
        Ok(this)
    }

    fn integral(&self, a: f64, b: f64, weight: impl Fn(f64) -> f64) -> f64 {
        let (a, b) = (a.clamp(self.low, self.high), b.clamp(self.low, self.high));
        if a >= b {
            return 0.0;
        }
        let panels = ((b - a) / self.panel).ceil() as usize;
        let f = |x: f64| weight(x) * (self.density)(x);
        self.scale * gauss_legendre::<20>().composite(a, b, panels, f)
    }
}

impl<F: Fn(f64) -> f64> Density for SmoothDensity<F> {
    fn pdf(&self, x: f64) -> f64 {
        if (self.low..=self.high).contains(&x) {
            self.scale * (self.density)(x)
        } else {
            0.0
        }
    }

    fn mass(&self, a: f64, b: f64) -> f64 {
        self.integral(a, b, |_| 1.0)
    }

    fn first_moment(&self, a: f64, b: f64) -> f64 {
        self.integral(a, b, |x| x)
    }

    fn second_moment(&self) -> f64 {
        self.integral(self.low, self.high, |x| x * x)
    }

    fn extent(&self) -> (f64, f64) {
        (self.low, self.high)
    }
}

/// A least-squares scalar quantizer: cells `(b_{i-1}, b_i]` and the centroid of each.
#[derive(Debug, Clone, PartialEq)]
pub struct LloydMax {
    breakpoints: Vec<f64>,
    centroids: Vec<f64>,
    probabilities: Vec<f64>,
    mean_squared_error: f64,
}

impl LloydMax {
    /// Finite breakpoints, increasing, one fewer than levels.
    pub fn breakpoints(&self) -> &[f64] {
        &self.breakpoints
    }

    /// Reconstruction value of each cell.
    pub fn centroids(&self) -> &[f64] {
        &self.centroids
    }

    /// Probability of each cell.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// Mean squared error of reconstruction by centroids, in the squared unit of the variable.
    pub fn mean_squared_error(&self) -> f64 {
        self.mean_squared_error
    }

    /// Entropy of the cell index in bits: what an ideal entropy coder would spend.
    pub fn entropy_bits(&self) -> f64 {
        -self
            .probabilities
            .iter()
            .filter(|p| **p > 0.0)
            .map(|p| p * p.log2())
            .sum::<f64>()
    }

    /// The quantizer of `mean + sd X`, where this one is the quantizer of `X`.
    ///
    /// # Errors
    /// If `mean` is not finite or `sd` is not a positive number.
    pub fn affine(&self, mean: f64, sd: f64) -> Result<Self, Error> {
        Gaussian::new(mean, sd)?;
        let map = |v: &[f64]| v.iter().map(|x| mean + sd * x).collect();
        Ok(Self {
            breakpoints: map(&self.breakpoints),
            centroids: map(&self.centroids),
            probabilities: self.probabilities.clone(),
            mean_squared_error: sd * sd * self.mean_squared_error,
        })
    }

    /// Index of the cell that holds `x`, 0 to `levels - 1`; NaN falls into the first cell.
    #[inline]
    pub fn encode(&self, x: f64) -> usize {
        self.breakpoints.partition_point(|b| *b < x)
    }
}

/// The Lloyd-Max quantizer of `density` with `levels` levels.
///
/// # Errors
/// [`Error::Argument`] unless `levels` is in `2..=MAX_LEVELS`; [`Error::NotConverged`] if the density is too rough for a
/// unique optimum to be found.
pub fn design(density: &impl Density, levels: usize) -> Result<LloydMax, Error> {
    if !(2..=MAX_LEVELS).contains(&levels) {
        return refuse("levels", levels, format!("a number of levels from 2 to {MAX_LEVELS}"));
    }
    let (low, high) = density.extent();
    let scale = high - low;
    let mut b = high_rate_edges(density, levels);
    let mut cells = Cells::of(density, &b);
    let mut change = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let residual = cells.residual(&b);
        let step = cells.newton_step(density, &b, &residual);
        let before = largest(&residual);
        let mut share = 1.0;
        let (next, next_cells) = loop {
            let trial: Vec<f64> = b.iter().zip(&step).map(|(b, s)| b - share * s).collect();
            if is_increasing(&trial) {
                let trial_cells = Cells::of(density, &trial);
                let after = largest(&trial_cells.residual(&trial));
                if after <= before || after <= STEP_TOLERANCE * scale {
                    break (trial, trial_cells);
                }
            }
            share *= 0.5;
            if share < 1e-6 {
                // Newton has no descent here: one sweep of the fixed point always has.
                let swept: Vec<f64> = b.iter().zip(&residual).map(|(b, r)| b - r).collect();
                let swept_cells = Cells::of(density, &swept);
                break (swept, swept_cells);
            }
        };
        change = b.iter().zip(&next).fold(0.0, |m, (p, q)| f64::max(m, (p - q).abs()));
        (b, cells) = (next, next_cells);
        if change <= STEP_TOLERANCE * scale {
            return Ok(cells.finish(density, b));
        }
    }
    Err(Error::NotConverged {
        algorithm: "Lloyd-Max",
        iterations: MAX_ITERATIONS,
        change,
    })
}

/// The Lloyd-Max quantizer of the standard normal density.
///
/// # Errors
/// As [`design`].
pub fn gaussian(levels: usize) -> Result<LloydMax, Error> {
    let mut quantizer = design(&Gaussian::STANDARD, levels)?;
    // The optimum is odd; averaging removes the last rounding error and makes the middle edge 0 exactly.
    symmetrise(&mut quantizer.breakpoints);
    symmetrise(&mut quantizer.centroids);
    Ok(quantizer)
}

fn symmetrise(values: &mut [f64]) {
    let n = values.len();
    for i in 0..n.div_ceil(2) {
        let half = 0.5 * (values[n - 1 - i] - values[i]);
        values[i] = -half;
        values[n - 1 - i] = half;
    }
}

/// Largest word length kept by [`gaussian_table`].
pub const TABLE_BITS: usize = 8;

/// The standard normal quantizer of `2^bits` levels, designed at first use and kept for the life of the process.
///
/// # Errors
/// If `bits` is not in `1..=8`.
pub fn gaussian_table(bits: usize) -> Result<&'static LloydMax, Error> {
    static TABLES: [OnceLock<Result<LloydMax, Error>>; TABLE_BITS] = [const { OnceLock::new() }; TABLE_BITS];
    if !(1..=TABLE_BITS).contains(&bits) {
        return refuse("bits", bits, "a word length from 1 to 8");
    }
    TABLES[bits - 1]
        .get_or_init(|| gaussian(1 << bits))
        .as_ref()
        .map_err(Clone::clone)
}

fn is_increasing(b: &[f64]) -> bool {
    b.iter().all(|x| x.is_finite()) && b.windows(2).all(|w| w[0] < w[1])
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, x| f64::max(m, x.abs()))
}

/// Edges of `levels` cells of equal mass under the cube root of the density (Panter and Dite 1951).
fn high_rate_edges(density: &impl Density, levels: usize) -> Vec<f64> {
    let (low, high) = density.extent();
    let width = (high - low) / START_GRID as f64;
    let mut cumulative = vec![0.0; START_GRID + 1];
    for i in 0..START_GRID {
        let middle = low + (i as f64 + 0.5) * width;
        cumulative[i + 1] = cumulative[i] + density.pdf(middle).max(0.0).cbrt();
    }
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

/// Masses and centroids of the cells between given breakpoints.
struct Cells {
    mass: Vec<f64>,
    centroid: Vec<f64>,
}

impl Cells {
    fn of(density: &impl Density, b: &[f64]) -> Self {
        let edge = |i: usize| match i {
            0 => f64::NEG_INFINITY,
            i if i <= b.len() => b[i - 1],
            _ => f64::INFINITY,
        };
        let (low, high) = density.extent();
        let mut mass = Vec::with_capacity(b.len() + 1);
        let mut centroid = Vec::with_capacity(b.len() + 1);
        for i in 0..=b.len() {
            let (left, right) = (edge(i), edge(i + 1));
            let p = density.mass(left, right);
            mass.push(p);
            centroid.push(if p > 0.0 {
                density.first_moment(left, right) / p
            } else {
                // An empty cell has no centroid; its middle keeps the iteration defined.
                0.5 * (left.clamp(low, high) + right.clamp(low, high))
            });
        }
        Self { mass, centroid }
    }

    fn residual(&self, b: &[f64]) -> Vec<f64> {
        b.iter()
            .enumerate()
            .map(|(i, b)| b - 0.5 * (self.centroid[i] + self.centroid[i + 1]))
            .collect()
    }

    /// Solves the tridiagonal Newton system by elimination.
    fn newton_step(&self, density: &impl Density, b: &[f64], residual: &[f64]) -> Vec<f64> {
        let n = b.len();
        // Influence of edge j on the centroid of cell i (one of its two neighbours).
        let pull = |i: usize, j: usize| {
            if self.mass[i] > 0.0 {
                0.5 * density.pdf(b[j]) * (b[j] - self.centroid[i]).abs() / self.mass[i]
            } else {
                0.25
            }
        };
        let mut diagonal: Vec<f64> = (0..n).map(|i| 1.0 - pull(i, i) - pull(i + 1, i)).collect();
        let mut rhs = residual.to_vec();
        for i in 1..n {
            let factor = -pull(i, i - 1) / diagonal[i - 1];
            diagonal[i] += factor * pull(i, i);
            rhs[i] -= factor * rhs[i - 1];
        }
        for i in (0..n).rev() {
            let above = if i + 1 < n {
                pull(i + 1, i + 1) * rhs[i + 1]
            } else {
                0.0
            };
            rhs[i] = (rhs[i] + above) / diagonal[i];
        }
        rhs
    }

    fn finish(self, density: &impl Density, breakpoints: Vec<f64>) -> LloydMax {
        let explained: f64 = self.mass.iter().zip(&self.centroid).map(|(p, c)| p * c * c).sum();
        LloydMax {
            breakpoints,
            mean_squared_error: (density.second_moment() - explained).max(0.0),
            centroids: self.centroid,
            probabilities: self.mass,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_cells_are_equal() {
        let q = design(&Uniform::new(-1.0, 3.0).unwrap(), 5).unwrap();
        for (i, b) in q.breakpoints().iter().enumerate() {
            assert!((b - (-1.0 + 0.8 * (i + 1) as f64)).abs() < 1e-12);
        }
        assert!((q.mean_squared_error() - 0.64 / 12.0).abs() < 1e-12);
    }

    #[test]
    fn every_table_satisfies_the_midpoint_and_centroid_equations() {
        for bits in 1..=8 {
            let q = gaussian_table(bits).unwrap();
            assert_eq!(q.breakpoints().len() + 1, 1 << bits);
            let cells = Cells::of(&Gaussian::STANDARD, q.breakpoints());
            assert!(largest(&cells.residual(q.breakpoints())) < 1e-11, "bits {bits}");
            assert_eq!(q.breakpoints()[(1 << bits) / 2 - 1], 0.0);
            assert!(q.entropy_bits() <= bits as f64);
        }
        // Panter and Dite: mse -> sqrt(3) pi / (2 L^2).
        let ratio =
            gaussian_table(8).unwrap().mean_squared_error() * 65536.0 / (3f64.sqrt() * std::f64::consts::FRAC_PI_2);
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }

    #[test]
    fn a_density_by_quadrature_agrees_with_its_closed_form() {
        let smooth = SmoothDensity::new(|x: f64| (-0.5 * (x - 1.0) * (x - 1.0) / 4.0).exp(), -19.0, 21.0, 80).unwrap();
        let exact = gaussian(8).unwrap().affine(1.0, 2.0).unwrap();
        let found = design(&smooth, 8).unwrap();
        for (a, b) in exact.breakpoints().iter().zip(found.breakpoints()) {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
        assert!((exact.mean_squared_error() - found.mean_squared_error()).abs() < 1e-10);
    }

    #[test]
    fn newton_agrees_with_the_fixed_point_on_a_skewed_mixture() {
        let mixture =
            SmoothDensity::new(|x: f64| 0.7 * normal::pdf(x) + 0.3 * normal::pdf((x - 2.0) / 0.5) / 0.5, -9.0, 9.0, 60)
                .unwrap();
        let found = design(&mixture, 5).unwrap();
        let mut b = vec![-2.0, -1.0, 0.0, 1.0];
        for _ in 0..300 {
            let residual = Cells::of(&mixture, &b).residual(&b);
            for (b, r) in b.iter_mut().zip(&residual) {
                *b -= r;
            }
        }
        for (a, b) in b.iter().zip(found.breakpoints()) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn bad_arguments_are_named() {
        assert!(gaussian(1).unwrap_err().to_string().contains("levels"));
        assert!(gaussian_table(9).unwrap_err().to_string().contains("bits"));
        assert!(Uniform::new(1.0, 1.0).is_err());
        assert!(Gaussian::new(0.0, 0.0).is_err());
        assert!(SmoothDensity::new(|_| 0.0, 0.0, 1.0, 1).is_err());
    }
}
