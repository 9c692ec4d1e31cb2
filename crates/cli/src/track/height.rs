//! The height of a target of `ranges`, where no option says it.

use super::anchors::Anchor;
use super::mistakes::limit;
use super::rows::Instants;
use crate::arguments::RangesOptions;
use crate::error::Error;
use crate::files::is_regular;
use fewbits_pf_mpa::{RangeSettings, height_of};

/// Rows from which the height is found.
const FIRST_ROWS: usize = 600;

/// The height that the first ranges of a file tell, if no option and no column of the anchors does. What comes through a pipe is not waited for.
pub(super) fn height_found(
    options: &RangesOptions,
    anchors: &[Anchor],
    settings: RangeSettings,
    instants: &mut Instants,
) -> Result<Option<f64>, Error> {
    if options.height.is_some() || !is_regular(&options.table.file) {
        return Ok(None);
    }
    let first = instants.peek(FIRST_ROWS)?.clone();
    let names = &instants.names;
    let mut ranges = Vec::new();
    for instant in &first {
        for (i, (sensor, range)) in instant.reports.iter().enumerate() {
            let name = &names[*sensor];
            let is_limit = instant.qualifiers.get(i).is_some_and(|one| one.limit.is_some());
            let is_known = anchors.iter().any(|(known, _)| known == name);
            if let Some(range) = range
                .filter(|range| range.is_finite() && (*range >= 0.0 || options.unknown_clock) && !is_limit && is_known)
            {
                ranges.push((instant.seconds, name.as_str(), range));
            }
        }
    }
    // Limits are no distances: they would tell a height that is not there.
    if let Some(limit) = limit(ranges.iter().map(|(_, anchor, range)| (*anchor, *range))) {
        ranges.retain(|(_, _, range)| *range < limit);
    }
    // What is wrong with a range is said when its row is read.
    Ok(height_of(anchors, settings, &ranges).unwrap_or(None))
}
