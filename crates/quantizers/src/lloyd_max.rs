//! Lloyd-Max quantizers: least mean squared error for one scalar and a given number of levels.
//!
//! The optimal breakpoints lie midway between the centroids of the two cells they part (Lloyd 1957, Max 1960). The usual
//! sweep "centroids, midpoints, centroids, ..." converges linearly and slowly (some 180 sweeps for 8 levels and 670 for 16
//! to a step of 1e-12). A centroid depends on the two edges of its own cell only, so the midpoint equations have a
//! tridiagonal Jacobian and Newton's method costs no more a step than a sweep:
//!
//! ```text
//! b <- edges of equal mass under density^(1/3)            # the companding solution of Panter and Dite
//! repeat
//!     c_i  <- centroid of [b_{i-1}, b_i)                  # closed form or quadrature
//!     F_i  <- b_i - (c_i + c_{i+1}) / 2                   # from the distances of the centroids to b_i: no digit is lost
//!     J    <- tridiagonal, from dc_i/db_i     = p(b_i) (b_i - c_i) / P_i
//!                          and  dc_i/db_{i-1} = p(b_{i-1}) (c_i - b_{i-1}) / P_i
//!     step <- J^-1 F, halved until b - step is increasing and |F| falls
//!     b    <- b - step
//! until the step is so small against the narrowest cell that the next one is below rounding
//! ```
//!
//! Everything is measured from the density's centre and moved in the end, so that a density far from zero has the same
//! quantizer as one at zero.
//!
//! ```
//! use fewbits_quantizers::lloyd_max;
//! let four = lloyd_max::gaussian(4)?;
//! assert!((four.breakpoints()[2] - 0.981_598_821_567_8).abs() < 1e-12);
//! assert!((four.mean_squared_error() - 0.117_481_847_829).abs() < 1e-12);
//! # Ok::<(), fewbits_quantizers::Error>(())
//! ```

use crate::density::{CellMoments, Density, Normal};
use crate::error::{Error, refuse};
use crate::quantizer::{cell_of, check_increasing, increasing};
use fewbits_numerics::error::{all_finite, finite, non_negative, positive, probabilities};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// Largest number of levels: beyond it a linear quantizer with dither serves as well.
pub const MAX_LEVELS: usize = 4096;
/// Newton steps below this share of the narrowest cell leave, squared, an error below rounding.
const LAST_STEP: f64 = 3e-8;
/// Steps below this share of the narrowest cell that no longer shrink have met the rounding of the equations.
const ROUNDING_STEP: f64 = 1e-5;
/// Residuals below this share of the density's extent count as no worse than any other.
const RESIDUAL_TOLERANCE: f64 = 1e-13;
/// Newton needs 4 to 15 steps; what needs more is not a density with a unique optimum.
const MAX_ITERATIONS: usize = 200;

/// A least-squares scalar quantizer: cells `[b_{i-1}, b_i)` and the centroid of each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Table", into = "Table")]
pub struct LloydMax {
    breakpoints: Vec<f64>,
    centroids: Vec<f64>,
    probabilities: Vec<f64>,
    mean_squared_error: f64,
}

/// The stored form.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    breakpoints: Vec<f64>,
    centroids: Vec<f64>,
    probabilities: Vec<f64>,
    mean_squared_error: f64,
}

impl From<LloydMax> for Table {
    fn from(quantizer: LloydMax) -> Self {
        Self {
            breakpoints: quantizer.breakpoints,
            centroids: quantizer.centroids,
            probabilities: quantizer.probabilities,
            mean_squared_error: quantizer.mean_squared_error,
        }
    }
}

impl TryFrom<Table> for LloydMax {
    type Error = Error;

    fn try_from(table: Table) -> Result<Self, Error> {
        let Table {
            breakpoints,
            centroids,
            probabilities: masses,
            mean_squared_error,
        } = table;
        check_increasing(&breakpoints)?;
        all_finite("centroids", &centroids)?;
        probabilities("probabilities", &masses)?;
        non_negative("mean_squared_error", mean_squared_error)?;
        let levels = breakpoints.len() + 1;
        if breakpoints.is_empty() || centroids.len() != levels || masses.len() != levels {
            let given = format!("{} centroids, {} probabilities", centroids.len(), masses.len());
            return refuse("centroids", given, format!("one per cell, {levels} of each, and at least two cells"));
        }
        let inside = |i: usize| {
            (i == 0 || breakpoints[i - 1] <= centroids[i]) && (i + 1 == levels || centroids[i] <= breakpoints[i])
        };
        if let Some(at) = (0..levels).find(|i| !inside(*i)) {
            return refuse("centroids", format!("{} at index {at}", centroids[at]), "a point of its own cell");
        }
        Ok(Self {
            breakpoints,
            centroids,
            probabilities: masses,
            mean_squared_error,
        })
    }
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

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.centroids.len()
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

    /// The quantizer of `mean + deviation X`, where this one is the quantizer of `X`.
    ///
    /// # Errors
    /// If `mean` is not finite, `deviation` is not a positive number, or the mean is so large that breakpoints coincide.
    pub fn affine(&self, mean: f64, deviation: f64) -> Result<Self, Error> {
        finite("mean", mean)?;
        positive("deviation", deviation)?;
        let map = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| mean + deviation * x).collect() };
        let breakpoints = map(&self.breakpoints);
        check_increasing(&breakpoints)?;
        Ok(Self {
            breakpoints,
            centroids: map(&self.centroids),
            probabilities: self.probabilities.clone(),
            mean_squared_error: deviation * deviation * self.mean_squared_error,
        })
    }

    /// Index of the cell that holds `x`, 0 to `levels - 1`: the number of breakpoints at or below it.
    ///
    /// # Errors
    /// If `x` is NaN.
    #[inline]
    pub fn encode(&self, x: f64) -> Result<usize, Error> {
        cell_of(&self.breakpoints, x)
    }
}

/// The Lloyd-Max quantizer of `density` with `levels` levels.
///
/// # Errors
/// [`Error::Argument`] unless `levels` is in `2..=MAX_LEVELS`, or if the density lies so far from zero that breakpoints
/// coincide; [`Error::NotConverged`] if the density is too rough for a unique optimum to be found.
pub fn design(density: &impl Density, levels: usize) -> Result<LloydMax, Error> {
    if !(2..=MAX_LEVELS).contains(&levels) {
        return refuse("levels", levels, format!("a number of levels from 2 to {MAX_LEVELS}"));
    }
    let table = density.normal_deviation().filter(|_| levels <= KEPT_LEVELS);
    let start = match table {
        Some(deviation) => kept(levels)?.breakpoints.iter().map(|b| deviation * b).collect(),
        None => density.companding(levels),
    };
    design_from(density, start)
}

fn design_from(density: &impl Density, mut b: Vec<f64>) -> Result<LloydMax, Error> {
    let (low, high) = density.extent();
    let negligible = RESIDUAL_TOLERANCE * (high - low);
    let mut solver = Solver::new(b.len() + 1);
    let mut trial = b.clone();
    solver.enter(density, &b);
    let (mut change, mut before) = (f64::INFINITY, solver.residual());
    for _ in 0..MAX_ITERATIONS {
        solver.newton_step(density, &b);
        let mut share = 1.0;
        let after = loop {
            for ((t, b), s) in trial.iter_mut().zip(&b).zip(&solver.step) {
                *t = b - share * s;
            }
            if increasing(&trial) {
                solver.enter(density, &trial);
                let after = solver.residual();
                if after <= before || after <= negligible {
                    break after;
                }
            }
            share *= 0.5;
            if share < 1e-6 {
                // Newton has no descent here: one sweep of the fixed point always has.
                solver.enter(density, &b);
                solver.residual();
                for ((t, b), r) in trial.iter_mut().zip(&b).zip(&solver.residual) {
                    *t = b - r;
                }
                solver.enter(density, &trial);
                break solver.residual();
            }
        };
        let last = change;
        change = b.iter().zip(&trial).fold(0.0, |m, (p, q)| f64::max(m, (p - q).abs()));
        std::mem::swap(&mut b, &mut trial);
        before = after;
        if !increasing(&b) {
            // A density that is not a number somewhere.
            break;
        }
        let narrowest = b.windows(2).map(|w| w[1] - w[0]).fold(0.5 * (high - low), f64::min);
        let quadratic = share == 1.0 && change <= LAST_STEP * narrowest;
        let at_rounding = change <= ROUNDING_STEP * narrowest && change >= 0.5 * last;
        if quadratic || at_rounding || change <= negligible {
            return finish(density, &b, &solver.cells);
        }
    }
    Err(Error::NotConverged {
        algorithm: "Lloyd-Max",
        iterations: MAX_ITERATIONS,
        change,
    })
}

/// The midpoint equations and their Newton steps, without an allocation a step.
struct Solver {
    cells: Vec<CellMoments>,
    residual: Vec<f64>,
    densities: Vec<f64>,
    diagonal: Vec<f64>,
    step: Vec<f64>,
}

impl Solver {
    fn new(levels: usize) -> Self {
        let empty = CellMoments {
            mass: 0.0,
            from_lower: 0.0,
            to_upper: 0.0,
        };
        Self {
            cells: vec![empty; levels],
            residual: vec![0.0; levels - 1],
            densities: vec![0.0; levels - 1],
            diagonal: vec![0.0; levels - 1],
            step: vec![0.0; levels - 1],
        }
    }

    /// Takes the cells between the breakpoints `b`.
    fn enter(&mut self, density: &impl Density, b: &[f64]) {
        let mut lower = f64::NEG_INFINITY;
        for (i, cell) in self.cells.iter_mut().enumerate() {
            let upper = b.get(i).copied().unwrap_or(f64::INFINITY);
            *cell = density.cell(lower, upper);
            lower = upper;
        }
    }

    /// `b_i - (c_i + c_{i+1}) / 2` for all `i`; returns the largest size.
    fn residual(&mut self) -> f64 {
        let mut largest = 0.0;
        for (r, pair) in self.residual.iter_mut().zip(self.cells.windows(2)) {
            *r = 0.5 * (pair[0].to_upper - pair[1].from_lower);
            largest = f64::max(largest, r.abs());
        }
        largest
    }

    /// Solves the tridiagonal Newton system at `b` by elimination.
    fn newton_step(&mut self, density: &impl Density, b: &[f64]) {
        let n = b.len();
        for (d, b) in self.densities.iter_mut().zip(b) {
            *d = density.pdf(*b);
        }
        let (cells, densities) = (&self.cells, &self.densities);
        // Influence of an edge on the centroid of a cell, at the given distance from each other.
        let pull = |cell: &CellMoments, edge: usize, distance: f64| {
            if cell.mass > 0.0 {
                0.5 * densities[edge] * distance / cell.mass
            } else {
                0.25
            }
        };
        let of_upper = |i: usize| pull(&cells[i], i, cells[i].to_upper);
        let of_lower = |i: usize| pull(&cells[i], i - 1, cells[i].from_lower);
        self.step.copy_from_slice(&self.residual);
        for i in 0..n {
            self.diagonal[i] = 1.0 - of_upper(i) - of_lower(i + 1);
            if i > 0 {
                let factor = -of_lower(i) / self.diagonal[i - 1];
                self.diagonal[i] += factor * of_upper(i);
                self.step[i] -= factor * self.step[i - 1];
            }
        }
        for i in (0..n).rev() {
            let above = if i + 1 < n {
                of_upper(i + 1) * self.step[i + 1]
            } else {
                0.0
            };
            self.step[i] = (self.step[i] + above) / self.diagonal[i];
        }
    }
}

/// Moves the cells to their place and adds up what they cost, all terms positive.
fn finish(density: &impl Density, b: &[f64], cells: &[CellMoments]) -> Result<LloydMax, Error> {
    let centre = density.centre();
    let mut lower = f64::NEG_INFINITY;
    let (mut centroids, mut error) = (Vec::with_capacity(cells.len()), 0.0);
    for (i, cell) in cells.iter().enumerate() {
        let upper = b.get(i).copied().unwrap_or(f64::INFINITY);
        let centroid = if upper.is_finite() {
            upper - cell.to_upper
        } else {
            lower + cell.from_lower
        };
        error += density.squared_error(lower, upper, centroid);
        centroids.push(centre + centroid);
        lower = upper;
    }
    let breakpoints: Vec<f64> = b.iter().map(|b| centre + b).collect();
    check_increasing(&breakpoints)?;
    Ok(LloydMax {
        breakpoints,
        centroids,
        probabilities: cells.iter().map(|c| c.mass).collect(),
        mean_squared_error: error,
    })
}

/// Quantizers of the standard normal density up to this many levels are designed once and kept.
pub const KEPT_LEVELS: usize = 256;

/// The Lloyd-Max quantizer of the standard normal density: from the kept tables up to 256 levels, designed beyond.
///
/// # Errors
/// As [`design`].
pub fn gaussian(levels: usize) -> Result<LloydMax, Error> {
    if (2..=KEPT_LEVELS).contains(&levels) {
        kept(levels).cloned()
    } else {
        standard(levels)
    }
}

fn standard(levels: usize) -> Result<LloydMax, Error> {
    if !(2..=MAX_LEVELS).contains(&levels) {
        return refuse("levels", levels, format!("a number of levels from 2 to {MAX_LEVELS}"));
    }
    let mut quantizer = design_from(&Normal::STANDARD, Normal::STANDARD.companding(levels))?;
    // The optimum is odd; averaging removes the last rounding error and makes the middle edge 0 exactly.
    symmetrise(&mut quantizer.breakpoints);
    symmetrise(&mut quantizer.centroids);
    Ok(quantizer)
}

fn kept(levels: usize) -> Result<&'static LloydMax, Error> {
    static TABLES: [OnceLock<Result<LloydMax, Error>>; KEPT_LEVELS + 1] = [const { OnceLock::new() }; KEPT_LEVELS + 1];
    TABLES[levels]
        .get_or_init(|| standard(levels))
        .as_ref()
        .map_err(Clone::clone)
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
    if !(1..=TABLE_BITS).contains(&bits) {
        return refuse("bits", bits, "a word length from 1 to 8");
    }
    kept(1 << bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::density::{SmoothDensity, Uniform};
    use fewbits_numerics::normal;

    /// Largest violation of the midpoint equations.
    fn violation(density: &impl Density, breakpoints: &[f64]) -> f64 {
        let b: Vec<f64> = breakpoints.iter().map(|b| b - density.centre()).collect();
        let mut solver = Solver::new(b.len() + 1);
        solver.enter(density, &b);
        solver.residual()
    }

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
            assert!(violation(&Normal::STANDARD, q.breakpoints()) < 1e-14, "bits {bits}");
            assert_eq!(q.breakpoints()[(1 << bits) / 2 - 1], 0.0);
            assert!(q.entropy_bits() <= bits as f64);
        }
    }

    /// Panter and Dite: `L^2 mse -> sqrt(3) pi / 2` from below.
    #[test]
    fn all_allowed_numbers_of_levels_converge() {
        let mut last = 0.0;
        for levels in [64, 256, 1000, 1024, 2047, 2048, 3000, 4096] {
            let q = gaussian(levels).unwrap();
            assert!(violation(&Normal::STANDARD, q.breakpoints()) < 1e-14, "{levels}");
            let ratio =
                (levels * levels) as f64 * q.mean_squared_error() / (3f64.sqrt() * std::f64::consts::FRAC_PI_2);
            assert!(ratio > last && ratio < 1.0, "{levels}: {ratio}");
            last = ratio;
        }
        assert!(last > 0.998, "{last}");
    }

    #[test]
    fn a_density_far_from_zero_has_the_quantizer_of_one_at_zero() {
        let four = gaussian(4).unwrap();
        for (mean, deviation) in [(1e4, 1.0), (1e7, 1.0), (-3e3, 1.0), (1e7, 1e-4), (0.0, 1e-4), (0.0, 1e4)] {
            let q = design(&Normal::with_deviation(mean, deviation).unwrap(), 4).unwrap();
            let scaled = q.mean_squared_error() / (deviation * deviation);
            assert!((scaled - 0.117_481_847_829).abs() < 1e-12, "{mean}: {scaled}");
            for (a, b) in q.breakpoints().iter().zip(four.breakpoints()) {
                assert!((a - mean - deviation * b).abs() <= 1e-12 * deviation + 1e-15 * mean.abs());
            }
        }
        assert!((design(&Normal::with_deviation(1e4, 1.0).unwrap(), 8).unwrap().breakpoints()[3] - 1e4).abs() < 1e-11);
        for levels in 2..=64 {
            let q = design(&Normal::with_deviation(3e3, 1.0).unwrap(), levels).unwrap();
            let exact = gaussian(levels).unwrap().mean_squared_error();
            assert!((q.mean_squared_error() / exact - 1.0).abs() < 1e-12, "{levels}");
        }
        // Where the numbers cannot hold the breakpoints apart, that is an error.
        assert!(design(&Normal::with_deviation(1e17, 1.0).unwrap(), 8).is_err());
        assert!(gaussian(8).unwrap().affine(1e17, 1.0).is_err());
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
        let mut solver = Solver::new(5);
        for _ in 0..300 {
            solver.enter(&mixture, &b);
            solver.residual();
            b.iter_mut().zip(&solver.residual).for_each(|(b, r)| *b -= r);
        }
        for (a, b) in b.iter().zip(found.breakpoints()) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn bad_arguments_are_named() {
        assert!(gaussian(1).unwrap_err().to_string().contains("levels"));
        assert!(gaussian(MAX_LEVELS + 1).unwrap_err().to_string().contains("levels"));
        assert!(gaussian_table(9).unwrap_err().to_string().contains("bits"));
        assert!(gaussian(4).unwrap().encode(f64::NAN).is_err());
        let holes = SmoothDensity::new(|x: f64| if x > 2.0 { f64::NAN } else { 1.0 }, 0.0, 1.0, 1).unwrap();
        assert!(design(&holes, 4).is_ok());
    }

    #[test]
    fn tables_are_stored_and_checked_when_restored() {
        let q = gaussian(8).unwrap();
        let json = serde_json::to_string(&q).unwrap();
        assert_eq!(serde_json::from_str::<LloydMax>(&json).unwrap(), q);
        for (from, to) in [("\"centroids\":[-", "\"centroids\":["), ("\"mean_squared_error\":", "\"mean_squared_error\":-")] {
            assert!(serde_json::from_str::<LloydMax>(&json.replacen(from, to, 1)).is_err());
        }
    }
}
