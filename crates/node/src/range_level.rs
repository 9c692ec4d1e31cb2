//! The quantizer level of a range: equal cells about a reference.

use crate::error::{Error, finite, positive};
use crate::math::twice_ratio;

/// Edge `q`, `0 <= q <= levels`, of `levels` equal cells on `centre +- half_width`. The edges 0 and `levels` are those of the nominal
/// cells; the actual outer cells extend to infinity.
#[inline]
pub fn edge(q: u32, levels: u32, centre: f64, half_width: f64) -> f64 {
    let place = match q {
        0 => 0.0,
        q if q < levels => twice_ratio(q, levels),
        _ => 2.0,
    };
    at(place, centre, half_width)
}

/// The number at `place` half widths above the lowest edge.
fn at(place: f64, centre: f64, half_width: f64) -> f64 {
    centre + half_width * (place - 1.0)
}

/// Level of a range: `clamp(floor((I + 1) levels / 2), 0, levels - 1)` with `I = (range - centre) / half_width`. It is found by comparison
/// with the values of [`edge`], so rounding cannot contradict them. A range on an edge belongs to the cell above.
///
/// # Errors
/// If range or centre is not finite, the half width is not positive, or `levels` is zero.
pub fn range_level(range: f64, centre: f64, half_width: f64, levels: u32) -> Result<u32, Error> {
    finite("range", range)?;
    finite("centre", centre)?;
    positive("half_width", half_width)?;
    let Some(last) = levels.checked_sub(1) else {
        return Err(Error::new("levels", 0.0, "at least one level"));
    };
    let range = ordered(range);
    Ok(bisect(last, |q| range >= ordered(at(twice_ratio(q, levels), centre, half_width))))
}

/// The largest `q` up to `last` whose edge is reached; edge 0 always is. It uses comparisons only: divisions of doubles and of long
/// integers are library calls in software.
#[inline(always)]
fn bisect(last: u32, is_reached: impl Fn(u32) -> bool) -> u32 {
    let (mut level, mut highest) = (0, last);
    while level < highest {
        let middle = highest - (highest - level) / 2;
        if is_reached(middle) {
            level = middle;
        } else {
            highest = middle - 1;
        }
    }
    level
}

/// An integer with the order of the values; both zeros give the same. Comparing doubles is a library call in software.
fn ordered(value: f64) -> i64 {
    let bits = value.to_bits() as i64;
    if bits < 0 { i64::MIN.wrapping_sub(bits) } else { bits }
}

/// [`range_level`] for integer codes, without floating point and with exact edges. If the half width is 0, it is the first or the last
/// level.
#[inline]
pub fn range_level_of_codes(range: i32, centre: i32, half_width: u32, levels: u16) -> u32 {
    // Range minus lowest edge, and width of all cells: below 2^34, times `levels` below 2^50.
    let above = i64::from(range) - i64::from(centre) + i64::from(half_width);
    let (scaled, width) = (above * i64::from(levels), 2 * i64::from(half_width));
    bisect(u32::from(levels).saturating_sub(1), |q| scaled >= i64::from(q) * width)
}
