//! One group after the other, each to its optimum given the others.

use super::dynamic_programme::best_contiguous;
use super::joint::{Design, breakpoint_scale, optimise_groups, with_opposed};
use crate::criterion::{Criterion, Scored};
use crate::error::Error;
use crate::newton::{Certificate, Newton};
use crate::system::System;

/// Cyclic maximisation (4.2): group after group, each to its optimum given the others, until a sweep gains less than
/// `tolerance`, in nats, prior variances or probabilities. A coordinate-wise optimum, which where noise is correlated is often short of the joint one.
///
/// With `candidates` each sensor is first set to its global optimum among contiguous quantizers on that grid
/// ([`best_contiguous`]) where that is better than what it has.
///
/// # Errors
/// As [`joint`](super::joint); [`Error::NotConverged`] after 500 sweeps.
pub fn cyclic(
    system: &System,
    criterion: Criterion,
    candidates: Option<&[f64]>,
    tolerance: f64,
    newton: &Newton,
) -> Result<Design, Error> {
    const SWEEPS: usize = 500;
    let scored = Scored::new(criterion, system.scene())?;
    let size = match criterion {
        Criterion::MeanSquaredError => system.scene().prior_variance(),
        Criterion::MutualInformation | Criterion::BayesError => 1.0,
    };
    let mut current = system.clone();
    let mut value = criterion.sense() * current.value(criterion)?;
    let (mut iterations, mut evaluations, mut gain) = (0, 1, f64::INFINITY);
    for _ in 0..SWEEPS {
        let before = value;
        for group in 0..current.groups().len() {
            if let Some(candidates) = candidates {
                let (quantizer, found) = best_contiguous(&current, group, criterion, candidates)?;
                if criterion.sense() * found > value {
                    current = current.with_quantizer(group, quantizer)?;
                }
            }
            let design = optimise_groups(&current, &[group], criterion, newton)?;
            iterations += design.iterations;
            evaluations += design.evaluations;
            value = criterion.sense() * design.value;
            current = design.system;
        }
        gain = value - before;
        if gain <= tolerance * size {
            let found = current.derivatives(criterion)?;
            let eigen = nalgebra::SymmetricEigen::new(found.hessian * criterion.sense());
            let unit = scored.unit(criterion.sense() * found.value, current.scene());
            let all: Vec<usize> = (0..current.groups().len()).collect();
            let (largest_curvature, scope) = with_opposed(&current, &all, criterion, eigen.eigenvalues.max())?;
            let certificate = Certificate::of(largest_curvature, unit, breakpoint_scale(&current, &all));
            return Ok(Design {
                system: current,
                value: found.value,
                largest_curvature,
                certificate,
                scope,
                iterations,
                evaluations,
            });
        }
    }
    Err(Error::NotConverged {
        algorithm: "cyclic maximisation",
        iterations: SWEEPS,
        change: gain,
    })
}
