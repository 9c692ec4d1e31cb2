//! The best fit that any position allows, without its posterior.

use crate::SourceLikelihood;
use crate::belief::SearchBox;
use crate::density::{CellTarget, lattice, split};
use crate::fit::Fit;
use crate::target::Target;
use nalgebra::Vector2;

/// Cells along the longer side of the box to begin with.
const PER_AXIS: usize = 64;
/// Cells kept at each level.
const KEPT: usize = 64;
/// Levels of halving: the cells are then 2^-44 of the first.
const LEVELS: usize = 44;

/// The best fit that any position of the box allows, up to the prior: the cells of best score are split again and again, without
/// regard to how many others are as good. Finds one point of a ring that is too thin to be covered. `None` if no position has any
/// likelihood.
pub(crate) fn best_fit(target: &Target<'_>, likelihood: &SourceLikelihood, search: &SearchBox) -> Option<Fit> {
    let sides: [f64; 2] = std::array::from_fn(|d| search.upper[d] - search.lower[d]);
    let mut width = sides[0].max(sides[1]) / PER_AXIS as f64;
    let most = PER_AXIS * PER_AXIS;
    let mut centres = lattice(&search.lower, &search.upper, width, most).ok()?;
    let mut best: Option<f64> = None;
    // Coarse to fine: the best cells of a level are divided. Scores blur the density over a cell.
    for _ in 0..LEVELS {
        let count = centres[0].len();
        let (mut logs, mut scores) = (vec![0.0; count], vec![0.0; count]);
        target.evaluate(&centres.each_ref().map(Vec::as_slice), 0.5 * width, &mut logs, &mut scores);
        let mut order: Vec<usize> = (0..count).filter(|i| scores[*i] > f64::NEG_INFINITY).collect();
        order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
        order.truncate(KEPT);
        for i in &order {
            let at = Vector2::new(centres[0][*i], centres[1][*i]);
            let sum = likelihood.chi_squared(&at);
            if likelihood.admits(&at, 0.0) && best.is_none_or(|least| sum < least) {
                best = Some(sum);
            }
        }
        centres = split(&centres, order.iter().copied(), 0.25 * width);
        width *= 0.5;
    }
    best.map(|chi_squared| Fit {
        chi_squared,
        samples: likelihood.samples(),
    })
}
