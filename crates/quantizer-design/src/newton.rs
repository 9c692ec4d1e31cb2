//! Newton's method with a spectrally modified Hessian, for breakpoints that must stay in order.

use crate::deadline::Deadline;
use crate::derivatives::Derivatives;
use crate::error::Error;
use fewbits_numerics::error::{at_least_one, non_negative, positive};
use nalgebra::{DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// Curvatures smaller than this share of the largest are replaced by it, so that flat directions take finite steps.
const CURVATURE_FLOOR: f64 = 1e-10;
/// A step may lower the objective by this, relative to its size: rounding.
const SLACK: f64 = 1e-15;
/// Where the predicted gain is below this, relative to the objective, rounding hides it: Newton's quadratic convergence is
/// trusted and the objective not consulted.
const HIDDEN_GAIN: f64 = 1e-13;
/// A curvature above this marks a saddle, one below its negative an optimum; in units of the criterion and the breakpoints'
/// scale, so that the verdict knows no unit.
const CURVATURE: f64 = 1e-8;

/// What the second derivatives say of a stationary point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Certificate {
    /// Every change of the breakpoints makes it worse to second order: a local optimum.
    LocalOptimum,
    /// Some change neither improves nor worsens it to second order: nothing is proved.
    Flat,
    /// Some change improves it to second order.
    Saddle,
    /// The point is not known to be stationary: the iteration was not run to its end, or the breakpoints were rounded.
    Unproved,
}

impl Certificate {
    /// The verdict on a largest curvature (of the criterion signed so that larger is better), given the sizes of the criterion
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

/// What Newton's method does at a saddle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AtSaddle {
    /// Steps off along the direction of ascent and goes on. Without this a symmetric start stays symmetric.
    #[default]
    StepOff,
    /// Stays, and returns the saddle with its positive curvature.
    Stay,
}

/// Stopping and safeguards of a Newton design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newton {
    /// Most iterations, escapes from saddles included.
    pub max_iterations: usize,
    /// The iteration ends when no breakpoint moves by more than this times the scale.
    pub tolerance: f64,
    /// No breakpoint moves by more than this times the scale at once.
    pub max_step: f64,
    /// What to do on arriving at a saddle.
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
    /// Refuses settings with which no design could end.
    fn check(&self) -> Result<(), Error> {
        at_least_one("max_iterations", self.max_iterations)?;
        non_negative("tolerance", self.tolerance)?;
        positive("max_step", self.max_step)?;
        Ok(())
    }

    /// Stays at the stationary point that the start leads to, be it a saddle.
    pub fn to_nearest_stationary_point() -> Self {
        Self {
            at_saddle: AtSaddle::Stay,
            ..Self::default()
        }
    }
}

/// An objective to be maximised.
pub(crate) trait Objective {
    fn value(&self, b: &[f64]) -> f64;
    fn derivatives(&self, b: &[f64]) -> Derivatives;
    /// Lengths of the runs of `b` that must be increasing.
    fn blocks(&self) -> Vec<usize>;
    /// The size against which changes of a value are small or large, whatever the unit.
    fn unit(&self, value: f64) -> f64;
}

/// A stationary point that Newton's method found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stationary {
    pub(crate) point: Vec<f64>,
    pub(crate) value: f64,
    pub(crate) largest_curvature: f64,
    pub(crate) certificate: Certificate,
    pub(crate) iterations: usize,
    pub(crate) evaluations: usize,
}

/// Climbs from `start`; an iteration that the deadline cuts short has not converged.
///
/// ```text
/// repeat
///     g, H     <- gradient and Hessian at b;  H = V diag(lambda) V'
///     step     <- V diag(1 / max(|lambda|, 1e-10 max |lambda|)) V' g       # ascent even where H is not negative definite
///     shorten so that no entry exceeds max_step
///     halve until b + step is in order and the objective does not fall
///     b        <- b + step
/// until |step| <= tolerance; at a saddle step off along the top eigenvector and go on
/// ```
pub(crate) fn climb(
    objective: &impl Objective,
    start: &[f64],
    scale: f64,
    newton: &Newton,
    deadline: Deadline,
) -> Result<Stationary, Error> {
    newton.check()?;
    let blocks = objective.blocks();
    let mut b = start.to_vec();
    // Evaluations without derivatives; those with them are as many as iterations.
    let mut values = 0;
    let mut last_step = f64::INFINITY;
    let mut escapes = 0;
    for iteration in 1..=newton.max_iterations {
        if deadline.is_over() {
            return Err(not_converged(iteration - 1, last_step));
        }
        let here = objective.derivatives(&b);
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
        // Rounding in the gradient stops the quadratic decrease before any fixed tolerance on flat objectives.
        let arrived = longest <= newton.tolerance * scale || (trusted && longest >= 0.5 * last_step);
        if arrived {
            let largest_curvature = eigen.eigenvalues.max();
            let certificate = Certificate::of(largest_curvature, unit, scale);
            if newton.at_saddle == AtSaddle::StepOff && certificate == Certificate::Saddle && escapes < 20 {
                escapes += 1;
                last_step = f64::INFINITY;
                let top = eigen.eigenvectors.column(eigen.eigenvalues.imax());
                let off = top * (0.05 * scale / top.amax());
                b = moved(&b, &off, &blocks, |_| true).ok_or_else(|| not_converged(iteration, longest))?;
                continue;
            }
            return Ok(Stationary {
                point: b,
                value: here.value,
                largest_curvature,
                certificate,
                iterations: iteration,
                evaluations: iteration + values,
            });
        }
        last_step = longest;
        let floor = here.value - SLACK * unit;
        let accepted = moved(&b, &step, &blocks, |trial| {
            values += usize::from(!trusted);
            trusted || objective.value(trial) >= floor
        });
        b = accepted.ok_or_else(|| not_converged(iteration, longest))?;
    }
    Err(not_converged(newton.max_iterations, last_step))
}

fn not_converged(iterations: usize, change: f64) -> Error {
    Error::NotConverged {
        algorithm: "Newton",
        iterations,
        change,
    }
}

/// `b + step`, the step halved until the result is in order and accepted; `None` if it never is.
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
    let mut rest = b;
    blocks.iter().all(|n| {
        let (head, tail) = rest.split_at(*n);
        rest = tail;
        head.iter().all(|x| x.is_finite()) && head.windows(2).all(|w| w[0] < w[1])
    })
}
