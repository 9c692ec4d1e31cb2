//! Newton's method with a modified Hessian, for breakpoints that must stay in increasing order.

use crate::deadline::Deadline;
use crate::error::{Error, not_converged};
use fewbits_numerics::error::{at_least_one, non_negative, positive};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// Name of the algorithm in errors.
const NEWTON: &str = "Newton";
/// Curvatures below this fraction of the largest are replaced by it, so that steps along flat directions stay finite.
const CURVATURE_FLOOR: f64 = 1e-10;
/// Relative amount by which a step may lower the objective, because of rounding.
const SLACK: f64 = 1e-15;
/// If the predicted gain is below this fraction of the objective, rounding hides it. The Newton step is then taken without comparing the
/// objective.
const HIDDEN_GAIN: f64 = 1e-13;
/// A curvature above this is a saddle, one below its negative an optimum. In units of the criterion and of the breakpoints'
/// scale, so that the result does not depend on units.
const CURVATURE: f64 = 1e-8;

/// Classification of a stationary point by its second derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Certificate {
    /// Every change of the breakpoints makes the criterion worse to second order: a local optimum.
    LocalOptimum,
    /// Some change neither improves nor worsens it to second order: undecided.
    Flat,
    /// Some change improves it to second order.
    Saddle,
    /// The point may not be stationary: the iteration did not converge, or the breakpoints were rounded.
    Unproved,
}

impl Certificate {
    /// The certificate for a largest curvature (of the criterion signed so that larger is better), given the scales of the criterion
    /// and of the breakpoints.
    pub(crate) fn of(largest_curvature: f64, unit: f64, scale: f64) -> Self {
        let relative = largest_curvature * scale * scale / unit.max(f64::MIN_POSITIVE);
        if relative > CURVATURE {
            Self::Saddle
        } else if relative < -CURVATURE {
            Self::LocalOptimum
        } else {
            Self::Flat
        }
    }
}

/// The behaviour of Newton's method at a saddle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AtSaddle {
    /// Steps off in the direction of ascent and continues. Without this a symmetric start stays symmetric.
    #[default]
    StepOff,
    /// Stops and returns the saddle with its positive curvature.
    Stay,
}

/// Stopping rule and safeguards of Newton's method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newton {
    /// Largest number of iterations, steps off saddles included.
    pub max_iterations: usize,
    /// The iteration ends if no breakpoint moves by more than this times the scale.
    pub tolerance: f64,
    /// Largest move of a breakpoint in one iteration, in units of the scale.
    pub max_step: f64,
    /// What to do at a saddle.
    pub at_saddle: AtSaddle,
}

impl Default for Newton {
    fn default() -> Self {
        Self {
            max_iterations: 300,
            tolerance: 1e-13,
            max_step: 0.3,
            at_saddle: AtSaddle::StepOff,
        }
    }
}

impl Newton {
    /// An error for settings with which the iteration cannot end.
    fn check(&self) -> Result<(), Error> {
        at_least_one("max_iterations", self.max_iterations)?;
        non_negative("tolerance", self.tolerance)?;
        positive("max_step", self.max_step)?;
        Ok(())
    }
}

/// A value with its first and second derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Derivatives {
    /// The value.
    pub value: f64,
    /// First derivatives.
    pub gradient: DVector<f64>,
    /// Second derivatives.
    pub hessian: DMatrix<f64>,
}

/// An objective to be maximised.
pub trait Objective {
    /// The value at `b`.
    fn value(&self, b: &[f64]) -> f64;
    /// The value at `b` with its derivatives.
    fn derivatives(&self, b: &[f64]) -> Derivatives;
    /// Lengths of the parts of `b` that must be increasing.
    fn blocks(&self) -> Vec<usize>;
    /// Scale of the value: changes are compared with it, whatever the unit.
    fn unit(&self, value: f64) -> f64;
}

/// A stationary point that Newton's method found.
#[derive(Debug, Clone, PartialEq)]
pub struct Stationary {
    /// The point.
    pub point: Vec<f64>,
    /// The value there.
    pub value: f64,
    /// Largest eigenvalue of the Hessian.
    pub largest_curvature: f64,
    /// What is known of the point.
    pub certificate: Certificate,
    /// Number of iterations.
    pub iterations: usize,
    /// Number of evaluations without derivatives.
    pub evaluations: usize,
}

/// Maximises from `b`, which is the last point afterwards, also if the iteration did not converge. If the deadline ends the iteration, it
/// counts as not converged.
///
/// ```text
/// repeat
///     g, H     <- gradient and Hessian at b;  H = V diag(lambda) V'
///     step     <- V diag(1 / max(|lambda|, 1e-10 max |lambda|)) V' g       # ascent even where H is not negative definite
///     shorten so that no entry exceeds max_step
///     halve until b + step is increasing and the objective does not decrease
///     b        <- b + step
/// until |step| <= tolerance; at a saddle step off along the eigenvector of the largest eigenvalue and continue
/// ```
pub fn climb(
    objective: &impl Objective,
    b: &mut Vec<f64>,
    scale: f64,
    newton: &Newton,
    deadline: Deadline,
) -> Result<Stationary, Error> {
    newton.check()?;
    let blocks = objective.blocks();
    // Counts evaluations without derivatives; those with derivatives equal the iterations.
    let mut values = 0;
    let mut last_step = f64::INFINITY;
    let mut escapes = 0;
    for iteration in 1..=newton.max_iterations {
        if deadline.is_over() {
            return Err(not_converged(NEWTON, iteration - 1, last_step));
        }
        let here = objective.derivatives(b);
        let unit = objective.unit(here.value);
        let eigen = SymmetricEigen::new(here.hessian);
        let along = eigen.eigenvectors.transpose() * &here.gradient;
        let floor = (CURVATURE_FLOOR * eigen.eigenvalues.amax()).max(f64::MIN_POSITIVE);
        let shares = along.zip_map(&eigen.eigenvalues, |g, lambda| g / lambda.abs().max(floor));
        let predicted_gain = 0.5 * along.dot(&shares);
        let mut step: DVector<f64> = &eigen.eigenvectors * shares;
        if step.iter().any(|s| !s.is_finite()) {
            break;
        }
        let longest = step.amax();
        if longest > newton.max_step * scale {
            step *= newton.max_step * scale / longest;
        }
        let trusted = longest <= 1e-3 * scale && predicted_gain <= HIDDEN_GAIN * unit;
        // On flat objectives, rounding of the gradient ends the quadratic convergence before a fixed tolerance is met.
        let arrived = longest <= newton.tolerance * scale || (trusted && longest >= 0.5 * last_step);
        if arrived {
            let largest_curvature = eigen.eigenvalues.max();
            let certificate = Certificate::of(largest_curvature, unit, scale);
            if newton.at_saddle == AtSaddle::StepOff && certificate == Certificate::Saddle && escapes < 20 {
                escapes += 1;
                last_step = f64::INFINITY;
                let top = eigen.eigenvectors.column(eigen.eigenvalues.imax());
                let off = top * (0.05 * scale / top.amax());
                *b = moved(b, &off, &blocks, |_| true).ok_or_else(|| not_converged(NEWTON, iteration, longest))?;
                continue;
            }
            return Ok(Stationary {
                point: b.clone(),
                value: here.value,
                largest_curvature,
                certificate,
                iterations: iteration,
                evaluations: iteration + values,
            });
        }
        last_step = longest;
        let floor = here.value - SLACK * unit;
        let accepted = moved(b, &step, &blocks, |trial| {
            values += usize::from(!trusted);
            trusted || objective.value(trial) >= floor
        });
        *b = accepted.ok_or_else(|| not_converged(NEWTON, iteration, longest))?;
    }
    Err(not_converged(NEWTON, newton.max_iterations, last_step))
}

/// `b + step`, with the step halved until the result is increasing and accepted; `None` if this never happens.
fn moved(
    b: &[f64],
    step: &DVector<f64>,
    blocks: &[usize],
    mut is_accepted: impl FnMut(&[f64]) -> bool,
) -> Option<Vec<f64>> {
    let mut share = 1.0;
    while share >= 1e-14 {
        let trial: Vec<f64> = b.iter().zip(step.iter()).map(|(b, s)| b + share * s).collect();
        if in_order(&trial, blocks) && is_accepted(&trial) {
            return Some(trial);
        }
        share *= 0.5;
    }
    None
}

fn in_order(b: &[f64], blocks: &[usize]) -> bool {
    split(b, blocks).all(|part| part.iter().all(|x| x.is_finite()) && part.windows(2).all(|w| w[0] < w[1]))
}

/// The parts of `b` with these lengths.
pub(crate) fn split<'b>(mut b: &'b [f64], lengths: &[usize]) -> impl Iterator<Item = &'b [f64]> {
    lengths.iter().map(move |n| {
        let (part, rest) = b.split_at(*n);
        b = rest;
        part
    })
}
