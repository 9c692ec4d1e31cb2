//! The height of the target, if nobody says it: the ranges tell it, if they are many and the anchors stand well.

use super::{Height, RangeSettings, RangeTracker, Travel};
use crate::Error;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Differences of height that are tried where the anchors have one height, in spreads of the anchors.
const TRIED: [f64; 6] = [0.0, 0.1, 0.2, 0.3, 0.45, 0.7];
/// A difference must explain the ranges better than none by so many nats.
pub(super) const BETTER: f64 = 10.0;
/// Where the anchors have heights: number of heights that are tried, from below the lowest anchor to above the highest by this share of the spread.
const HEIGHTS: usize = 9;
const BEYOND: f64 = 0.5;
/// Of so many rows one may be doubtful.
pub(super) const SELDOM: usize = 20;
/// Heights that are no neighbours must differ by so many nats: anchors of like heights leave two sides.
const APART: f64 = 6.0;
/// Halvings of the step between two heights, about the best one.
const HALVINGS: usize = 3;
/// Ranges from which it is found, at most, and at least for each anchor.
pub(super) const RANGES: usize = 400;
pub(super) const FEWEST: usize = 8;

/// The constant height of the target, from its first ranges: each height that is tried is a tracker, and their evidences decide. `ranges`: time in
/// seconds, anchor and range. If all anchors have one height, above and below it are the same: anchors that hang high are above the target. It is only
/// returned then if the ranges say that there is a difference. `None` if the ranges do not tell it, if it is stated or the clock unknown, if there are fewer than four anchors or eight ranges of
/// each that differ from the one before, or if a tracker loses the track.
///
/// # Errors
/// As [`RangeTracker::new`] and [`RangeTracker::push`].
pub fn height_of(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    ranges: &[(f64, &str, f64)],
) -> Result<Option<f64>, Error> {
    let is_asked = settings.height == Height::Unsaid && !settings.unknown_clock;
    if !is_asked || anchors.len() < 4 || ranges.len() < FEWEST * anchors.len() {
        return Ok(None);
    }
    let ranges = &ranges[..ranges.len().min(RANGES)];
    // A range that repeats the one before of its anchor, as rounded ones of a target at rest do, says nothing more of the height.
    let mut latest: BTreeMap<&str, f64> = BTreeMap::new();
    let mut told = 0;
    for (_, anchor, range) in ranges {
        told += usize::from(latest.insert(anchor, *range) != Some(*range));
    }
    if told < FEWEST * anchors.len() {
        return Ok(None);
    }
    // `ln` of the density of the ranges, and whether bias and scale contradict what is supposed of them.
    let evidence = |height: f64| -> Result<(f64, bool), Error> {
        let settings = RangeSettings {
            height: Height::Known(height),
            ..settings
        };
        let mut tracker = RangeTracker::new(anchors.iter().cloned(), Travel::Full, settings)?.rigid();
        let mut doubtful = 0;
        for (time, anchor, range) in ranges {
            let found = tracker.push(*time, anchor, *range)?;
            doubtful += usize::from(found.is_some_and(|found| found.is_doubtful));
        }
        let found = tracker.log_evidence().filter(|_| tracker.losses() == 0);
        Ok((found.unwrap_or(f64::NEG_INFINITY), SELDOM * doubtful > ranges.len()))
    };
    let count = anchors.len() as f64;
    let middle = anchors.iter().map(|(_, place)| place).sum::<Vector3<f64>>() / count;
    let squares: f64 = anchors.iter().map(|(_, place)| (place - middle).norm_squared()).sum();
    let spread = (squares / count).sqrt();
    let level = anchors[0].1.z;
    let is_flat = anchors.iter().all(|(_, place)| place.z == level);
    let tried: Vec<f64> = if is_flat {
        let side = if level > 0.0 { -1.0 } else { 1.0 };
        TRIED.map(|share| level + side * share * spread).to_vec()
    } else {
        let heights = || anchors.iter().map(|(_, place)| place.z);
        let low = heights().fold(f64::INFINITY, f64::min) - BEYOND * spread;
        let high = heights().fold(f64::NEG_INFINITY, f64::max) + BEYOND * spread;
        let step = (high - low) / (HEIGHTS - 1) as f64;
        (0..HEIGHTS).map(|k| low + step * k as f64).collect()
    };
    let (found, doubtful): (Vec<f64>, Vec<bool>) = tried
        .iter()
        .map(|height| evidence(*height))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .unzip();
    let Some(best) = (0..found.len()).max_by(|one, other| found[*one].total_cmp(&found[*other])) else {
        return Ok(None);
    };
    let is_told = if is_flat {
        // Ranges of another unit are explained by a height a little.
        best > 0 && !doubtful[best] && found[0].is_finite() && found[best] > found[0] + BETTER
    } else {
        let is_beaten = |k: usize| k.abs_diff(best) < 2 || found[k] < found[best] - APART;
        best > 0 && best + 1 < found.len() && (0..found.len()).all(is_beaten)
    };
    if !is_told || !found[best].is_finite() {
        return Ok(None);
    }
    let (mut height, mut most) = (tried[best], found[best]);
    let mut step = tried[best] - tried[best - 1];
    for _ in 0..HALVINGS {
        step *= 0.5;
        for other in [height - step, height + step] {
            let (found, _) = evidence(other)?;
            if found > most {
                (height, most) = (other, found);
            }
        }
    }
    Ok(Some(height))
}
