//! Choice of the columns from which another one is predicted.

use crate::block::Cells;
use crate::codec::JOINT_COLUMNS;
use fewbits_block_codec::Effort;

/// Number of columns that are considered: the nearest ones before.
const MAX_LOOKED_AT: usize = 32;
/// Smallest correlation of steps for which a column is tried. A predictor that explains a share `r^2` of the variance saves
/// `-log2(1 - r^2) / 2` bits per sample: 0.07 at `r` = 0.3.
const MIN_CORRELATION: f64 = 0.3;
/// Smallest number of pairs of steps.
const MIN_STEPS: f64 = 16.0;

/// The earlier columns whose steps from row to row are correlated with this column's, by decreasing correlation.
pub(crate) fn columns(cells: &[Option<f64>], before: &[Cells], effort: Effort) -> Vec<usize> {
    if effort != Effort::Thorough {
        return Vec::new();
    }
    let nearest = before.iter().enumerate().rev().take(MAX_LOOKED_AT);
    let mut found: Vec<(usize, f64)> = nearest
        .map(|(i, other)| (i, correlation(cells, other).abs()))
        .filter(|(_, correlation)| *correlation >= MIN_CORRELATION)
        .collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    found.truncate(JOINT_COLUMNS);
    found.into_iter().map(|(i, _)| i).collect()
}

fn finite_steps(cells: &[Option<f64>]) -> impl Iterator<Item = Option<f64>> {
    cells
        .windows(2)
        .map(|pair| Some(pair[1]? - pair[0]?).filter(|step| step.is_finite()))
}

/// Correlation of steps about zero; 0 if there are too few.
fn correlation(a: &[Option<f64>], b: &[Option<f64>]) -> f64 {
    let (mut count, mut products, mut squares_a, mut squares_b) = (0.0, 0.0, 0.0, 0.0);
    for (a, b) in finite_steps(a).zip(finite_steps(b)) {
        if let (Some(a), Some(b)) = (a, b) {
            count += 1.0;
            products += a * b;
            squares_a += a * a;
            squares_b += b * b;
        }
    }
    let correlation = products / (squares_a.sqrt() * squares_b.sqrt());
    let is_known = count >= MIN_STEPS && correlation.is_finite();
    if is_known { correlation } else { 0.0 }
}
