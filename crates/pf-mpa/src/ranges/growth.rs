//! Whether the errors of ranges are in proportion to the distance.

use super::heights::RANGES;
use super::{RangeSettings, RangeTracker, Travel};
use crate::Error;
use nalgebra::Vector3;

/// Proportional errors must explain the ranges better than equal ones by so many nats.
const BETTER: f64 = 12.0;
/// And their noise must be at least this share of the distance: a smaller one is that of a good radio.
const LEAST: f64 = 0.05;

/// What a tracker says of ranges: `ln` of the density of those after the first place, and the noise. `None` if the track is lost, or errors in
/// proportion last.
fn explained(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    ranges: &[(f64, &str, f64)],
) -> Result<Option<(f64, f64)>, Error> {
    let mut tracker = RangeTracker::new(anchors.iter().cloned(), Travel::Full, settings)?.rigid();
    let (mut first, mut slopes, mut noise) = (None, 0.0, 0.0);
    for (time, anchor, range) in ranges {
        let Some(found) = tracker.push(*time, anchor, *range)? else {
            continue;
        };
        if found.lost {
            return Ok(None);
        }
        if first.is_some() && settings.proportional {
            slopes -= range.ln();
        }
        first = first.or(tracker.log_evidence());
        noise = found.noise;
    }
    for (name, _) in anchors {
        // A wrong geometry is explained by errors of any law a little.
        if settings.proportional && tracker.lasting_residuals(name)?.is_some() {
            return Ok(None);
        }
    }
    let found = tracker.log_evidence().zip(first);
    Ok(found.map(|(last, first)| (last - first + slopes, noise)))
}

/// Whether errors in proportion to the distance explain the first 400 ranges much better than equal ones: distances that were computed from signal
/// strengths, for which [`RangeSettings::proportional`] is made. Returns the noise as a share of the distance, and the settings. `ranges`: time in seconds, anchor and
/// range. `None` if the settings say a noise, a range is not positive, or the clock is unknown.
///
/// # Errors
/// As [`RangeTracker::new`] and [`RangeTracker::push`].
pub fn proportion_of(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    ranges: &[(f64, &str, f64)],
) -> Result<Option<(f64, RangeSettings)>, Error> {
    let ranges = &ranges[..ranges.len().min(RANGES)];
    let is_asked = settings.noise.is_none() && !settings.proportional && !settings.unknown_clock;
    if !is_asked || ranges.iter().any(|(_, _, range)| *range <= 0.0) {
        return Ok(None);
    }
    let proportional = RangeSettings {
        proportional: true,
        // Only that there is none means the same of logarithms.
        bias: settings.bias.filter(|bias| *bias == 0.0),
        anchor_bias: settings.anchor_bias.filter(|bias| *bias == 0.0),
        ..settings
    };
    let Some((with, noise)) = explained(anchors, proportional, ranges)? else {
        return Ok(None);
    };
    let equal = explained(anchors, settings, ranges)?;
    let is_better = equal.is_none_or(|(equal, _)| with > equal + BETTER);
    Ok((is_better && noise > LEAST).then_some((noise, proportional)))
}
