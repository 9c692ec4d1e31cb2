//! The position that fits the samples best, without the posterior.

use crate::SourceLikelihood;
use crate::density::{CellTarget, lattice, split};
use crate::fit::Fit;
use crate::search_box::SearchBox;
use crate::target::Target;
use nalgebra::Vector2;

/// Number of cells along the longer side of the box at the start.
const PER_AXIS: usize = 64;
/// Number of cells kept at each level.
const KEPT: usize = 64;
/// Number of halvings: the last cells are 2^-44 of the first.
const LEVELS: usize = 44;

/// The fit of the best position in the box. At each level only the cells of best score are split, however many others are nearly as
/// good. This finds one point of a ring that is too thin to be covered by cells. `None` if the likelihood is zero everywhere.
pub(crate) fn best_fit(target: &Target<'_>, likelihood: &SourceLikelihood, search: &SearchBox) -> Option<Fit> {
    let sides: [f64; 2] = std::array::from_fn(|d| search.upper[d] - search.lower[d]);
    let mut width = sides[0].max(sides[1]) / PER_AXIS as f64;
    let most = PER_AXIS * PER_AXIS;
    let mut centres = lattice(&search.lower, &search.upper, width, most).ok()?;
    let mut best: Option<f64> = None;
    // Coarse to fine: the best cells of a level are divided. A score is the density averaged over its cell.
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
