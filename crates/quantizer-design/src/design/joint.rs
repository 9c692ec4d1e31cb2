//! All breakpoints at once, or one sensor after the other, by Newton's method.

use super::apart::{Opposed, halved, opposed};
use crate::criterion::Criterion;
use crate::deadline::Deadline;
use crate::error::{Error, refuse};
use crate::newton::{AtSaddle, Certificate, Newton, Objective, climb};
use crate::problem::Problem;
use crate::system::System;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::normal;
use fewbits_quantizers::Quantizer;
use rand::RngExt;
use serde::{Deserialize, Serialize};

/// How far breakpoints move off a saddle, in standard deviations of the sample.
const STEP_OFF: f64 = 0.05;
/// A design whose rarest cell is rarer than this has lost a level.
const VANISHED: f64 = 1e-12;

/// The breakpoints over which a [`Certificate`] holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// The breakpoints of every sensor that was designed, each by itself.
    EverySensor,
    /// The breakpoints that the sensors of a group share. Whether it is better to let them differ is not known: there are too many
    /// joint outcomes to find out.
    SharedBreakpoints,
}

/// A stationary point of a criterion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// The system with its designed quantizers.
    pub system: System,
    /// Value of the criterion: nats, squared units, or a probability.
    #[serde(deserialize_with = "crate::error::stored_size")]
    pub value: f64,
    /// Largest eigenvalue of the Hessian of the criterion, signed so that a local optimum has none above 0.
    pub largest_curvature: f64,
    /// What the second derivatives prove.
    pub certificate: Certificate,
    /// Over which breakpoints they were taken.
    pub scope: Scope,
    /// Newton iterations.
    pub iterations: usize,
    /// Evaluations of the criterion, with or without derivatives.
    pub evaluations: usize,
}

impl Design {
    /// The designed quantizers, group after group.
    pub fn quantizers(&self) -> Vec<Quantizer> {
        self.system.quantizers()
    }

    /// Whether the point is a saddle: some change of the breakpoints improves it to second order.
    pub fn is_saddle(&self) -> bool {
        self.certificate == Certificate::Saddle
    }
}

/// The stationary point of `criterion` over the breakpoints of all groups (4.2), started from the system's own quantizers.
///
/// Newton's method finds a *local* optimum; the joint criterion may have several, and from a symmetric start the symmetric one
/// may be a saddle. See [`AtSaddle`](crate::AtSaddle) and [`multi_start`]. The sensors of a group share their breakpoints, unless
/// letting them differ is better to second order and [`AtSaddle::StepOff`](crate::AtSaddle::StepOff) is asked for: then the design
/// has the group in two halves.
///
/// # Errors
/// [`Error::NotConverged`]; [`Error::VanishingCell`] if a level is squeezed out, as happens behind poor channels;
/// [`Error::TooLarge`] and [`Error::Argument`] as [`System::value`].
pub fn joint(system: &System, criterion: Criterion, newton: &Newton) -> Result<Design, Error> {
    joint_until(system, criterion, newton, Deadline::NEVER)
}

/// As [`joint`]; not converged if the time is over first.
pub(crate) fn joint_until(
    system: &System,
    criterion: Criterion,
    newton: &Newton,
    deadline: Deadline,
) -> Result<Design, Error> {
    let every = |system: &System| (0..system.groups().len()).collect::<Vec<_>>();
    let (mut design, mut steepest) = optimise_until(system, &every(system), criterion, newton, deadline)?;
    while newton.at_saddle == AtSaddle::StepOff
        && design.is_saddle()
        && let Some((group, opposed)) = steepest.filter(|(_, opposed)| opposed.curvature > 0.0)
    {
        let length = STEP_OFF * breakpoint_scale(&design.system, &[group]);
        // At a saddle the sensors of a group gain by differing: the group is halved along the direction of ascent, and both halves are
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

/// As [`joint`], over the breakpoints of the groups `active` with all others fixed.
///
/// # Errors
/// As [`joint`]; also if `active` is empty or names a group that is not there.
pub fn optimise_groups(
    system: &System,
    active: &[usize],
    criterion: Criterion,
    newton: &Newton,
) -> Result<Design, Error> {
    Ok(optimise_until(system, active, criterion, newton, Deadline::NEVER)?.0)
}

/// A design, and the group whose sensors gain most to second order if they move against each other.
fn optimise_until(
    system: &System,
    active: &[usize],
    criterion: Criterion,
    newton: &Newton,
    deadline: Deadline,
) -> Result<(Design, Option<(usize, Opposed)>), Error> {
    if active.is_empty() {
        return refuse("active", "empty", "at least one group");
    }
    for g in active {
        system.group(*g)?;
    }
    let problem = Problem::new(system, criterion, active)?;
    let scale = breakpoint_scale(system, active);
    let found = climb(&problem, &problem.start(), scale, newton, deadline)?;
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
    // A maximum among equal quantizers can be a saddle once they may differ: that curvature is checked, too.
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

/// The largest curvature over moves of the sensors of a group against each other, and whether all groups were looked at.
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

/// The size of the breakpoints of some groups: the least standard deviation of their samples.
fn breakpoint_scale(system: &System, groups: &[usize]) -> f64 {
    groups
        .iter()
        .filter_map(|g| system.groups().get(*g))
        .map(|g| system.model().sample_deviation(g.sensors()[0]))
        .fold(f64::INFINITY, f64::min)
}

/// The greedy chain (4.4): sensor by sensor in the given order, each designed for the criterion of the sensors so far.
///
/// Returns one design a stage; stage `n` is a system of `n + 1` sensors. The first sensor's quantizer depends neither on how
/// many follow nor on their noise.
///
/// # Errors
/// As [`joint`]; also unless every group of `system` is a single sensor and `order` names groups at most once.
pub fn greedy(system: &System, order: &[usize], criterion: Criterion, newton: &Newton) -> Result<Vec<Design>, Error> {
    if order.is_empty() {
        return refuse("order", "empty", "at least one group");
    }
    let mut stages: Vec<Design> = Vec::with_capacity(order.len());
    for n in 0..order.len() {
        let chain = &order[..=n];
        let mut sensors = Vec::with_capacity(chain.len());
        let (mut quantizers, mut channels) = (Vec::new(), Vec::new());
        for (stage, g) in chain.iter().enumerate() {
            let group = system.group(*g)?;
            if group.sensors().len() != 1 {
                return refuse("system", format!("{} sensors in group {g}", group.sensors().len()), "single sensors");
            }
            sensors.push(group.sensors()[0]);
            // Sensors before this one keep their design; only the last is optimised.
            let designed = stages.last().and_then(|d| d.system.groups().get(stage));
            quantizers.push(designed.unwrap_or(group).quantizer().clone());
            channels.push(group.channel().clone());
        }
        let model = system.model().subset(&sensors)?;
        let partial = System::distinct(model, quantizers, channels)?.with_outcome_limit(system.outcome_limit());
        stages.push(optimise_groups(&partial, &[n], criterion, newton)?);
    }
    Ok(stages)
}

/// The best of [`joint`] from the system's own quantizers and from `starts` random ones, labels and channels kept.
///
/// Start `i` draws the breakpoints of each group as ordered standard normal samples, scaled by 1.3 standard deviations of the
/// group's sample, from the fixed stream (`seed`, `i`). Starts that fail to converge are passed over.
///
/// # Errors
/// The error of the first start if none converged.
pub fn multi_start(
    system: &System,
    criterion: Criterion,
    starts: usize,
    seed: u64,
    newton: &Newton,
) -> Result<Design, Error> {
    let mut best = joint(system, criterion, newton);
    for start in random_starts(system, starts, seed) {
        let Ok(candidate) = joint(&start, criterion, newton) else {
            continue;
        };
        let better = match &best {
            Ok(design) => {
                // A maximum is preferred to a saddle, whatever their values.
                let saddle = (design.is_saddle(), candidate.is_saddle());
                criterion.sense() * (candidate.value - design.value) > 0.0 && saddle != (false, true)
                    || saddle == (true, false)
            }
            Err(_) => true,
        };
        if better {
            best = Ok(candidate);
        }
    }
    best
}

/// The starts of [`multi_start`]; one whose breakpoints coincide is left out.
pub fn random_starts(system: &System, starts: usize, seed: u64) -> Vec<System> {
    (0..starts)
        .filter_map(|i| random_system(system, Stream::new(seed).named("quantizer-starts").indexed(i as u64)).ok())
        .collect()
}

/// The system with random ordered breakpoints.
fn random_system(system: &System, stream: Stream) -> Result<System, Error> {
    let mut rng = stream.rng();
    let mean = system.model().sample_mean();
    let quantizers = system
        .groups()
        .iter()
        .map(|group| {
            let spread = 1.3 * system.model().sample_deviation(group.sensors()[0]);
            let mut b: Vec<f64> = group
                .quantizer()
                .breakpoints()
                .iter()
                .map(|_| mean + spread * normal::quantile(rng.random_range(0.02..0.98)))
                .collect();
            b.sort_by(f64::total_cmp);
            group.quantizer().with_breakpoints(b)
        })
        .collect::<Result<Vec<_>, _>>()?;
    system.with_quantizers(quantizers)
}
