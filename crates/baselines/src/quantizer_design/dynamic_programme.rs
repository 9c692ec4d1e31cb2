//! The best contiguous quantizer of one sensor on a grid of candidate breakpoints, with the others fixed.
//!
//! Behind an ideal channel every criterion is a sum over cells, so the best partition into intervals is found by dynamic
//! programming over the right edge of the last cell:
//!
//! ```text
//! v(a, b)   <- contribution of the cell [e_a, e_b)
//! V_1(b)    <- v(0, b)
//! V_l(b)    <- max over a < b of V_{l-1}(a) + v(a, b)      for l = 2..L
//! partition <- trace back from V_L(end)
//! ```
//!
//! The result is the global optimum among contiguous quantizers of that sensor on the grid. For a binary unknown it is the optimum among
//! all its quantizers, since the best cells are then intervals of the likelihood ratio. It is no global optimum for several sensors
//! together: if their noise is correlated, there are many coordinate-wise optima.

use super::gains::single_sensor;
use fewbits_numerics::error::refuse;
use fewbits_quantizer_design::engine::Problem;
use fewbits_quantizer_design::{Criterion, Error, System};
use fewbits_quantizers::{Channel, Quantizer};

/// Largest number of candidates; the work grows with its square.
const MAX_CANDIDATES: usize = 2000;

/// The best quantizer of the sensor in `group` with breakpoints among `candidates`, and the value of the criterion with it.
///
/// # Errors
/// [`Error::Argument`] if the group is not a single sensor behind an ideal channel, or the candidates are not increasing
/// finite numbers, at least one fewer than levels and at most 2000.
pub fn best_contiguous(
    system: &System,
    group: usize,
    criterion: Criterion,
    candidates: &[f64],
) -> Result<(Quantizer, f64), Error> {
    let entry = single_sensor(system, group)?;
    if entry.channel != Channel::ideal(entry.channel.inputs())? {
        return refuse("channel", "not ideal", "an ideal channel: cell values do not add up behind a noisy one");
    }
    let levels = entry.channel.inputs();
    if candidates.len() + 1 < levels || candidates.len() > MAX_CANDIDATES {
        let count = format!("{} candidates", candidates.len());
        return refuse("candidates", count, format!("{} to {MAX_CANDIDATES} numbers", levels - 1));
    }
    // Candidates must satisfy the same conditions as the breakpoints of a quantizer.
    Quantizer::new(candidates.to_vec())?;
    let problem = Problem::new(system, criterion, &[group])?;
    let (cells, constant) = (problem.cell_values(candidates), problem.constant());
    let edges = candidates.len() + 2;
    let worth = |a: usize, b: usize| cells[a * edges + b];

    // `best[b]`: the largest sum over cells that end at edge `b`, for the present number of cells.
    let mut best: Vec<f64> = (0..edges)
        .map(|b| if b == 0 { f64::NEG_INFINITY } else { worth(0, b) })
        .collect();
    let mut came_from = Vec::with_capacity(levels);
    for level in 1..levels {
        let mut next = vec![f64::NEG_INFINITY; edges];
        let mut from = vec![0; edges];
        for b in level + 1..edges {
            // `level` cells end at edge `level` at the earliest.
            for a in level..b {
                let value = best[a] + worth(a, b);
                if value > next[b] {
                    (next[b], from[b]) = (value, a);
                }
            }
        }
        best = next;
        came_from.push(from);
    }
    // Trace back from the last edge, which is infinite.
    let mut breakpoints = Vec::with_capacity(levels - 1);
    let mut at = edges - 1;
    for from in came_from.iter().rev() {
        at = from[at];
        breakpoints.push(candidates[at - 1]);
    }
    breakpoints.reverse();
    Ok((Quantizer::new(breakpoints)?, criterion.sense() * (best[edges - 1] + constant)))
}
