//! Lloyd-Max quantizers: the smallest mean squared error for one scalar and a given number of levels.
//!
//! The optimal breakpoints are midway between the centroids of the two adjacent cells (Lloyd 1957, Max 1960). The usual
//! iteration "centroids, midpoints, centroids, ..." converges linearly and slowly (some 180 iterations for 8 levels and 670 for 16
//! to a step of 1e-12). A centroid depends only on the two edges of its own cell, so the midpoint equations have a
//! tridiagonal Jacobian, and a Newton step costs no more than one such iteration:
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
//! until the step is so small compared with the narrowest cell that the next one is below rounding
//! ```
//!
//! The solution is unique only if the logarithm of the density is concave. Other densities are also solved from the best partition on a
//! fine grid (dynamic programming), and the solution with the smaller error is returned. Each result is checked to be a local optimum
//! without empty cells.
//!
//! Positions are measured from the density's centre and shifted at the end, so that a density far from zero has the same
//! quantizer as one at zero.
//!
//! ```
//! use fewbits_quantizers::lloyd_max;
//! let four = lloyd_max::gaussian(4)?;
//! assert!((four.breakpoints()[2] - 0.981_598_821_567_8).abs() < 1e-12);
//! assert!((four.mean_squared_error() - 0.117_481_847_829).abs() < 1e-12);
//! # Ok::<(), fewbits_quantizers::Error>(())
//! ```

mod newton;
mod partition;
mod table;

pub use table::LloydMax;

use crate::density::{Density, Normal};
use crate::error::{Error, refuse};
use crate::quantizer::check_increasing;
use std::sync::OnceLock;

/// Largest number of levels. For more levels a uniform quantizer with dither is as good.
pub(crate) const MAX_LEVELS: usize = 4096;

/// The Lloyd-Max quantizer of `density` with `levels` levels.
///
/// # Errors
/// [`Error::Argument`] if `levels` is not in `2..=4096`, or if the density is so far from zero that breakpoints
/// coincide; [`Error::NotConverged`] if the density is too rough for an optimum to be found; [`Error::NotOptimal`] if so many levels leave
/// a cell empty.
pub fn design(density: &impl Density, levels: usize) -> Result<LloydMax, Error> {
    checked_levels(levels)?;
    if let Some(deviation) = density.normal_deviation() {
        let start = if levels <= KEPT_LEVELS {
            kept(levels)?.breakpoints.iter().map(|b| deviation * b).collect()
        } else {
            density.companding(levels)
        };
        return newton::solve(density, start);
    }
    // Without a unique optimum the start decides which one is found; two starts are compared.
    let found = newton::solve(density, density.companding(levels));
    let Some(start) = partition::best_on_grid(density, levels) else {
        return found;
    };
    match (found, newton::solve(density, start)) {
        (Ok(a), Ok(b)) => Ok(if b.mean_squared_error() < a.mean_squared_error() {
            b
        } else {
            a
        }),
        (Ok(found), Err(_)) | (Err(_), Ok(found)) => Ok(found),
        (Err(error), Err(_)) => Err(error),
    }
}

/// Quantizers of the standard normal density up to this many levels are designed once and stored.
const KEPT_LEVELS: usize = 256;

/// The Lloyd-Max quantizer of the standard normal density: stored up to 256 levels, designed at each call for more.
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

/// As [`design`], started from given breakpoints, such as those of a similar density or of an earlier design. The result is the
/// local optimum that they lead to. If a cell becomes empty on the way, the result is that of [`design`].
///
/// # Errors
/// As [`design`]; also if the breakpoints are not finite and strictly increasing.
pub fn design_from(density: &impl Density, breakpoints: &[f64]) -> Result<LloydMax, Error> {
    checked_levels(breakpoints.len().saturating_add(1))?;
    check_increasing(breakpoints)?;
    // Breakpoints far from zero may coincide once the centre is subtracted, hence the second check.
    let centre = density.centre();
    let start: Vec<f64> = breakpoints.iter().map(|b| b - centre).collect();
    check_increasing(&start)?;
    let levels = start.len() + 1;
    match newton::solve(density, start) {
        Err(Error::NotOptimal { .. }) => design(density, levels),
        found => found,
    }
}

fn checked_levels(levels: usize) -> Result<usize, Error> {
    if (2..=MAX_LEVELS).contains(&levels) {
        Ok(levels)
    } else {
        refuse("levels", levels, format!("a number of levels from 2 to {MAX_LEVELS}"))
    }
}

fn standard(levels: usize) -> Result<LloydMax, Error> {
    checked_levels(levels)?;
    let mut quantizer = newton::solve(&Normal::STANDARD, Normal::STANDARD.companding(levels))?;
    // The optimum is an odd function; averaging removes the last rounding error and makes the middle edge exactly 0.
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

/// Largest word length stored by [`gaussian_table`].
const TABLE_BITS: usize = 8;

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
    use super::newton::Solver;
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
        }
    }

    /// Panter and Dite: `L^2 mse -> sqrt(3) pi / 2` from below.
    #[test]
    fn all_allowed_numbers_of_levels_converge() {
        let mut last = 0.0;
        for levels in [64, 256, 1000, 1024, 2047, 2048, 3000, 4096] {
            let q = gaussian(levels).unwrap();
            assert!(violation(&Normal::STANDARD, q.breakpoints()) < 1e-14, "{levels}");
            let ratio = (levels * levels) as f64 * q.mean_squared_error() / (3f64.sqrt() * std::f64::consts::FRAC_PI_2);
            assert!(ratio > last && ratio < 1.0, "{levels}: {ratio}");
            last = ratio;
        }
        assert!(last > 0.998, "{last}");
    }

    #[test]
    fn a_density_far_from_zero_has_the_quantizer_of_one_at_zero() {
        let four = gaussian(4).unwrap();
        for (mean, deviation) in [
            (1e4, 1.0),
            (1e7, 1.0),
            (-3e3, 1.0),
            (1e7, 1e-4),
            (0.0, 1e-4),
            (0.0, 1e4),
        ] {
            let q = design(&Normal::with_deviation(mean, deviation).unwrap(), 4).unwrap();
            let scaled = q.mean_squared_error() / (deviation * deviation);
            assert!((scaled - 0.117_481_847_829).abs() < 1e-12, "{mean}: {scaled}");
            for (a, b) in q.breakpoints().iter().zip(four.breakpoints()) {
                assert!((a - mean - deviation * b).abs() <= 1e-12 * deviation + 1e-15 * mean.abs());
            }
        }
        assert!(
            (design(&Normal::with_deviation(1e4, 1.0).unwrap(), 8)
                .unwrap()
                .breakpoints()[3]
                - 1e4)
                .abs()
                < 1e-11
        );
        for levels in 2..=64 {
            let q = design(&Normal::with_deviation(3e3, 1.0).unwrap(), levels).unwrap();
            let exact = gaussian(levels).unwrap().mean_squared_error();
            assert!((q.mean_squared_error() / exact - 1.0).abs() < 1e-12, "{levels}");
        }
        // An error if the breakpoints are equal after rounding.
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
    fn a_design_may_start_from_any_breakpoints() {
        let exact = gaussian(4).unwrap();
        let density = Normal::with_deviation(1e3, 2.0).unwrap();
        for start in [[990.0, 1001.0, 1001.5], [999.999, 1000.0, 1000.001]] {
            let found = design_from(&density, &start).unwrap();
            for (a, b) in found.breakpoints().iter().zip(exact.breakpoints()) {
                assert!((a - 1e3 - 2.0 * b).abs() < 1e-11);
            }
        }
        assert!(design_from(&density, &[]).is_err());
        assert!(design_from(&density, &[1.0, 1.0]).is_err());
        assert!(design_from(&density, &[f64::NAN]).is_err());
    }

    /// Two bells: {-5, 5} is stationary with an empty middle cell. The optimum splits one bell at its centre.
    #[test]
    fn two_bells_with_three_levels_split_one_bell() {
        let bell = |x: f64| normal::pdf((x - 10.0) / 0.1) / 0.1 + normal::pdf((x + 10.0) / 0.1) / 0.1;
        let density = SmoothDensity::new(bell, -12.0, 12.0, 400).unwrap();
        let exact = 0.01 * (0.5 + 0.5 * (1.0 - std::f64::consts::FRAC_2_PI));
        for found in [
            design(&density, 3).unwrap(),
            design_from(&density, &[-5.0, 5.0]).unwrap(),
        ] {
            assert!((found.mean_squared_error() / exact - 1.0).abs() < 1e-9, "{}", found.mean_squared_error());
            assert!(found.probabilities().iter().all(|p| *p > 0.2));
        }
        // Two levels a bell: the quantizer of each bell by itself.
        let four = design(&density, 4).unwrap().mean_squared_error();
        assert!((four / (0.01 * (1.0 - std::f64::consts::FRAC_2_PI)) - 1.0).abs() < 1e-9);
    }

    /// Defect: outer centroids were infinite.
    #[test]
    fn centroids_beyond_the_largest_number_are_refused() {
        let widest = Normal::with_deviation(0.0, f64::MAX).unwrap();
        assert!(design(&widest, 3).is_err());
        assert!(gaussian(3).unwrap().affine(0.0, f64::MAX).is_err());
    }

    #[test]
    fn bad_arguments_are_named() {
        assert!(gaussian(1).unwrap_err().to_string().contains("levels"));
        assert!(gaussian(MAX_LEVELS + 1).unwrap_err().to_string().contains("levels"));
        assert!(gaussian_table(9).unwrap_err().to_string().contains("bits"));
        let holes = SmoothDensity::new(|x: f64| if x > 2.0 { f64::NAN } else { 1.0 }, 0.0, 1.0, 1).unwrap();
        assert!(design(&holes, 4).is_ok());
    }
}
