//! Newton's method over all breakpoints at once, or over one sensor after the other.

use super::apart::{Opposed, halved, opposed};
use crate::criterion::Criterion;
use crate::deadline::Deadline;
use crate::error::Error;
use crate::newton::{AtSaddle, Certificate, Newton, Objective, climb};
use crate::problem::Problem;
use crate::system::System;
use serde::{Deserialize, Serialize};

/// Length of a step away from a saddle, in standard deviations of the sample.
const STEP_OFF: f64 = 0.05;
/// If the least probable cell of a design has a smaller probability, a level is lost.
const VANISHED: f64 = 1e-12;

/// The breakpoints for which a [`Certificate`] holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// The breakpoints of all designed sensors, each moving independently.
    EverySensor,
    /// The breakpoints that the sensors of a group share. Whether different breakpoints are better was not tested, because there are too
    /// many joint outcomes.
    SharedBreakpoints,
}

/// A stationary point of a criterion.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The system with its designed quantizers.
    pub system: System,
    /// Value of the criterion: nats, squared units, or a probability.
    pub value: f64,
    /// Largest eigenvalue of the Hessian of the criterion (signed so that larger is better): not above 0 at a local optimum.
    pub largest_curvature: f64,
    /// The conclusion from the second derivatives.
    pub certificate: Certificate,
    /// The breakpoints for which the second derivatives were computed.
    pub scope: Scope,
    /// Number of Newton iterations.
    pub iterations: usize,
    /// Number of evaluations of the criterion, with or without derivatives.
    pub evaluations: usize,
}

/// The stationary point of `criterion` over the breakpoints of all groups (4.2), reached from the system's own quantizers.
///
/// Newton's method finds a *local* optimum. The criterion may have several, and from a symmetric start the symmetric one
/// may be a saddle; see [`AtSaddle`](crate::AtSaddle). The sensors of a group share their breakpoints. If different
/// breakpoints are better to second order and [`AtSaddle::StepOff`](crate::AtSaddle::StepOff) is set, the group is split into
/// two halves.
///
/// # Errors
/// [`Error::NotConverged`]; [`Error::VanishingCell`] if a cell becomes empty, as happens with poor channels;
/// [`Error::TooLarge`] and [`Error::Argument`] as [`System::value`].
pub fn joint(system: &System, criterion: Criterion, newton: &Newton) -> Result<Design, Error> {
    joint_until(system, criterion, newton, Deadline::NEVER)
}

/// The system with the breakpoints that Newton's method reaches: those of [`joint`] if it converges, otherwise the best until then.
///
/// # Errors
/// [`Error::TooLarge`] and [`Error::Argument`] as [`System::value`].
pub fn improved(system: &System, criterion: Criterion, newton: &Newton) -> Result<System, Error> {
    let all: Vec<usize> = (0..system.groups().len()).collect();
    let problem = Problem::new(system, criterion, &all)?;
    let mut point = problem.start();
    match climb(&problem, &mut point, breakpoint_scale(system, &all), newton, Deadline::NEVER) {
        Ok(_) | Err(Error::NotConverged { .. }) => problem.system_at(&point),
        Err(error) => Err(error),
    }
}

/// As [`joint`]; [`Error::NotConverged`] if the time limit is reached first.
pub(crate) fn joint_until(
    system: &System,
    criterion: Criterion,
    newton: &Newton,
    deadline: Deadline,
) -> Result<Design, Error> {
    let every = |system: &System| (0..system.groups().len()).collect::<Vec<_>>();
    let (mut design, mut steepest) = optimise_until(system, &every(system), criterion, newton, deadline)?;
    while newton.at_saddle == AtSaddle::StepOff
        && design.certificate == Certificate::Saddle
        && let Some((group, opposed)) = steepest.filter(|(_, opposed)| opposed.curvature > 0.0)
    {
        let length = STEP_OFF * breakpoint_scale(&design.system, &[group]);
        // At a saddle at which the sensors of a group should differ, the group is split along the direction of ascent, and both halves are
        // optimised.
        let Ok(apart) = halved(&design.system, group, &opposed.direction, length) else {
            break;
        };
        match optimise_until(&apart, &every(&apart), criterion, newton, deadline) {
            Ok((next, other)) if criterion.sense() * (next.value - design.value) > 0.0 => {
                design = Design {
                    iterations: design.iterations + next.iterations,
                    evaluations: design.evaluations + next.evaluations,
                    ..next
                };
                steepest = other;
            }
            _ => break,
        }
    }
    Ok(design)
}

/// The design of the breakpoints of the groups `active`, with all others fixed, and the group whose sensors gain most to second order
/// by opposite moves.
fn optimise_until(
    system: &System,
    active: &[usize],
    criterion: Criterion,
    newton: &Newton,
    deadline: Deadline,
) -> Result<(Design, Option<(usize, Opposed)>), Error> {
    let problem = Problem::new(system, criterion, active)?;
    let scale = breakpoint_scale(system, active);
    let found = climb(&problem, &mut problem.start(), scale, newton, deadline)?;
    if let Some((quantizer, cell, probability)) = problem.rarest_cell(&found.point)
        && probability < VANISHED
    {
        return Err(Error::VanishingCell {
            quantizer,
            cell,
            probability,
        });
    }
    let designed = problem.system_at(&found.point)?;
    let unit = problem.unit(found.value);
    // A maximum among equal quantizers can be a saddle if they may differ, so this curvature is tested too.
    let (steepest, scope) = steepest_opposed(&designed, active, criterion)?;
    let largest_curvature = steepest
        .iter()
        .fold(found.largest_curvature, |largest, (_, opposed)| largest.max(opposed.curvature));
    let design = Design {
        system: designed,
        value: (found.value + problem.offset()) * criterion.sense(),
        largest_curvature,
        certificate: Certificate::of(largest_curvature, unit, scale),
        scope,
        iterations: found.iterations,
        evaluations: found.evaluations,
    };
    Ok((design, steepest))
}

/// The opposite move of largest curvature over all groups, and whether all groups could be tested.
fn steepest_opposed(
    system: &System,
    groups: &[usize],
    criterion: Criterion,
) -> Result<(Option<(usize, Opposed)>, Scope), Error> {
    let (mut steepest, mut scope) = (None::<(usize, Opposed)>, Scope::EverySensor);
    for group in groups {
        match opposed(system, *group, criterion) {
            Ok(Some(found)) if steepest.as_ref().is_none_or(|s| found.curvature > s.1.curvature) => {
                steepest = Some((*group, found));
            }
            Ok(_) => {}
            Err(Error::TooLarge { .. }) => scope = Scope::SharedBreakpoints,
            Err(error) => return Err(error),
        }
    }
    Ok((steepest, scope))
}

/// Length scale of the breakpoints of some groups: the smallest standard deviation of their samples.
fn breakpoint_scale(system: &System, groups: &[usize]) -> f64 {
    groups
        .iter()
        .filter_map(|g| system.groups().get(*g))
        .map(|g| system.model().sample_deviation(g.sensors[0]))
        .fold(f64::INFINITY, f64::min)
}

/// The stationary point over the breakpoints of the groups `active`, with all other groups fixed. No group is split.
///
/// # Errors
/// As [`joint`].
pub fn of_groups(system: &System, active: &[usize], criterion: Criterion, newton: &Newton) -> Result<Design, Error> {
    Ok(optimise_until(system, active, criterion, newton, Deadline::NEVER)?.0)
}
