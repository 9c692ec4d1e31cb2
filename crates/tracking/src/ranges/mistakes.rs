//! Mistakes of tables that `ranges` tells.

use crate::text::short;
use fewbits_pf_mpa::{Mistake, RangeSettings, mistake_of, proportion_of};
use nalgebra::Vector3;

/// Ranges from which a mistake is found.
pub(crate) const FIRST_RANGES: usize = 400;

/// A range is a limit if one in so many of at least that many is it.
const REPEATED: usize = 20;

/// The largest of some ranges, with their anchors, if it stands there so often, and for two anchors, that it is a limit and no distance.
pub(crate) fn limit<A: PartialEq + Copy>(ranges: impl Iterator<Item = (A, f64)> + Clone) -> Option<f64> {
    let largest = ranges
        .clone()
        .fold(f64::NEG_INFINITY, |largest, (_, range)| largest.max(range));
    let those: Vec<A> = ranges
        .clone()
        .filter(|(_, range)| *range == largest)
        .map(|(anchor, _)| anchor)
        .collect();
    let is_often = those.len() >= REPEATED && those.len() * REPEATED >= ranges.count();
    (is_often && those.iter().any(|anchor| *anchor != those[0])).then_some(largest)
}

/// What to do about ranges that are limits.
pub(crate) fn limited(first: &[(f64, usize, f64)]) -> Option<String> {
    let limit = short(limit(first.iter().map(|(_, anchor, range)| (*anchor, *range)))?);
    Some(format!(
        "many ranges are {limit}, and none is longer: if the radio says no more, they are limits, and --missing {limit} leaves them out"
    ))
}

/// Ranges with the names of their anchors.
fn named<'a>(anchors: &'a [(String, Vector3<f64>)], first: &[(f64, usize, f64)]) -> Vec<(f64, &'a str, f64)> {
    let name = |anchor: usize| anchors.get(anchor).map(|(name, _)| name.as_str());
    let named = |(time, anchor, range): &(f64, usize, f64)| Some((*time, name(*anchor)?, *range));
    first.iter().filter_map(named).collect()
}

/// What to do about errors that grow with the distance.
pub(crate) fn proportion(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    first: &[(f64, usize, f64)],
) -> Option<String> {
    let (noise, _) = proportion_of(anchors, settings, &named(anchors, first)).ok()??;
    Some(grows(noise, "as"))
}

/// The mistake that explains the first ranges, if there is one.
pub(crate) fn mistake(
    anchors: &[(String, Vector3<f64>)],
    settings: RangeSettings,
    first: &[(f64, usize, f64)],
) -> Option<Mistake> {
    mistake_of(anchors, settings, &named(anchors, first)).ok()?
}

/// What to do about a mistake.
pub(crate) fn mended(mistake: &Mistake) -> Option<String> {
    let what = match mistake {
        Mistake::Height(height) => {
            let height = short(*height);
            format!("the target were at the height {height}: --height {height} says so")
        }
        Mistake::HeightChanges { mean, deviation } => {
            let (mean, deviation) = (short(*mean), short(*deviation));
            format!(
                "the height of the target changed, about {mean} by {deviation}: it is supposed to be constant, so places are wrong and bands too narrow"
            )
        }
        Mistake::Swapped(one, other) => {
            format!("anchors {one} and {other} had each other's place: exchange their names in the table of anchors")
        }
        Mistake::Axes(anchor) => {
            format!("x and y of anchor {anchor} stood for each other: exchange them in the table of anchors")
        }
        Mistake::Squared => "they were squares of distances: give the roots".to_owned(),
        Mistake::Unit(factor) => {
            let factor = short(*factor);
            format!("they were of another unit than the places: multiply them by {factor}")
        }
        Mistake::Doubled => {
            "they were twice the distances, the way there and back: multiply them by 0.5".to_owned()
        }
        Mistake::Flight => {
            "they were times of flight in nanoseconds, or feet, and places in metres: multiply them by 0.299792458, or 0.3048"
                .to_owned()
        }
        Mistake::RoundTrip => {
            "they were times there and back in nanoseconds and places in metres: multiply them by 0.149896229"
                .to_owned()
        }
        _ => return None,
    };
    Some(format!("the first ranges are as if {what}"))
}

/// What is said of errors that grow with the distance.
pub(crate) fn grows(noise: f64, taken: &str) -> String {
    let (noise, largest) = (short(100.0 * noise), (200.0 * noise).ceil());
    format!(
        "errors grow with the distance, {noise} % of it: {taken} --noise {largest}% says; a --noise without % leaves it out, and --rssi takes strengths in dBm"
    )
}
