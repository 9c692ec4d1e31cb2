//! What the first ranges tell where no option says it: whether errors grow with the distance, and the height of the target.

use super::mistakes::{grows, limit};
use super::settings::{Anchor, RangesOptions};
use crate::error::Error;
use crate::rows::{Instants, Rows};
use crate::text::short;
use fewbits_pf_mpa::{Height, RangeSettings, height_of, proportion_of};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Rows from which it is found.
const FIRST_ROWS: usize = 600;
/// A place is kept over so many steps of an anchor without a range.
const SILENCES: f64 = 4.0;
/// Seconds between an anchor's ranges up to which the library's speeds are supposed.
const EACH: f64 = 5.0;

/// Time in seconds, anchor and range of the first rows, without limits.
fn first<R: Rows>(
    options: &RangesOptions,
    anchors: &[Anchor],
    instants: &mut Instants<R>,
) -> Result<Vec<(f64, String, f64)>, Error> {
    let strengths = options.strengths;
    let first = instants.peek(FIRST_ROWS)?.clone();
    let names = instants.names();
    let mut ranges = Vec::new();
    for instant in &first {
        for (i, (sensor, range)) in instant.reports.iter().enumerate() {
            let name = &names[*sensor];
            let is_limit = instant.qualifiers.get(i).is_some_and(|one| one.limit.is_some());
            let is_known = anchors.iter().any(|(known, _)| known == name);
            let range = range.filter(|range| *range != 0.0 || options.unknown_clock);
            let range = range.map(|range| strengths.map_or(range, |strengths| strengths.distance(range)));
            if let Some(range) = range
                .filter(|range| range.is_finite() && (*range >= 0.0 || options.unknown_clock) && !is_limit && is_known)
            {
                ranges.push((instant.seconds, name.clone(), range));
            }
        }
    }
    // Limits are no distances: they would tell a height that is not there.
    if let Some(limit) = limit(ranges.iter().map(|(_, anchor, range)| (anchor.as_str(), *range))) {
        ranges.retain(|(_, _, range)| *range < limit);
    }
    Ok(ranges)
}

/// The median of the seconds from range to range of an anchor.
fn each(ranges: &[(f64, &str, f64)]) -> Option<f64> {
    let mut last: BTreeMap<&str, f64> = BTreeMap::new();
    let mut steps: Vec<f64> = Vec::new();
    for (time, name, _) in ranges {
        steps.extend(last.insert(name, *time).map(|before| time - before));
    }
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// Takes into the settings that an anchor sends every so many seconds, if these are many: a target whose ranges come slowly moves slowly.
fn take_slowness(
    options: &RangesOptions,
    anchors: &[Anchor],
    settings: &mut RangeSettings,
    each: f64,
) -> Option<String> {
    let kept = options.silence.is_none().then_some(SILENCES * each)?;
    if kept <= settings.silence {
        return None;
    }
    settings.silence = kept;
    let (slower, shown) = (each / EACH, short(kept));
    let mut said =
        format!("an anchor sends every {} s: a place is kept for {shown} s, as --silence {shown} says", short(each));
    if slower > 1.0 && options.persistence.is_none() && options.speed.is_none() && options.odometry.is_empty() {
        let places: Vec<Vector3<f64>> = anchors.iter().map(|(_, place)| *place).collect();
        *settings = settings.slower(&places, slower);
        said += &format!(
            ", and the target is supposed to be {} times slower, as --speed and --persistence may say better",
            short(slower)
        );
    }
    Some(said)
}

/// Takes into the settings what the first ranges of a file tell, and says it. What comes through a pipe is not waited for.
pub(crate) fn take_told<R: Rows>(
    options: &RangesOptions,
    anchors: &[Anchor],
    settings: &mut RangeSettings,
    instants: &mut Instants<R>,
) -> Result<Vec<String>, Error> {
    let mut said = Vec::new();
    if options.looks_ahead {
        let old = instants.leave_out_old(FIRST_ROWS)?;
        if !old.is_empty() {
            let names: Vec<&str> = old.iter().map(|i| instants.names()[*i].as_str()).collect();
            said.push(format!(
                "ranges of {} that repeat the one before are left out: the table holds them until there is a new one",
                names.join(", ")
            ));
        }
    }
    let is_flat = anchors.iter().all(|(_, place)| place.z == 0.0);
    if options.looks_ahead {
        let owned = first(options, anchors, instants)?;
        let ranges: Vec<(f64, &str, f64)> = owned
            .iter()
            .map(|(time, name, range)| (*time, name.as_str(), *range))
            .collect();
        said.extend(each(&ranges).and_then(|each| take_slowness(options, anchors, settings, each)));
        // What is wrong with a range is said when its row is read.
        let height = |settings: RangeSettings| height_of(anchors, settings, &ranges).unwrap_or(None);
        let proportion = |settings: RangeSettings| proportion_of(anchors, settings, &ranges).unwrap_or(None);
        let at = |settings: RangeSettings, height: Option<f64>| RangeSettings {
            height: height.map_or(settings.height, Height::Known),
            ..settings
        };
        let mut found = height(*settings);
        // A height that is not known makes errors that depend on the distance too, and rows may state theirs.
        let grows_by = |settings| proportion(settings).filter(|_| !options.has_accuracies);
        if let Some((noise, proportional)) = grows_by(at(*settings, found)) {
            said.push(grows(noise, "taken, as"));
            *settings = RangeSettings {
                height: settings.height,
                ..proportional
            };
            found = height(*settings);
        }
        if let Some(height) = found {
            settings.height = Height::Known(height);
            let level = anchors.first().map_or(0.0, |(_, place)| place.z);
            let is_flat = anchors.iter().all(|(_, place)| place.z == level);
            let (off, height, level) = (short((height - level).abs()), short(height), short(level));
            said.push(if is_flat {
                format!(
                    "the ranges say that the target is {off} higher or lower than the anchors: taken, as --height {height} says; --height {level} leaves it out"
                )
            } else {
                format!("the ranges say that the target is at the height {height}: taken, as --height {height} says")
            });
        }
    }
    if !is_flat && settings.height == Height::Unsaid {
        return Err(Error::Needed {
            argument: "height",
            reason: "the anchors have heights, and the first ranges do not tell that of the target",
        });
    }
    Ok(said)
}
