//! The level of a range: equal cells about a reference.

use crate::error::{Error, finite, positive};
use crate::math::ratio;

/// Edge `q` of `levels` equal cells on `centre +- half_width`; edge 0 and edge `levels` are those of the nominal cells, which are
/// continued to infinity.
#[inline]
pub fn edge(q: u32, levels: u32, centre: f64, half_width: f64) -> f64 {
    let share = ratio(q, levels);
    centre + half_width * (share + share - 1.0)
}

/// Level of a range: `clamp(floor((I + 1) levels / 2), 0, levels - 1)` with `I = (range - centre) / half_width`, by comparison with the edges of
/// [`edge`], so that rounding parts it from none. A range on an edge belongs to the cell above.
///
/// # Errors
/// If the range or the centre is not finite, the half width not above 0, or there are no levels.
pub fn range_level(range: f64, centre: f64, half_width: f64, levels: u32) -> Result<u32, Error> {
    finite("range", range)?;
    finite("centre", centre)?;
    positive("half_width", half_width)?;
    let Some(last) = levels.checked_sub(1) else {
        return Err(Error::new("levels", 0.0, "at least one level"));
    };
    // Bisection of the edges: without division, which is long in software.
    let (mut level, mut highest) = (0, last);
    while level < highest {
        let middle = highest - (highest - level) / 2;
        if range >= edge(middle, levels, centre, half_width) {
            level = middle;
        } else {
            highest = middle - 1;
        }
    }
    Ok(level)
}

/// [`range_level`] of codes, without floating point and with exact edges. With a half width of 0 it is the first or the last level.
#[inline]
pub fn range_level_of_codes(range: i32, centre: i32, half_width: u32, levels: u16) -> u32 {
    // The range less the lowest edge, and the distance of all edges: below 2^34, times `levels` below 2^50.
    let above = i64::from(range) - i64::from(centre) + i64::from(half_width);
    let (scaled, width) = (above * i64::from(levels), 2 * i64::from(half_width));
    let (mut level, mut edge) = (0, width);
    while level + 1 < u32::from(levels) && scaled >= edge {
        level += 1;
        edge += width;
    }
    level
}
