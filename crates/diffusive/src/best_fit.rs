//! The best fit that any position allows, without its posterior.

use crate::SourceLikelihood;
use crate::belief::SearchBox;
use crate::density::CellTarget;
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
    let counts = sides.map(|side| ((side / width - 1e-9).ceil() as usize).max(1));
    let mut centres: Vec<[f64; 2]> = (0..counts[0] * counts[1])
        .map(|i| {
            let at = [i % counts[0], i / counts[0]];
            std::array::from_fn(|d| search.lower[d] + width * (at[d] as f64 + 0.5))
        })
        .collect();
    let mut best: Option<(f64, Vector2<f64>)> = None;
    for _ in 0..LEVELS {
        let columns = [0, 1].map(|d| centres.iter().map(|c| c[d]).collect::<Vec<f64>>());
        let (mut logs, mut scores) = (vec![0.0; centres.len()], vec![0.0; centres.len()]);
        target.evaluate(&columns.each_ref().map(Vec::as_slice), 0.5 * width, &mut logs, &mut scores);
        let mut order: Vec<usize> = (0..centres.len()).filter(|i| scores[*i] > f64::NEG_INFINITY).collect();
        order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
        order.truncate(KEPT);
        for i in &order {
            let at = Vector2::from(centres[*i]);
            let sum = likelihood.chi_squared(&at);
            if likelihood.admits(&at, 0.0) && best.is_none_or(|(least, _)| sum < least) {
                best = Some((sum, at));
            }
        }
        let step = 0.25 * width;
        let split = |i: &usize| {
            let [x, y] = centres[*i];
            [
                [x - step, y - step],
                [x + step, y - step],
                [x - step, y + step],
                [x + step, y + step],
            ]
        };
        centres = order.iter().flat_map(split).collect();
        width *= 0.5;
    }
    best.map(|(chi_squared, _)| Fit {
        chi_squared,
        samples: likelihood.samples(),
    })
}
