//! Newton's method on the full nodes for the breakpoints of a design found on grids; a cell that becomes empty is merged.

use super::participant::{SensorDesign, WordedCells, system_of};
use super::solution::Solution;
use crate::criterion::{Criterion, Scored};
use crate::deadline::Deadline;
use crate::design::{Scope, joint_until};
use crate::error::Error;
use crate::newton::{Certificate, Newton};
use crate::observation_model::{ObservationModel, Resolution};

/// Newton's method is left out if the second derivatives need more multiplications than this.
const MAX_HESSIAN_WORK: f64 = 1e8;
/// If evaluating a design needs more multiplications than this, coarse nodes are used, on which its value has an error of 1e-5.
const MAX_VALUE_WORK: f64 = 1e9;
/// The same after the time limit.
const LATE_VALUE_WORK: f64 = 1e8;
/// After the time limit, if one evaluation on coarse nodes needs more than this, rough nodes are used for the value.
const LATE_COARSE_WORK: f64 = 3e8;

/// Whether there is enough time for Newton's method on the full nodes.
pub(super) fn is_affordable(model: &ObservationModel, criterion: Criterion, outcomes: f64) -> bool {
    // A table as large as that of the outcomes: twice for each sensor, and once for each pair.
    let sensors = model.sensors() as f64;
    let tables = 1.0 + 2.0 * sensors + 0.5 * sensors * (sensors - 1.0);
    tables * evaluation_work(model, criterion, outcomes) <= MAX_HESSIAN_WORK
}

/// Whether designs can be compared after the time limit.
pub(super) fn is_quick(model: &ObservationModel, criterion: Criterion, outcomes: f64) -> Result<bool, Error> {
    Ok(evaluation_work(&model.at(Resolution::COARSE)?, criterion, outcomes) <= LATE_COARSE_WORK)
}

/// Multiplications of one evaluation.
pub(super) fn evaluation_work(model: &ObservationModel, criterion: Criterion, outcomes: f64) -> f64 {
    let per_outcome = Scored::new(criterion, model)
        .map_or(f64::INFINITY, |s| s.features().iter().map(|f| f.weights.len() as f64).sum::<f64>());
    outcomes * per_outcome
}

/// Moves to the stationary point next to a design. If Newton's method does not converge or would take too long, the design
/// is unchanged and its certificate says so. A design too large for the full nodes is evaluated on fewer.
pub(super) fn polish(
    model: &ObservationModel,
    criterion: Criterion,
    participants: &[SensorDesign],
    mut cells: Vec<WordedCells>,
    apart: bool,
    deadline: Deadline,
) -> Result<Solution, Error> {
    let scope = if apart {
        Scope::EverySensor
    } else {
        Scope::SharedBreakpoints
    };
    // Most of the iterations use coarse nodes, which are a tenth as many.
    let coarse = model.at(Resolution::COARSE)?;
    let unproved = |cells: Vec<WordedCells>| {
        let mut system = system_of(model, participants, &cells, apart)?;
        let outcomes = system.outcomes() as f64;
        let work = evaluation_work(model, criterion, outcomes);
        let is_late = deadline.is_short_for(work);
        let coarse_work = evaluation_work(&coarse, criterion, outcomes);
        if coarse_work > LATE_COARSE_WORK && deadline.is_short_for(coarse_work) {
            system = system_of(&model.at(Resolution::ROUGH)?, participants, &cells, apart)?;
        } else if work > if is_late { LATE_VALUE_WORK } else { MAX_VALUE_WORK } {
            system = system_of(&coarse, participants, &cells, apart)?;
        }
        Solution::new(criterion, participants, system, cells, Certificate::Unproved, scope)
    };
    let mut is_coarse = true;
    loop {
        let system = system_of(if is_coarse { &coarse } else { model }, participants, &cells, apart)?;
        if deadline.is_over() || !is_affordable(system.model(), criterion, system.outcomes() as f64) {
            return unproved(cells);
        }
        let newton = Newton {
            max_iterations: if is_coarse { 60 } else { 25 },
            ..Newton::default()
        };
        match joint_until(&system, criterion, &newton, deadline) {
            Ok(design) if design.system.groups().len() == system.groups().len() => {
                for (group, designed) in design.system.groups().iter().enumerate() {
                    for n in &system.groups()[group].sensors {
                        cells[*n].breakpoints = designed.quantizer.breakpoints().to_vec();
                    }
                }
                if is_coarse {
                    is_coarse = false;
                    continue;
                }
                let (certificate, scope) = (design.certificate, design.scope);
                return Solution::new(criterion, participants, design.system, cells, certificate, scope);
            }
            Err(Error::VanishingCell { quantizer, cell, .. }) => {
                let mut merged = false;
                for n in &system.groups()[quantizer].sensors {
                    merged |= merge(&mut cells[*n], cell);
                }
                if !merged {
                    return unproved(cells);
                }
            }
            Err(Error::NotConverged { .. }) if is_coarse => is_coarse = false,
            // Newton's method has split a group, or did not converge.
            Ok(_) | Err(Error::NotConverged { .. } | Error::TooLarge { .. }) => return unproved(cells),
            Err(error) => return Err(error),
        }
    }
}

/// Joins a cell to a neighbour; false if there are only two cells.
fn merge(cells: &mut WordedCells, cell: usize) -> bool {
    if cells.words.len() <= 2 || cell >= cells.words.len() {
        return false;
    }
    cells.words.remove(cell);
    cells.breakpoints.remove(cell.min(cells.breakpoints.len() - 1));
    // If its two neighbours have the same word, they become one cell.
    if cells.words.len() > 2 {
        *cells = WordedCells::of(&cells.breakpoints, &cells.words);
    }
    true
}

#[cfg(test)]
mod tests {
    use crate::observation_model::{Noise, ObservationModel, Prior, Resolution};
    use crate::{Criterion, System};

    #[test]
    fn coarse_nodes_give_five_digits() {
        let priors = [
            Prior::normal(3.0, 1.0).unwrap(),
            Prior::uniform(0.0, 3.0).unwrap(),
            Prior::mixture(&[(0.6, -1.0, 0.4), (0.4, 1.5, 0.6)]).unwrap(),
            Prior::density(|x| x * (-x).exp(), 0.0..=12.0).unwrap(),
        ];
        for prior in priors {
            for (deviations, rho) in [([0.3, 0.3], 0.0), ([0.3, 0.3], 0.6), ([0.3, 0.8], 0.85)] {
                let noise = Noise::equicorrelated_with_deviations(&deviations, rho).unwrap();
                let model = ObservationModel::new(prior.clone(), noise).unwrap();
                let full = System::lloyd_max(model.clone(), 4).unwrap();
                let coarse = System::ideal(model.at(Resolution::COARSE).unwrap(), full.quantizers()).unwrap();
                for criterion in [Criterion::MeanSquaredError, Criterion::MutualInformation] {
                    let [a, b] = [&full, &coarse].map(|s| s.value(criterion).unwrap());
                    assert!((a / b - 1.0).abs() < 1e-5, "{prior:?} {rho} {criterion:?}: {a} {b}");
                }
            }
        }
    }
}
