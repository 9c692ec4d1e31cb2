//! Second derivatives for moves in which the sensors of a group do not share their breakpoints.
//!
//! The Hessian over shared breakpoints does not show what happens if two sensors of a group move in opposite directions. By
//! symmetry the Hessian over all their breakpoints has two different blocks, `A` for one sensor and `B` for two. Its
//! eigenvalues are those of `A + (N - 1) B`, for equal moves, and of `A - B`, for opposite moves. Opposite moves do not
//! mix with those of another group. `A` and `B` are found from two sensors of the group that are treated as different.

use crate::criterion::Criterion;
use crate::error::Error;
use crate::newton::Objective;
use crate::problem::Problem;
use crate::system::{SensorGroup, System};
use nalgebra::{DVector, SymmetricEigen};

/// The opposite move of the sensors of one group with the largest curvature.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Opposed {
    /// Curvature of the signed criterion per unit of `direction` at each of two sensors.
    pub(super) curvature: f64,
    /// Unit vector with one entry per breakpoint.
    pub(super) direction: DVector<f64>,
}

/// The opposite move of largest curvature for the sensors of `group`; `None` for a single sensor.
///
/// # Errors
/// [`Error::TooLarge`] if treating two sensors as different makes more outcomes than the system allows.
pub(super) fn opposed(system: &System, group: usize, criterion: Criterion) -> Result<Option<Opposed>, Error> {
    let entry = system.group(group)?;
    let [first, second, rest @ ..] = entry.sensors.as_slice() else {
        return Ok(None);
    };
    let parts = [vec![*first], vec![*second], rest.to_vec()];
    let apart = regrouped(system, group, parts.into_iter().filter(|p| !p.is_empty()))?;
    let problem = Problem::new(&apart, criterion, &[group, group + 1])?;
    let hessian = problem.derivatives(&problem.start()).hessian;
    let n = entry.quantizer.breakpoints().len();
    let difference = hessian.view((0, 0), (n, n)) - hessian.view((0, n), (n, n));
    let eigen = SymmetricEigen::new((&difference + difference.transpose()) * 0.5);
    let top = eigen.eigenvalues.imax();
    Ok(Some(Opposed {
        curvature: eigen.eigenvalues[top],
        direction: eigen.eigenvectors.column(top).into_owned(),
    }))
}

/// The system with `group` split into two halves that are moved in opposite directions along `direction`, by at most `length`.
pub(super) fn halved(system: &System, group: usize, direction: &DVector<f64>, length: f64) -> Result<System, Error> {
    let entry = system.group(group)?;
    let (one, other) = entry.sensors.split_at(entry.sensors.len() / 2);
    let apart = regrouped(system, group, [one.to_vec(), other.to_vec()].into_iter())?;
    let step = length / direction.amax();
    let moved = |share: f64| {
        let breakpoints = entry.quantizer.breakpoints().iter().zip(direction);
        entry
            .quantizer
            .with_breakpoints(breakpoints.map(|(b, d)| b + share * step * d).collect())
    };
    // The mean over all sensors stays, so the smaller half moves further.
    let mut share = 1.0;
    loop {
        let against = -share * one.len() as f64 / other.len() as f64;
        match (moved(share), moved(against)) {
            (Ok(one), Ok(other)) => return apart.with_quantizer(group, one)?.with_quantizer(group + 1, other),
            // Two breakpoints have met: a shorter step keeps their order.
            (Err(error), _) | (_, Err(error)) if share < 1e-9 => return Err(error),
            _ => share *= 0.5,
        }
    }
}

/// The system with one group replaced by several groups of its sensors.
fn regrouped(system: &System, group: usize, parts: impl Iterator<Item = Vec<usize>>) -> Result<System, Error> {
    let entry = system.group(group)?;
    let mut groups = system.groups().to_vec();
    let parts = parts.map(|sensors| SensorGroup {
        sensors,
        ..entry.clone()
    });
    groups.splice(group..=group, parts);
    system.with_groups(groups)
}
