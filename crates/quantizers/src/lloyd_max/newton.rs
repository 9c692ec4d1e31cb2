//! Newton's method for the midpoint equations.

use super::table::LloydMax;
use crate::density::{CellMoments, Density, edges};
use crate::error::Error;
use crate::quantizer::check_increasing;
use fewbits_numerics::error::all_finite;
use fewbits_numerics::tridiagonal;

/// After a Newton step below this fraction of the narrowest cell, the error is its square and below rounding.
const LAST_STEP: f64 = 3e-8;
/// Steps below this fraction of the narrowest cell that no longer shrink are rounding errors of the equations.
const ROUNDING_STEP: f64 = 1e-5;
/// Residuals below this fraction of the density's extent are treated as equal.
const RESIDUAL_TOLERANCE: f64 = 1e-13;
/// A cell of smaller probability is treated as empty: the 4096 cells of a normal density have 1e-10 and more.
const EMPTY_CELL: f64 = 1e-15;
/// A pivot of the Hessian below the negative of this indicates a saddle; rounding gives 1e-13 where it is zero.
const FLAT_PIVOT: f64 = 1e-9;
/// Newton's method needs 4 to 15 steps. More are needed only for densities without a unique optimum.
const MAX_ITERATIONS: usize = 200;

/// The quantizer of smallest squared error near the increasing breakpoints `b`, which are measured from the density's centre: a
/// local optimum without empty cells, or an error.
pub(super) fn solve(density: &impl Density, mut b: Vec<f64>) -> Result<LloydMax, Error> {
    let (low, high) = density.extent();
    let negligible = RESIDUAL_TOLERANCE * (high - low);
    let mut solver = Solver::new(b.len() + 1);
    let mut trial = b.clone();
    solver.enter(density, &b);
    let (mut change, mut before) = (f64::INFINITY, solver.residual());
    for _ in 0..MAX_ITERATIONS {
        solver.newton_step(density, &b);
        // Halve the step until the breakpoints keep their order and the residual falls. A residual at rounding need not fall.
        let mut share = 1.0;
        let after = loop {
            for ((t, b), s) in trial.iter_mut().zip(&b).zip(&solver.step) {
                *t = b - share * s;
            }
            if check_increasing(&trial).is_ok() {
                solver.enter(density, &trial);
                let after = solver.residual();
                if after <= before || after <= negligible {
                    break after;
                }
            }
            share *= 0.5;
            if share < 1e-6 {
                // The Newton step does not reduce the residual here: take one fixed-point iteration, which always reduces the error.
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
        if check_increasing(&b).is_err() {
            // The density is NaN somewhere.
            break;
        }
        // Only a full step converges quadratically, so only then does its length bound the error that is left.
        let narrowest = b.windows(2).map(|w| w[1] - w[0]).fold(0.5 * (high - low), f64::min);
        let quadratic = share == 1.0 && change <= LAST_STEP * narrowest;
        let at_rounding = change <= ROUNDING_STEP * narrowest && change >= 0.5 * last;
        if quadratic || at_rounding || change <= negligible {
            solver.certify(density, &b)?;
            return finish(density, &b, &solver.cells);
        }
    }
    Err(Error::NotConverged {
        algorithm: "Lloyd-Max",
        iterations: MAX_ITERATIONS,
        change,
    })
}

/// The midpoint equations and their Newton steps.
pub(super) struct Solver {
    cells: Vec<CellMoments>,
    pub(super) residual: Vec<f64>,
    step: Vec<f64>,
}

impl Solver {
    pub(super) fn new(levels: usize) -> Self {
        let empty = CellMoments {
            mass: 0.0,
            from_lower: 0.0,
            to_upper: 0.0,
        };
        Self {
            cells: vec![empty; levels],
            residual: vec![0.0; levels - 1],
            step: vec![0.0; levels - 1],
        }
    }

    /// Computes the cells between the breakpoints `b`.
    pub(super) fn enter(&mut self, density: &impl Density, b: &[f64]) {
        density.cells(b, &mut self.cells);
    }

    /// Computes `b_i - (c_i + c_{i+1}) / 2` for all `i`; returns the largest absolute value.
    pub(super) fn residual(&mut self) -> f64 {
        let mut largest = 0.0;
        for (r, pair) in self.residual.iter_mut().zip(self.cells.windows(2)) {
            *r = 0.5 * (pair[0].to_upper - pair[1].from_lower);
            largest = f64::max(largest, r.abs());
        }
        largest
    }

    /// Returns an error if a cell is empty or the stationary point `b` is a saddle.
    ///
    /// The Hessian of the error is the Jacobian with its rows scaled by positive numbers. It is therefore positive semidefinite
    /// if and only if no pivot of the Jacobian is negative.
    fn certify(&self, density: &impl Density, b: &[f64]) -> Result<(), Error> {
        let masses = self.cells.iter().map(|c| c.mass).enumerate();
        let (cell, probability) = masses.min_by(|x, y| x.1.total_cmp(&y.1)).unwrap_or((0, 0.0));
        let (below, diagonal, above) = self.jacobian(density, b);
        // Pivots of Gaussian elimination without exchanges of rows. A pivot at zero is raised, so that the division exists.
        let mut pivot = diagonal[0];
        let mut is_saddle = pivot < -FLAT_PIVOT;
        for i in 1..diagonal.len() {
            pivot = diagonal[i] - below[i - 1] * above[i - 1] / pivot.max(FLAT_PIVOT);
            is_saddle |= pivot < -FLAT_PIVOT;
        }
        if probability > EMPTY_CELL && !is_saddle {
            return Ok(());
        }
        Err(Error::NotOptimal {
            algorithm: "Lloyd-Max",
            cell,
            levels: self.cells.len(),
            probability,
        })
    }

    /// Solves the tridiagonal Newton system at `b`. If it is singular, the step is a fixed-point iteration.
    fn newton_step(&mut self, density: &impl Density, b: &[f64]) {
        let (below, diagonal, above) = self.jacobian(density, b);
        match tridiagonal::solve(&below, &diagonal, &above, &self.residual) {
            Ok(step) => self.step = step,
            Err(_) => self.step.copy_from_slice(&self.residual),
        }
    }

    /// The Jacobian of the midpoint equations: below, on and above the diagonal.
    fn jacobian(&self, density: &impl Density, b: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let n = b.len();
        let densities: Vec<f64> = b.iter().map(|b| density.pdf(*b)).collect();
        // Derivative of a cell's centroid with respect to an edge at the given distance from it.
        let pull = |cell: &CellMoments, edge: usize, distance: f64| {
            if cell.mass > 0.0 {
                0.5 * densities[edge] * distance / cell.mass
            } else {
                // The centroid of an empty cell is its middle, which follows an edge half as far.
                0.25
            }
        };
        let of_upper = |i: usize| pull(&self.cells[i], i, self.cells[i].to_upper);
        let of_lower = |i: usize| pull(&self.cells[i], i - 1, self.cells[i].from_lower);
        let below: Vec<f64> = (1..n).map(|i| -of_lower(i)).collect();
        let diagonal: Vec<f64> = (0..n).map(|i| 1.0 - of_upper(i) - of_lower(i + 1)).collect();
        let above: Vec<f64> = (1..n).map(|i| -of_upper(i)).collect();
        (below, diagonal, above)
    }
}

/// The quantizer in the density's own position, with its error as a sum of positive terms.
fn finish(density: &impl Density, b: &[f64], cells: &[CellMoments]) -> Result<LloydMax, Error> {
    let centre = density.centre();
    let (mut centroids, mut error) = (Vec::with_capacity(cells.len()), 0.0);
    for (i, cell) in cells.iter().enumerate() {
        // Outer cells have one finite edge only.
        let (lower, upper) = edges(b, i);
        let centroid = if upper.is_finite() {
            upper - cell.to_upper
        } else {
            lower + cell.from_lower
        };
        error += density.squared_error(lower, upper, centroid);
        centroids.push(centre + centroid);
    }
    let breakpoints: Vec<f64> = b.iter().map(|b| centre + b).collect();
    check_increasing(&breakpoints)?;
    all_finite("centroids", &centroids)?;
    all_finite("squared error", &[error])?;
    Ok(LloydMax {
        breakpoints,
        centroids,
        probabilities: cells.iter().map(|c| c.mass).collect(),
        mean_squared_error: error,
    })
}
