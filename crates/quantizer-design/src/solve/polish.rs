//! Newton's method on the breakpoints of a design found on grids, on the full nodes; a cell that vanishes is merged.

use super::pipeline::Participant;
use super::search::WordedCells;
use crate::criterion::{Criterion, Scored};
use crate::design::{Scope, joint};
use crate::error::Error;
use crate::newton::{Certificate, Newton};
use crate::scene::Scene;
use crate::system::{SensorGroup, System};
use fewbits_quantizers::{Channel, Quantizer};

/// Newton's method is left out where one evaluation takes more multiplications than this.
const MAX_EVALUATION_WORK: f64 = 3e7;

/// A design on the full nodes.
pub(super) struct Polished {
    pub(super) system: System,
    /// Cells and words of each participant.
    pub(super) cells: Vec<WordedCells>,
    pub(super) certificate: Certificate,
    pub(super) scope: Scope,
}

/// Whether Newton's method on the full nodes is worth its time.
pub(super) fn is_affordable(scene: &Scene, criterion: Criterion, outcomes: f64) -> bool {
    let per_outcome = Scored::new(criterion, scene)
        .map_or(f64::INFINITY, |s| s.features().iter().map(|f| f.weights.len() as f64).sum::<f64>());
    outcomes * per_outcome <= MAX_EVALUATION_WORK
}

/// Climbs to the stationary point next to a design. Where Newton's method does not converge, or would take too long, the design
/// stays as it is and its certificate says so.
pub(super) fn polish(
    scene: &Scene,
    criterion: Criterion,
    participants: &[Participant],
    mut cells: Vec<WordedCells>,
    apart: bool,
) -> Result<Polished, Error> {
    let scope = if apart {
        Scope::EverySensor
    } else {
        Scope::SharedBreakpoints
    };
    // Most of the way goes on coarse nodes, which are a tenth as many.
    let coarse = scene.coarse()?;
    let mut is_coarse = true;
    loop {
        let system = system_of(if is_coarse { &coarse } else { scene }, participants, &cells, apart)?;
        let unproved = |cells: Vec<WordedCells>| {
            let system = system_of(scene, participants, &cells, apart)?;
            Ok(Polished {
                system,
                cells,
                certificate: Certificate::Unproved,
                scope,
            })
        };
        if !is_affordable(system.scene(), criterion, system.outcomes() as f64) {
            return unproved(cells);
        }
        let newton = Newton {
            max_iterations: if is_coarse { 60 } else { 25 },
            ..Newton::default()
        };
        match joint(&system, criterion, &newton) {
            Ok(design) if design.system.groups().len() == system.groups().len() => {
                for (group, designed) in design.system.groups().iter().enumerate() {
                    for n in system.groups()[group].sensors() {
                        cells[*n].breakpoints = designed.quantizer().breakpoints().to_vec();
                    }
                }
                if is_coarse {
                    is_coarse = false;
                    continue;
                }
                let (certificate, scope) = (design.certificate, design.scope);
                return Ok(Polished {
                    system: design.system,
                    cells,
                    certificate,
                    scope,
                });
            }
            Err(Error::VanishingCell { quantizer, cell, .. }) => {
                let mut merged = false;
                for n in system.groups()[quantizer].sensors() {
                    merged |= merge(&mut cells[*n], cell);
                }
                if !merged {
                    return unproved(cells);
                }
            }
            Err(Error::NotConverged { .. }) if is_coarse => is_coarse = false,
            // A group that Newton's method took apart, or a point that it could not leave.
            Ok(_) | Err(Error::NotConverged { .. } | Error::TooLarge { .. }) => return unproved(cells),
            Err(error) => return Err(error),
        }
    }
}

/// Gives a cell to a neighbour, unless only two cells are left.
fn merge(cells: &mut WordedCells, cell: usize) -> bool {
    if cells.words.len() <= 2 || cell >= cells.words.len() {
        return false;
    }
    cells.words.remove(cell);
    cells.breakpoints.remove(cell.min(cells.breakpoints.len() - 1));
    // Its neighbours may have been one cell.
    let mut i = 1;
    while i < cells.words.len() {
        if cells.words[i] == cells.words[i - 1] && cells.words.len() > 2 {
            cells.words.remove(i);
            cells.breakpoints.remove(i - 1);
        } else {
            i += 1;
        }
    }
    true
}

/// The system of these cells and words; symbols are the received words, and one more if a word may be missing.
pub(super) fn system_of(
    scene: &Scene,
    participants: &[Participant],
    cells: &[WordedCells],
    apart: bool,
) -> Result<System, Error> {
    let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
    for n in 0..participants.len() {
        let alike = groups.iter_mut().find(|(first, _)| {
            !apart
                && cells[*first] == cells[n]
                && participants[*first].law() == participants[n].law()
                && scene.interchangeable(*first, n)
        });
        match alike {
            Some((_, sensors)) => sensors.push(n),
            None => groups.push((n, vec![n])),
        }
    }
    let groups = groups.into_iter().map(|(first, sensors)| {
        let (quantizer, channel) = parts_of(scene, first, &participants[first], &cells[first])?;
        SensorGroup::new(quantizer, channel, sensors)
    });
    System::new(scene.clone(), groups.collect::<Result<_, _>>()?)
}

/// Quantizer and channel of one sensor. A sensor with a single cell gets a second one that is sent as the same word.
fn parts_of(
    scene: &Scene,
    sensor: usize,
    participant: &Participant,
    cells: &WordedCells,
) -> Result<(Quantizer, Channel), Error> {
    let mut used: Vec<usize> = Vec::new();
    let mut labels: Vec<usize> = Vec::new();
    for word in &cells.words {
        let at = used.iter().position(|u| u == word).unwrap_or(used.len());
        if at == used.len() {
            used.push(*word);
        }
        labels.push(at);
    }
    let mut breakpoints = cells.breakpoints.clone();
    if used.len() == 1 {
        used.push(used[0]);
        (labels, breakpoints) = (vec![0, 1], vec![scene.sample_mean()]);
        debug_assert!(sensor < scene.sensors());
    }
    let law = participant.law();
    let rows: Vec<Vec<f64>> = law
        .transition
        .chunks_exact(law.words)
        .map(|row| used.iter().map(|w| row[*w]).collect())
        .collect();
    Ok((Quantizer::with_labels(breakpoints, labels)?, Channel::from_rows(&rows)?))
}
