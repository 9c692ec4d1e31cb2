//! A lower bound of the error of given sensors: the van Trees (Bayesian Cramer-Rao) bound with the best weight function.

use crate::observation::source::{Kind, Threshold};
use crate::{Bank, Error};
use fewbits_numerics::newton;
use std::f64::consts::PI;

/// Number of intervals of the coarsest grid, and additional intervals per threshold.
const COARSEST: usize = 512;
const PER_THRESHOLD: usize = 64;
/// Number of grids; each has twice the intervals of the one before.
const LEVELS: usize = 8;
/// Largest number of intervals of a grid.
const FINEST: usize = 1 << 17;
/// The doubling stops if the extrapolated value changes by less than this, relative.
const TOLERANCE: f64 = 1e-11;
/// Largest relative change at the finest grid for which a value is still returned.
const ACCEPTED: f64 = 1e-7;
/// Half width, in noise standard deviations, of the region around a threshold with denser nodes.
const FOCUS: f64 = 4.0;

/// The largest van Trees bound over all weight functions, for the sensors of `bank`.
///
/// For a weight `q(x)` that vanishes where the density does not, `MSE >= E[q]^2 / E[q^2 J + q'^2]`-type bounds hold; the
/// best weight solves a linear boundary-value problem, and its mean is the bound:
///
/// ```text
/// J(x)  = sum_n P1n'(x)^2 / (P0n(x) P1n(x))
/// uniform:   -q'' + J q = 1,                                  q(-V) = q(V) = 0
/// Gaussian:  -q'' + (x / sx^2) q' + (J + 1/sx^2) q = 1,       natural ends
/// bound = E[q(X)]
/// ```
///
/// Both are `-(p q')' + p r q = p` with the density `p` as weight. They are solved by finite volumes (tridiagonal) on grids of
/// doubling fineness with Romberg extrapolation. The grids are even in a smooth coordinate with additional nodes around every threshold,
/// so that peaks of the information are resolved for any noise. Without information the bound is `Var X`. As the noise vanishes, the
/// information becomes infinite at the thresholds and zero elsewhere, and the bound tends to `Delta^2/12`.
///
/// # Errors
/// [`Error::NotConverged`] if the values on the finest grids differ by more than `1e-7`.
pub fn optimal_weight_van_trees(bank: &Bank) -> Result<f64, Error> {
    let source = bank.source();
    let (prior, clamped) = match source.kind() {
        Kind::Uniform { .. } => (0.0, true),
        Kind::Gaussian { deviation } => (1.0 / (deviation * deviation), false),
    };
    let mesh = Mesh::new(source.reach(), &bank.thresholds());
    let mut intervals = COARSEST + PER_THRESHOLD * mesh.focus.len();
    let rate = |x: f64| bank.fisher_information(x) + prior;
    // Nodes and midpoints alternate.
    let mut points = mesh.points(2 * intervals);
    let mut rates: Vec<f64> = points.iter().step_by(2).map(|&x| rate(x)).collect();
    extrapolated(|level| {
        if level > 0 {
            if 2 * intervals > FINEST {
                return None;
            }
            // The previous midpoints become nodes.
            intervals *= 2;
            rates = (0..=intervals)
                .map(|i| if i % 2 == 0 { rates[i / 2] } else { rate(points[i]) })
                .collect();
            points = mesh.points(2 * intervals);
        }
        Some(weighted_mean(&mesh, &points, &rates, clamped, |x| source.density(x)))
    })
}

/// The limit of values on grids of doubling fineness, whose error falls by a factor of four each, by Romberg extrapolation.
fn extrapolated(mut on_grid: impl FnMut(usize) -> Option<f64>) -> Result<f64, Error> {
    let mut row: Vec<f64> = Vec::with_capacity(LEVELS);
    let mut change = f64::INFINITY;
    for level in 0..LEVELS {
        let Some(mut value) = on_grid(level) else { break };
        let last = row.last().copied();
        // One row of the Romberg table, in place: each entry removes the next even power of the width from the error.
        let mut power = 1.0;
        for entry in &mut row {
            power *= 4.0;
            let next = value + (value - *entry) / (power - 1.0);
            *entry = value;
            value = next;
        }
        row.push(value);
        if let Some(last) = last
            && level > 1
        {
            change = (value - last).abs() / value;
            if change <= TOLERANCE {
                break;
            }
        }
    }
    match row.last() {
        Some(limit) if change <= ACCEPTED => Ok(*limit),
        _ => Err(Error::NotConverged {
            algorithm: "van Trees boundary-value problem",
            iterations: row.len(),
            change,
        }),
    }
}

/// The grid coordinate `xi(x)`: half of it is proportional to `x`, half is shared among the thresholds.
struct Mesh {
    reach: f64,
    /// Thresholds inside the support, with the half widths of their regions.
    focus: Vec<(f64, f64)>,
    /// Range of the coordinate over the support.
    total: f64,
}

impl Mesh {
    fn new(reach: f64, thresholds: &[Threshold]) -> Self {
        let inside = thresholds.iter().filter(|t| t.position.abs() < reach);
        let mut focus: Vec<(f64, f64)> = inside.map(|t| (t.position, FOCUS * t.noise_deviation)).collect();
        focus.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        focus.dedup();
        let mut mesh = Self {
            reach,
            focus,
            total: 0.0,
        };
        mesh.total = mesh.coordinate(reach) - mesh.coordinate(-reach);
        mesh
    }

    fn share(&self) -> f64 {
        1.0 / self.focus.len().max(1) as f64
    }

    fn coordinate(&self, x: f64) -> f64 {
        let focused: f64 = self.focus.iter().map(|&(t, width)| ((x - t) / width).atan()).sum();
        0.5 * x / self.reach + self.share() * focused / PI
    }

    /// `dx/dxi`, with the coordinate scaled to run from 0 to 1.
    fn stretch(&self, x: f64) -> f64 {
        let focused: f64 = self
            .focus
            .iter()
            .map(|&(t, width)| width / ((x - t) * (x - t) + width * width))
            .sum();
        self.total / (0.5 / self.reach + self.share() * focused / PI)
    }

    /// The points `x` at `intervals + 1` evenly spaced values of the coordinate, by Newton's method with safeguards.
    fn points(&self, intervals: usize) -> Vec<f64> {
        let start = self.coordinate(-self.reach);
        let mut points = Vec::with_capacity(intervals + 1);
        points.push(-self.reach);
        let mut x = -self.reach;
        for i in 1..intervals {
            let target = start + self.total * i as f64 / intervals as f64;
            let off = |x: f64| (self.coordinate(x) - target, self.total / self.stretch(x));
            let guess = x + self.stretch(x) / intervals as f64;
            x = newton::increasing(off, x, self.reach, guess, 1e-14 * self.reach);
            points.push(x);
        }
        points.push(self.reach);
        points
    }
}

/// `E[q]` for `-(p q')' + p r q = p`, by an elimination in which the only subtraction is that of a ratio from one, so huge
/// information costs no digits. Even entries of `points` are nodes, odd ones midpoints.
fn weighted_mean(mesh: &Mesh, points: &[f64], rates: &[f64], clamped: bool, density: impl Fn(f64) -> f64) -> f64 {
    let n = rates.len() - 1;
    let h = 1.0 / n as f64;
    // Flux coefficient between node i and i + 1, and mass of node i.
    let flux: Vec<f64> = points
        .iter()
        .skip(1)
        .step_by(2)
        .map(|&x| density(x) / (mesh.stretch(x) * h))
        .collect();
    let mass: Vec<f64> = points
        .iter()
        .step_by(2)
        .enumerate()
        .map(|(i, &x)| density(x) * mesh.stretch(x) * if i == 0 || i == n { 0.5 * h } else { h })
        .collect();
    let mut ratio = vec![0.0; n + 1];
    let mut value = vec![0.0; n + 1];
    let (first, last) = if clamped { (1, n - 1) } else { (0, n) };
    // Row `i` reads `-left q_(i-1) + (left + right + mass r) q_i - right q_(i+1) = mass`; forward elimination.
    for i in first..=last {
        let left = if i > 0 { flux[i - 1] } else { 0.0 };
        let right = if i < n { flux[i] } else { 0.0 };
        let (above_ratio, above_value) = if i > first {
            (ratio[i - 1], value[i - 1])
        } else {
            (0.0, 0.0)
        };
        let pivot = right + mass[i] * rates[i] + left * (1.0 - above_ratio);
        ratio[i] = right / pivot;
        value[i] = (mass[i] + left * above_value) / pivot;
    }
    // Back substitution, with the mean of `q` on the way.
    let (mut q, mut mean) = (0.0, 0.0);
    for i in (first..=last).rev() {
        q = value[i] + ratio[i] * q;
        mean += q * mass[i];
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BinaryQuantizer, Source};
    use approx::assert_relative_eq;

    fn bank(source: Source, noise: f64) -> Bank {
        Bank::homogeneous_with_deviation(source, vec![BinaryQuantizer::new(vec![0.0]).unwrap()], noise).unwrap()
    }

    #[test]
    fn without_information_the_bound_is_the_variance() {
        for source in [
            Source::uniform(2.0).unwrap(),
            Source::gaussian_with_deviation(0.3).unwrap(),
        ] {
            let bound = optimal_weight_van_trees(&bank(source, 1e6)).unwrap();
            assert_relative_eq!(bound, source.variance(), max_relative = 1e-9);
        }
    }

    #[test]
    fn without_noise_the_walls_leave_cells() {
        let bound = optimal_weight_van_trees(&bank(Source::uniform(1.0).unwrap(), 1e-4)).unwrap();
        assert!(bound <= 1.0 / 12.0);
        assert_relative_eq!(bound, 1.0 / 12.0, max_relative = 2e-3);
    }

    /// Grids that do not agree, or too few of them, are an error, not a bound.
    #[test]
    fn grids_that_disagree_are_an_error() {
        let limit = extrapolated(|level| Some(2.0 + 0.25_f64.powi(level as i32))).unwrap();
        assert_relative_eq!(limit, 2.0, max_relative = 1e-14);
        for unsettled in [
            extrapolated(|level| Some(if level % 2 == 0 { 1.0 } else { 1.001 })),
            extrapolated(|level| (level < 2).then_some(1.0)),
            extrapolated(|_| Some(f64::NAN)),
        ] {
            assert!(matches!(unsettled, Err(Error::NotConverged { .. })), "{unsettled:?}");
        }
    }

    #[test]
    fn constant_information_has_a_closed_form() {
        // -q'' + a^2 q = 1 with q(+-1) = 0 has mean (1 - tanh(a)/a) / a^2.
        let thresholds: Vec<Threshold> = Threshold::of(&[0.3], 0.05)
            .chain(Threshold::of(&[-0.4], 0.002))
            .collect();
        let mesh = Mesh::new(1.0, &thresholds);
        let value = weighted_mean(&mesh, &mesh.points(2 * 4096), &vec![9.0; 4097], true, |_| 0.5);
        let exact = (1.0 - 3f64.tanh() / 3.0) / 9.0;
        assert_relative_eq!(value, exact, max_relative = 1e-5);
    }
}
