//! Mistakes of tables that explain ranges which contradict each other.

use super::heights::{self, RANGES, SELDOM, height_of};
use super::{Height, RangeSettings, RangeTracker, Travel};
use crate::Error;
use nalgebra::Vector3;

/// A mistake must explain the ranges better than other mistakes, and than the tables as they are, by so many nats.
const BETTER: f64 = 30.0;
/// Metres that light goes in a nanosecond.
const LIGHT: f64 = 0.299_792_458;
/// Factors that bring ranges to the unit of the places: of kilometres, centimetres, millimetres and metres, metres and feet, halves of distances, and
/// microseconds of flight, there or there and back.
const UNITS: [f64; 8] = [1e-3, 1e-2, 1e2, 1e3, 1.0 / 0.3048, 2.0, 1e3 * LIGHT, 500.0 * LIGHT];

/// What may be wrong with a table of ranges or of anchors.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Mistake {
    /// Two anchors have each other's place.
    Swapped(String, String),
    /// Two coordinates of an anchor stand for each other: x is y.
    Axes(String),
    /// Ranges are squares of distances.
    Squared,
    /// Ranges are times of flight in nanoseconds, places are in metres.
    Flight,
    /// The same for times to an anchor and back.
    RoundTrip,
    /// Ranges are of another unit than places: times this factor they are of the same.
    Unit(f64),
    /// Ranges are twice the distance: there and back.
    Doubled,
    /// The target is at this height, and not at that of the settings.
    Height(f64),
    /// The height of the target changes.
    HeightChanges {
        /// Mean of the estimates.
        mean: f64,
        /// Twice their standard deviation.
        deviation: f64,
    },
}

/// What one tracker says of some ranges.
struct Trial {
    /// `ln` of their probability density; `None` if the track is lost.
    log_evidence: Option<f64>,
    /// Whether few rows are doubtful, no anchor contradicts the others, none has a bias of its own, and no residuals last.
    fits: bool,
    /// Mean and standard deviation of the heights.
    heights: (f64, f64),
}

fn trial(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    ranges: &[(f64, &str, f64)],
) -> Result<Trial, Error> {
    let mut tracker = RangeTracker::new(anchors.iter().cloned(), Travel::Full, settings)?.rigid();
    let (mut doubtful, mut count, mut sum, mut squares) = (0, 0.0, 0.0, 0.0);
    for (time, anchor, range) in ranges {
        let found = tracker.push(*time, anchor, *range)?;
        if found.as_ref().is_some_and(|found| found.lost) {
            return Ok(Trial {
                log_evidence: None,
                fits: false,
                heights: (0.0, 0.0),
            });
        }
        if let Some(found) = found {
            let z = found.position.z;
            (count, sum, squares) = (count + 1.0, sum + z, squares + z * z);
            doubtful += usize::from(found.is_doubtful);
        }
    }
    let mut fits = SELDOM * doubtful <= ranges.len();
    for (name, _) in anchors {
        fits &= tracker.works(name)? > 0.5 && tracker.own_bias(name)?.is_none();
        fits &= tracker.lasting_residuals(name)?.is_none();
    }
    Ok(Trial {
        log_evidence: tracker.log_evidence(),
        fits,
        heights: (sum / count, (squares / count - (sum / count).powi(2)).max(0.0).sqrt()),
    })
}

/// The mistake that explains the first 400 ranges: each that is tried is a tracker, and their evidences decide.
/// `ranges`: time in seconds, anchor and range. `None` if the tables explain the ranges as they are, or no mistake does much better than all others.
///
/// # Errors
/// As [`RangeTracker::new`] and [`RangeTracker::push`].
pub fn mistake_of(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    ranges: &[(f64, &str, f64)],
) -> Result<Option<Mistake>, Error> {
    let ranges = &ranges[..ranges.len().min(RANGES)];
    let as_it_is = trial(anchors, settings, ranges)?;
    let mut tried: Vec<(f64, Mistake)> = Vec::new();
    let unsaid = RangeSettings {
        height: Height::Unsaid,
        ..settings
    };
    if let Some(height) = height_of(anchors, unsaid, ranges)? {
        let at = RangeSettings {
            height: Height::Known(height),
            ..settings
        };
        let found = trial(anchors, at, ranges)?;
        let log_evidence = found.log_evidence.filter(|_| found.fits);
        tried.extend(log_evidence.map(|found| (found, Mistake::Height(height))));
    }
    let is_flat = anchors.iter().all(|(_, place)| place.z == anchors[0].1.z);
    if !as_it_is.fits && !is_flat && !settings.unknown_clock && matches!(settings.height, Height::Known(_)) {
        let found = trial(anchors, unsaid, ranges)?;
        let (mean, spread) = found.heights;
        let mistake = Mistake::HeightChanges {
            mean,
            deviation: 2.0 * spread,
        };
        let log_evidence = found.log_evidence.filter(|_| found.fits && spread > 0.0);
        tried.extend(log_evidence.map(|found| (found, mistake)));
    }
    // Few ranges of a wrong height fit, but less well.
    if !as_it_is.fits {
        try_tables(anchors, settings, ranges, &mut tried)?;
    }
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let second = tried.get(1).map_or(f64::NEG_INFINITY, |one| one.0);
    let second = second.max(as_it_is.log_evidence.unwrap_or(f64::NEG_INFINITY));
    let best = tried.into_iter().next().filter(|(best, mistake)| {
        // As much as tells a height that nobody says.
        let is_height = matches!(mistake, Mistake::Height(_));
        *best > second + if is_height { heights::BETTER } else { BETTER }
    });
    Ok(best.map(|(_, mistake)| mistake))
}

/// Tries what may be wrong with the tables: those of anchors, and the unit of ranges.
fn try_tables(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    ranges: &[(f64, &str, f64)],
    tried: &mut Vec<(f64, Mistake)>,
) -> Result<(), Error> {
    let mut fit = |anchors: &[(String, Vector3<f64>)], ranges: &[(f64, &str, f64)], slopes: f64, mistake: Mistake| {
        let found = trial(anchors, settings, ranges)?;
        tried.extend(
            found
                .log_evidence
                .filter(|_| found.fits)
                .map(|found| (found + slopes, mistake)),
        );
        Ok::<(), Error>(())
    };
    // An exchange shows in the ranges of both.
    let is_heard = |name: &String| ranges.iter().filter(|(_, anchor, _)| anchor == name).count() >= heights::FEWEST;
    for (i, (name, place)) in anchors.iter().enumerate() {
        let mut others = anchors.to_vec();
        (others[i].1.x, others[i].1.y) = (place.y, place.x);
        if !is_heard(name) {
            continue;
        }
        if place.x != place.y {
            fit(&others, ranges, 0.0, Mistake::Axes(name.clone()))?;
        }
        for (j, (other, at)) in anchors
            .iter()
            .enumerate()
            .skip(i + 1)
            .filter(|(_, (other, _))| is_heard(other))
        {
            let mut others = anchors.to_vec();
            (others[i].1, others[j].1) = (*at, *place);
            fit(&others, ranges, 0.0, Mistake::Swapped(name.clone(), other.clone()))?;
        }
    }
    let is_positive = ranges.iter().all(|(_, _, range)| *range > 0.0);
    if is_positive && !settings.unknown_clock && !settings.proportional {
        let mut change = |mistake: Mistake, map: &dyn Fn(f64) -> f64, slope: &dyn Fn(f64) -> f64| {
            let changed: Vec<(f64, &str, f64)> = ranges
                .iter()
                .map(|(time, name, range)| (*time, *name, map(*range)))
                .collect();
            // The density of a range is that of what it is changed to, times the slope.
            let slopes = ranges.iter().map(|(_, _, range)| slope(*range).ln()).sum();
            fit(anchors, &changed, slopes, mistake)
        };
        change(Mistake::Squared, &|range| range.sqrt(), &|range| 0.5 / range.sqrt())?;
        for factor in UNITS {
            change(Mistake::Unit(factor), &|range| factor * range, &|_| factor)?;
        }
        change(Mistake::Doubled, &|range| 0.5 * range, &|_| 0.5)?;
        change(Mistake::Flight, &|range| LIGHT * range, &|_| LIGHT)?;
        change(Mistake::RoundTrip, &|range| 0.5 * LIGHT * range, &|_| 0.5 * LIGHT)?;
    }
    Ok(())
}
