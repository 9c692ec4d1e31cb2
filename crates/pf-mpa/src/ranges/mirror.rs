//! The other side of anchors that are nearly on a line.
//!
//! Such anchors tell the two sides of their line apart little, and a filter on one side does not follow a target that crosses: beside a place near
//! the line, its mirror image is carried until the ranges decide.

use super::bank::Hypothesis;
use super::odds::shares_of;
use super::settings::Known;
use nalgebra::{Matrix2, Vector2};

/// A place within so many deviations of the line may be on either side.
const NEAR: f64 = 4.0;
/// Share of a place that its mirror image takes.
const CROSSED: f64 = 0.02;
/// Hypotheses of less than this share have no mirror image.
const PROBABLE: f64 = 0.02;

/// Adds the mirror images of probable places near the line, unless a hypothesis of the same kind is there. Of anchors on a line, ranges alone never
/// tell the side: wherever the place is, its image is as probable. `is_carried`: odometry moves the places.
pub(super) fn add_mirrored(known: &Known, hypotheses: &mut Vec<Hypothesis>, is_carried: bool) {
    let Some(line) = known.line.filter(|_| known.axes == 2) else {
        return;
    };
    let mut added: Vec<Hypothesis> = Vec::new();
    let shares = shares_of(hypotheses);
    let is_blind = line.is_exact && !is_carried;
    let mut halved = Vec::new();
    for (number, one) in hypotheses
        .iter()
        .enumerate()
        .filter(|(number, _)| shares[*number] > PROBABLE)
    {
        let (mean, covariance) = one.marginal(&[0, 1]);
        let covariance = Matrix2::from_fn(|a, b| covariance[a][b]);
        let (off, variance) = (line.offset(&mean), line.normal.dot(&(covariance * line.normal)));
        if !is_blind && off * off > NEAR * NEAR * variance {
            continue;
        }
        let image = Vector2::from(mean) - 2.0 * off * line.normal;
        let is_there = |other: &Hypothesis| {
            let (place, spread) = other.marginal(&[0, 1]);
            other.variant == one.variant
                && (0..2).all(|i| (place[i] - image[i]).powi(2) <= spread[i][i].max(covariance[(i, i)]))
        };
        if hypotheses.iter().chain(&added).any(is_there) {
            continue;
        }
        let mut mirrored = one.clone();
        if is_blind {
            mirrored.log_weight += 0.5_f64.ln();
            halved.push(number);
        } else {
            mirrored.log_weight += CROSSED.ln();
        }
        for i in &mirrored.alive {
            line.mirror(&mut mirrored.filters[*i]);
        }
        added.push(mirrored);
    }
    halved
        .into_iter()
        .for_each(|number| hypotheses[number].log_weight += 0.5_f64.ln());
    hypotheses.append(&mut added);
}
