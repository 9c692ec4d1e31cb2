//! Second derivatives over the breakpoints of every sensor, where sensors of a group share theirs.
//!
//! The Hessian over the shared breakpoints does not see what happens if two sensors of a group move against each other. By
//! symmetry the Hessian over all their breakpoints has two different blocks, `A` for one sensor and `B` for two, and its
//! eigenvalues are those of `A + (N - 1) B`, which moves all alike, and of `A - B`. Moves of the second kind do not
//! mix with those of another group. Two sensors of the group told apart are enough to find `A` and `B`.

use crate::criterion::Criterion;
use crate::error::Error;
use crate::newton::Objective;
use crate::problem::Problem;
use crate::system::{SensorGroup, System};
use nalgebra::{DVector, SymmetricEigen};

/// The steepest change that moves the sensors of one group against each other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Opposed {
    /// Curvature of the signed criterion per unit of `direction` at each of two sensors.
    pub(super) curvature: f64,
    /// One entry per breakpoint, of length one.
    pub(super) direction: DVector<f64>,
}

/// The largest curvature over moves of the sensors of `group` against each other; `None` for a single sensor.
///
/// # Errors
/// [`Error::TooLarge`] if two sensors told apart make more outcomes than the system allows.
pub(super) fn opposed(system: &System, group: usize, criterion: Criterion) -> Result<Option<Opposed>, Error> {
    let entry = system.group(group)?;
    let [first, second, rest @ ..] = entry.sensors() else {
        return Ok(None);
    };
    let parts = [vec![*first], vec![*second], rest.to_vec()];
    let apart = regrouped(system, group, parts.into_iter().filter(|p| !p.is_empty()))?;
    let problem = Problem::new(&apart, criterion, &[group, group + 1])?;
    let hessian = problem.derivatives(&problem.start()).hessian;
    let n = entry.quantizer().breakpoints().len();
    let difference = hessian.view((0, 0), (n, n)) - hessian.view((0, n), (n, n));
    let eigen = SymmetricEigen::new((&difference + difference.transpose()) * 0.5);
    let top = eigen.eigenvalues.imax();
    Ok(Some(Opposed {
        curvature: eigen.eigenvalues[top],
        direction: eigen.eigenvectors.column(top).into_owned(),
    }))
}

/// The system with `group` in two halves that are moved against each other along `direction`, the larger step `length` at most.
pub(super) fn halved(system: &System, group: usize, direction: &DVector<f64>, length: f64) -> Result<System, Error> {
    let entry = system.group(group)?;
    let (one, other) = entry.sensors().split_at(entry.sensors().len() / 2);
    let apart = regrouped(system, group, [one.to_vec(), other.to_vec()].into_iter())?;
    let step = length / direction.amax();
    let moved = |share: f64| {
        let breakpoints = entry.quantizer().breakpoints().iter().zip(direction);
        entry
            .quantizer()
            .with_breakpoints(breakpoints.map(|(b, d)| b + share * step * d).collect())
    };
    // The mean stays: the smaller half moves further.
    let mut share = 1.0;
    loop {
        let against = -share * one.len() as f64 / other.len() as f64;
        match (moved(share), moved(against)) {
            (Ok(one), Ok(other)) => return apart.with_quantizer(group, one)?.with_quantizer(group + 1, other),
            // Breakpoints met: a shorter step keeps their order.
            (Err(error), _) | (_, Err(error)) if share < 1e-9 => return Err(error.into()),
            _ => share *= 0.5,
        }
    }
}

/// The system with one group replaced by groups of some of its sensors.
fn regrouped(system: &System, group: usize, parts: impl Iterator<Item = Vec<usize>>) -> Result<System, Error> {
    let entry = system.group(group)?;
    let mut groups = system.groups().to_vec();
    let parts = parts.map(|sensors| SensorGroup::new(entry.quantizer().clone(), entry.channel().clone(), sensors));
    groups.splice(group..=group, parts.collect::<Result<Vec<_>, _>>()?);
    Ok(System::new(system.model().clone(), groups)?.with_outcome_limit(system.outcome_limit()))
}
